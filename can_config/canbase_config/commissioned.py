"""What `canbase commission` has proven for a robot, and whether robot.yaml is still the same.

A wheel radius that is a diameter, an inverted gear ratio, a wheel or both sides swapped: all parts,
the watchdog too, compute with the same robot.yaml, and the drives agree with it. Only a person who looks at the wheels
and measures the floor can detect it. So each step of the commissioning leaves a mark of its result in robot.yaml.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import Field

from canbase_config.section import Section

if TYPE_CHECKING:
    from canbase_config.drive import Drive
    from canbase_config.robot import Robot

Step = Literal["directions", "scale", "proof", "floor"]
STEPS: Final[tuple[Step, ...]] = ("directions", "scale", "proof", "floor")
DIGITS: Final = 12
Mark = Annotated[str, Field(pattern=rf"^[dspf][0-9a-f]{{{DIGITS}}}$", max_length=1 + DIGITS)]


class Commissioned(Section):
    """Written by `canbase commission`: for each step a mark of the values that it has shown; none: not done."""

    directions: Annotated[Mark | None, Field(description="which wheel turns which way")] = None
    scale: Annotated[Mark | None, Field(description="how far each wheel turns")] = None
    proof: Annotated[Mark | None, Field(description="that each drive stops by itself")] = None
    floor: Annotated[Mark | None, Field(description="wheel radius and track, by a measured drive")] = None


def mark(robot: Robot, step: Step) -> str:
    """The value of `commissioned` when this step has proven the values of `robot`."""
    shown = json.dumps(_shown(robot, step), sort_keys=True)
    return step[0] + hashlib.sha256(shown.encode()).hexdigest()[:DIGITS]  # the letter: never a number in YAML


def uncommissioned(robot: Robot) -> str:
    """Which steps are missing, or have shown other values, as a sentence; empty: none, or the bus has no wire."""
    if robot.bus.is_virtual:
        return ""
    missing = [step for step in STEPS if getattr(robot.commissioned, step) is None]
    changed = [step for step in STEPS if getattr(robot.commissioned, step) not in (None, mark(robot, step))]
    defects = [f"not done: {', '.join(missing)}"] if missing else []
    defects += [f"robot.yaml has changed since: {', '.join(changed)}"] if changed else []
    return f"this robot is not commissioned ({'; '.join(defects)})" if defects else ""


def _shown(robot: Robot, step: Step) -> list[Any]:
    drives = [_DRIVE[step](drive) for drive in robot.drives]
    if step == "floor":
        return [drives, robot.base.wheel_radius_m, robot.base.track_m]
    return [drives, robot.timeouts.drive_heartbeat_s] if step == "proof" else drives


def _place(drive: Drive) -> list[Any]:
    return [drive.joint, drive.node_id, drive.axis, drive.side, drive.direction]


def _scale(drive: Drive) -> list[Any]:
    units = [drive.target_unit, drive.actual_unit]
    return [drive.joint, drive.node_id, drive.axis, drive.gear_ratio, drive.counts_per_motor_rev, units]


def _kind(drive: Drive) -> list[Any]:
    """A profile of the user's own by its name: robot.yaml moves when it is installed, and the profile with it."""
    return [drive.node_id, drive.axis, Path(drive.profile).name, drive.kind.self_stop.model_dump()]


_DRIVE = {
    "directions": _place,
    "scale": _scale,
    "proof": _kind,
    "floor": lambda drive: [_place(drive), _scale(drive)],
}
