"""The part of the VDA 5050 state message that canbase knows: safetyState, errors, driving. Pure.

Source: VDA 5050, versions 2.1.0 (section 6.10) and 3.0.0 (section 7.8), and their json_schemas/state.schema,
github.com/VDA5050/VDA5050. Orders, nodes, the map and the battery's charge are those of the fleet client, which sends
the whole message and takes these keys in.
"""

from __future__ import annotations

import json
from typing import Any, Final

from canbase_config.robot import Robot
from canbase_fleet.robot_view import RobotView
from canbase_fleet.safety_state import active_emergency_stop, driving, estop, field_violation
from canbase_fleet.vda_errors import errors

V2: Final = "2.1.0"
V3: Final = "3.0.0"


def state(view: RobotView, robot: Robot, timestamp: str, version: str = V2) -> dict[str, Any]:
    """Keys of the state message. `timestamp`: of now, UTC, ISO 8601 as VDA 5050 has it. `version`: V2 or V3."""
    name, stop = {V2: ("eStop", estop), V3: ("activeEmergencyStop", active_emergency_stop)}[version]
    return {
        "timestamp": timestamp,
        "version": version,
        "driving": driving(view),
        "errors": [error.as_json() for error in errors(view, robot)],
        "safetyState": {name: stop(view, robot).value, "fieldViolation": field_violation(view, robot)},
    }


def essence(view: RobotView, robot: Robot) -> tuple[object, ...]:
    """What makes two states differ for a fleet: not the numbers in their sentences."""
    keys = tuple(error.key for error in errors(view, robot))
    stops = estop(view, robot), active_emergency_stop(view, robot)
    return driving(view), keys, stops, field_violation(view, robot)


def line(message: dict[str, Any]) -> str:
    """On one line."""
    return json.dumps(message, ensure_ascii=False, separators=(",", ":"))
