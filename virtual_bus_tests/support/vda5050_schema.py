"""What VDA 5050, versions 2.1.0 and 3.0.0, requires of the keys that canbase fills, as JSON schemas in our words.

VDA's own json_schemas/state.schema are not in this repository. CANBASE_VDA5050_SCHEMA=FILE:FILE has the tests take them
too, of each version.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Final

from canbase_fleet.vda5050 import V2, V3

_TEXT: Final = {"type": "string"}


def _object(required: dict[str, Any], optional: dict[str, Any] | None = None) -> dict[str, Any]:
    return {"type": "object", "required": list(required), "properties": required | (optional or {})}


_REFERENCE: Final = _object({"referenceKey": _TEXT, "referenceValue": _TEXT})
_TIMES: Final = {
    "timestamp": {"type": "string", "format": "date-time"},
    "version": {"type": "string", "pattern": r"^\d+\.\d+\.\d+$"},
    "driving": {"type": "boolean"},
}
_VIOLATION: Final = {"fieldViolation": {"type": "boolean"}}


def _ours(levels: list[str], stop: str, stops: list[str]) -> dict[str, Any]:
    error = _object(
        {"errorType": _TEXT, "errorLevel": {"enum": levels}},
        {
            "errorReferences": {"type": "array", "items": _REFERENCE},
            "errorDescription": _TEXT,
            "errorHint": _TEXT,
        },
    )
    safety = _object({stop: {"enum": stops}} | _VIOLATION)
    keys = _TIMES | {"errors": {"type": "array", "items": error}, "safetyState": safety}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema"} | _object(keys)


OURS: Final = {
    V2: _ours(["WARNING", "FATAL"], "eStop", ["AUTOACK", "MANUAL", "REMOTE", "NONE"]),
    V3: _ours(["WARNING", "URGENT", "CRITICAL", "FATAL"], "activeEmergencyStop", ["MANUAL", "REMOTE", "NONE"]),
}
OF_THE_CLIENT: Final = {
    "headerId": 1, "manufacturer": "somebody", "serialNumber": "1", "orderId": "", "orderUpdateId": 0, "lastNodeId": "",
    "lastNodeSequenceId": 0, "nodeStates": [], "edgeStates": [], "actionStates": [], "operatingMode": "AUTOMATIC",
    "batteryState": {"batteryCharge": 80.0, "charging": False},
    "instantActionStates": [], "powerSupply": {"stateOfCharge": 80.0, "charging": False},
}  # fmt: skip
"""The other keys that the schemas require, as a fleet client without an order sends them: batteryState is of 2.1.0, the
last two are of 3.0.0."""


def schemas() -> list[tuple[str, dict[str, Any]]]:
    """Version and schema: ours, and VDA's where the environment names it."""
    files = [Path(file) for file in os.environ.get("CANBASE_VDA5050_SCHEMA", "").split(":") if file]
    theirs = [json.loads(file.read_text(encoding="utf-8")) for file in files]
    return [*OURS.items(), *((V3 if "powerSupply" in each["required"] else V2, each) for each in theirs)]
