"""What VDA 5050, version 2.1.0, requires of the keys that canbase fills, as a JSON schema in our words.

VDA's own json_schemas/state.schema is not in this repository. CANBASE_VDA5050_SCHEMA=FILE has the tests take that too.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Final

_TEXT: Final = {"type": "string"}


def _object(required: dict[str, Any], optional: dict[str, Any] | None = None) -> dict[str, Any]:
    return {"type": "object", "required": list(required), "properties": required | (optional or {})}


_REFERENCE: Final = _object({"referenceKey": _TEXT, "referenceValue": _TEXT})
_ERROR: Final = _object(
    {"errorType": _TEXT, "errorLevel": {"enum": ["WARNING", "FATAL"]}},
    {
        "errorReferences": {"type": "array", "items": _REFERENCE},
        "errorDescription": _TEXT,
        "errorHint": _TEXT,
    },
)
_SAFETY: Final = _object(
    {"eStop": {"enum": ["AUTOACK", "MANUAL", "REMOTE", "NONE"]}, "fieldViolation": {"type": "boolean"}}
)
OURS: Final = {"$schema": "https://json-schema.org/draft/2020-12/schema"} | _object(
    {
        "timestamp": {"type": "string", "format": "date-time"},
        "version": {"type": "string", "pattern": r"^\d+\.\d+\.\d+$"},
        "driving": {"type": "boolean"},
        "errors": {"type": "array", "items": _ERROR},
        "safetyState": _SAFETY,
    }
)
OF_THE_CLIENT: Final = {
    "headerId": 1, "manufacturer": "somebody", "serialNumber": "1", "orderId": "", "orderUpdateId": 0, "lastNodeId": "",
    "lastNodeSequenceId": 0, "nodeStates": [], "edgeStates": [], "actionStates": [], "operatingMode": "AUTOMATIC",
    "batteryState": {"batteryCharge": 80.0, "charging": False},
}  # fmt: skip
"""The other keys that the schema requires, as a fleet client without an order sends them."""


def schemas() -> list[dict[str, Any]]:
    """Ours, and VDA's where the environment names it."""
    theirs = os.environ.get("CANBASE_VDA5050_SCHEMA", "")
    return [OURS, *(json.loads(Path(file).read_text(encoding="utf-8")) for file in theirs.split(":") if file)]
