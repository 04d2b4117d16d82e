"""What `canbase setup commission` has proven for a robot, and whether robot.yaml is still the same.

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
UNIT_ERROR: Final = 10.0
"""A velocity unit that is wrong is so by 10 or more (rpm, 0.1 rpm)."""
SLOWEST_MPS: Final = 0.02
"""Slower than that many drives cannot turn a wheel."""
Mark = Annotated[str, Field(pattern=rf"^[dspfi][0-9a-f]{{{DIGITS}}}$", max_length=1 + DIGITS)]


class Commissioned(Section):
    """Written by `canbase setup commission`: for each step a mark of the values that it has shown; none: not done."""

    directions: Annotated[Mark | None, Field(description="which wheel turns which way")] = None
    scale: Annotated[Mark | None, Field(description="how far each wheel turns")] = None
    proof: Annotated[Mark | None, Field(description="that each drive stops by itself")] = None
    floor: Annotated[Mark | None, Field(description="wheel radius and track, by a measured drive")] = None
    identities: Annotated[Mark | None, Field(description="the drives of which `proof` holds, by 1018h")] = None


def mark(robot: Robot, step: Step) -> str:
    """The value of `commissioned` when this step has proven the values of `robot`."""
    return _hashed(step[0], _shown(robot, step))


def identities(robot: Robot) -> str:
    """The value of `commissioned.identities` for the drives that robot.yaml names by `identity`."""
    return _hashed("i", [[drive.node_id, *_numbers(drive)] for drive in robot.drives])


def without_proof(robot: Robot) -> str:
    """Why not every drive is proven to stop by itself, with the command that proves it; empty: all are, or the bus has
    no wire.

    A proof is about these drives alone: the driver boots no other ones, as `identity` in robot.yaml has their 1018h.
    """
    if robot.bus.is_virtual:
        return ""
    why = _why_not_proven(robot)
    joints = ", ".join(drive.joint for drive in robot.drives)
    return f"{joints}: {why}. With the wheels up: canbase setup commission --steps proof" if why else ""


def kind_alone(robot: Robot) -> str:
    """Which drives another one of their kind could replace without a new proof, as a sentence; empty: none.

    `identity` has no serial number of them, or 0, which manufacturers write where they do not number their drives.
    """
    joints = [drive.joint for drive in robot.drives if not drive.identity.serial]
    if robot.bus.is_virtual or _why_not_proven(robot) or not joints:
        return ""
    return (
        f"{', '.join(joints)}: 1018h:4 has no serial number, so the proof that it stops by itself is about its kind: "
        "after each exchange of a drive repeat canbase setup commission --steps proof"
    )


def is_proven(robot: Robot) -> bool:
    """Whether each drive, by its 1018h, was seen to stop by itself. No simulated one was."""
    return not robot.bus.is_virtual and not _why_not_proven(robot)


def _why_not_proven(robot: Robot) -> str:
    done, nameless = robot.commissioned, [drive.joint for drive in robot.drives if not any(_numbers(drive))]
    if done.proof is None:
        return "no proof that each drive stops by itself when this computer fails"
    if done.proof != mark(robot, "proof"):
        return "profile, node ids or timeouts.drive_heartbeat_s have changed since the proof that each drive stops"
    if nameless:
        return f"`identity` of {', '.join(nameless)} is not given, so the proof may be about another drive"
    if done.identities is None:
        return "the proof that each drive stops does not say with which drives it was made"
    if done.identities != identities(robot):
        return "`identity` has changed since the proof that each drive stops: it was made with other drives"
    return ""


def _hashed(letter: str, shown: list[Any]) -> str:
    """The letter: never a number in YAML."""
    return letter + hashlib.sha256(json.dumps(shown, sort_keys=True).encode()).hexdigest()[:DIGITS]


def _numbers(drive: Drive) -> tuple[int | None, ...]:
    """1018h, as far as it is known."""
    known = drive.identity
    return known.vendor_id, known.product_code, known.revision, known.serial


def uncommissioned(robot: Robot) -> str:
    """Which steps are missing, or have shown other values, as a sentence; empty: none, or the bus has no wire."""
    if robot.bus.is_virtual:
        return ""
    missing = [step for step in STEPS if getattr(robot.commissioned, step) is None]
    changed = [step for step in STEPS if getattr(robot.commissioned, step) not in (None, mark(robot, step))]
    defects = [f"not done: {', '.join(missing)}"] if missing else []
    defects += [f"robot.yaml has changed since: {', '.join(changed)}"] if changed else []
    return f"this robot is not commissioned ({'; '.join(defects)})" if defects else ""


def uncommissioned_mps(robot: Robot) -> float:
    """The speed limit of a robot that is not commissioned [m/s].

    Until `scale` has shown how far each wheel turns, a tenth of `limits.linear_mps` at most: a wheel whose drive counts
    in a unit that is wrong by 10 stays within the robot's own limit until the watchdog trips.
    """
    limit_mps = robot.safety.uncommissioned_mps
    if robot.commissioned.scale == mark(robot, "scale"):
        return limit_mps
    return min(limit_mps, max(robot.limits.linear_mps / UNIT_ERROR, SLOWEST_MPS))


def _shown(robot: Robot, step: Step) -> list[Any]:
    drives = [_DRIVE[step](drive) for drive in robot.drives]
    if step == "floor":
        base = robot.base
        ratio = [] if base.wheel_ratio == 1.0 else [base.wheel_ratio]  # marks from before this key stay valid
        return [drives, base.wheel_radius_m, base.track_m, *ratio]
    return [drives, robot.timeouts.drive_heartbeat_s] if step == "proof" else drives


def _place(drive: Drive) -> list[Any]:
    return [drive.joint, drive.node_id, drive.axis, drive.side, drive.direction]


def _scale(drive: Drive) -> list[Any]:
    units = [drive.target_unit, drive.actual_unit]
    return [drive.joint, drive.node_id, drive.axis, drive.gear_ratio, drive.counts_per_motor_rev, units]


def _kind(drive: Drive) -> list[Any]:
    """A profile of the user's own by its name: robot.yaml moves when it is installed, and the profile with it."""
    own = drive.kind.self_stop
    younger = {"node_guarding"} if not own.node_guarding else None  # a mark from before that key stays valid
    return [drive.node_id, drive.axis, Path(drive.profile).name, own.model_dump(exclude=younger)]


def _scale_and_objects(drive: Drive) -> list[Any]:
    """Without `expects`, as long as there are none: marks from before that key stay valid."""
    noted = sorted([each.index, each.sub, each.value] for each in drive.expects)
    return [*_scale(drive), *([noted] if noted else [])]


_DRIVE = {
    "directions": _place,
    "scale": _scale_and_objects,
    "proof": _kind,
    "floor": lambda drive: [_place(drive), _scale(drive)],
}
