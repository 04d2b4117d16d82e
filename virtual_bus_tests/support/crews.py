"""Which drives the tests in real time drive: each kind that has a profile, several under one robot, or a real robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from canbase_config.load import load_robot, sample
from canbase_config.profile_file import load_profile
from canbase_config.robot import Robot

OPEN_UNIT = "0.1rpm"
"""One bit of 60FFh where the profile leaves it to the drive's own settings; the simulated ones take robot.yaml's."""
KINDS_TOGETHER = (
    ("epos4", "roboteq", "elmo_gold"),
    ("zlac8015d", "nanotec", "kinco"),
    ("technosoft", "tmcm1636", "dryve_d1", "inverter"),
)
"""Four axes a robot: they boot beside each other, turn together, and all stop for the fault of one. `generic` is the
drive of most other tests on a bus."""
REAL_SPEED_MPS = 0.05
"""Rim speed on a real bus: about the pace of a hand, with the wheels up."""


@dataclass(frozen=True, slots=True)
class Crew:
    """A robot and how far it may go in a test."""

    name: str
    robot: Robot
    simulated: bool = True
    speed_mps: float = 0.3
    way_m: float = 0.12


def simulated_crews(kind: str | None) -> list[Crew]:
    """Robots with all kinds of drives, or one with two drives of `kind`."""
    if kind is not None:
        return [Crew(kind, _patient(robot_with(kind)))]
    return [Crew("+".join(kinds), _patient(_mixed(kinds))) for kinds in KINDS_TOGETHER]


def _patient(robot: Robot) -> Robot:
    """Driver, watchdog and drives share one process there: on a loaded computer the turns of all of them come late."""
    watchdog = robot.watchdog.model_copy(update={"loop_late_s": 0.3})
    timeouts = robot.timeouts.model_copy(update={"feedback_s": 0.3})
    return robot.model_copy(update={"watchdog": watchdog, "timeouts": timeouts})


def real_crew(bus: Mapping[str, Any], kind: str | None, file: Path | None) -> Crew:
    """The robot of `file`, or the sample one with drives of `kind`, on `bus`; its own limits hold it back too."""
    robot = load_robot(file).robot if file is not None else robot_with(kind or "generic")
    values = robot.model_dump()
    values["bus"] |= dict(bus) | ({} if robot.bus.interface == bus["interface"] else {"extra": {}})
    if file is not None and kind is not None:
        values["drives"] = [drive | {"profile": kind} for drive in values["drives"]]
    slow = REAL_SPEED_MPS * 1.2
    values["limits"] |= {"linear_mps": slow, "angular_radps": 2.0 * slow / robot.base.track_m}
    return Crew(f"{kind or 'robot'} on {bus['channel']}", Robot.model_validate(values), False, REAL_SPEED_MPS, 0.02)


def robot_with(kind: str, **changes: object) -> Robot:
    """The bench robot with two drives of that kind; where one node turns two motors behind one controlword, both."""
    values = load_robot(sample("bench")).robot.model_dump()
    both = load_profile(kind).layout.second_axis == "sub_index"
    for number, drive in enumerate(values["drives"]):
        drive |= of_kind(kind) | ({"node_id": 1, "axis": number} if both else {}) | changes
    return Robot.model_validate(values)


def of_kind(kind: str) -> dict[str, Any]:
    """The keys of a drive that make it one of that kind."""
    return {
        "profile": kind,
        "velocity_unit": OPEN_UNIT if load_profile(kind).units.target_velocity is None else None,
    }


def _mixed(kinds: tuple[str, ...]) -> Robot:
    """Left and right in turn, a node for each; of kinds for two motors one node turns a wheel on each side."""
    values = load_robot(sample("bench")).robot.model_dump()
    like = dict(zip(("left", "right"), values["drives"], strict=True))
    drives: list[dict[str, Any]] = []
    for node_id, kind in enumerate(kinds, start=1):
        sides = ["left", "right"] if load_profile(kind).layout.axes == 2 and len(kinds) < 4 else [_rarer(drives)]
        for axis, side in enumerate(sides):
            place = {"joint": f"{kind}_{side}", "node_id": node_id, "axis": axis}
            drives.append(like[side] | of_kind(kind) | place)
    return Robot.model_validate(values | {"drives": tuple(drives)})


def _rarer(drives: list[dict[str, Any]]) -> str:
    left = sum(drive["side"] == "left" for drive in drives)
    return "left" if 2 * left <= len(drives) else "right"
