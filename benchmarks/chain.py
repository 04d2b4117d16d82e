"""What the chain takes of the computer: driver, watchdog, velocity and action server, at rest and while a goal drives.

A robot of real processes on the virtual bus. Beside them, at the same time and with the same priority: a rclpy node
with one timer and one publisher at 100 Hz.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any

from figures import Figure
from shares import BARE, IO_ALONE, bare_node, io_alone, resident_mb, shares
from startup import MANY, drives
from support.running_robot import PATIENT, RunningRobot, own_domain, robot_on

PARTS = ("driver", "watchdog", "velocity", "action-server")
SECONDS, DRIVING_S, QUICK_S = 20.0, 12.0, 8.0
DISTANCE_M, SPEED_MPS = 4.9, 0.3
"""A goal that lasts for longer than DRIVING_S."""
REST, DRIVING, ALONE, AXES = 2.5, 3.5, 1.2, 2.5
MEMORY_MB = 196.0
"""60 % of what it was when the budget was made."""


def quick() -> list[Figure]:
    """Processor at rest, measured for a short time."""
    with ExitStack() as stack:
        robot, pids = _robot(stack, PATIENT)
        return _at_rest(shares(pids, QUICK_S, robot.node.spin_for))


def measure() -> list[Figure]:
    """Processor and memory of a base with two axes, and the driver's with eight."""
    with ExitStack() as stack:
        robot, pids = _robot(stack, PATIENT)
        rest = shares(pids, SECONDS, robot.node.spin_for)
        robot.goal(DISTANCE_M, SPEED_MPS)
        robot.node.spin_for(1.0)
        driving = shares(pids, DRIVING_S, robot.node.spin_for)
        memory_mb = {name: resident_mb(pid) for name, pid in pids.items()}
    with ExitStack() as stack:
        robot, pids = _robot(stack, {**PATIENT, "drives": drives(MANY)})
        many = shares(pids, SECONDS, robot.node.spin_for)
    return [
        *_at_rest(rest),
        _share("whole chain: processor while a goal drives", PARTS, driving, DRIVING),
        _io(rest),
        _axes(rest, many),
        _memory(memory_mb),
    ]


def _at_rest(found: Mapping[str, float]) -> list[Figure]:
    return [
        _share("driver: processor at 100 Hz, two axes, odometry at 50 Hz", ("driver",), found, ALONE),
        _share("whole chain: processor at rest", PARTS, found, REST),
    ]


def _robot(stack: ExitStack, changes: Mapping[str, Any]) -> tuple[RunningRobot, dict[str, int]]:
    domain = stack.enter_context(own_domain())
    robot = stack.enter_context(robot_on(domain, changes=changes))
    ros_domain = robot.env["ROS_DOMAIN_ID"]
    pids = {part: robot.stack.pids[part] for part in PARTS} | {
        BARE: bare_node(stack, ros_domain),
        IO_ALONE: io_alone(stack, ros_domain, robot.robot.bus.arguments()),
    }
    robot.node.spin_for(3.0)
    return robot, pids


def _share(what: str, parts: tuple[str, ...], found: Mapping[str, float], budget: float) -> Figure:
    ours, ratio = sum(found[part] for part in parts), sum(found[part] for part in parts) / found[BARE]
    each = "" if len(parts) == 1 else f" ({', '.join(f'{part} {found[part]:.1%}' for part in parts)})"
    beside = f"rclpy node, one 100 Hz timer and publisher: {found[BARE]:.1%}"
    return Figure(
        what, f"{ours:.1%} of a processor{each}", beside, ratio, f"≤ {budget} × the bare node", ratio <= budget
    )


def _io(found: Mapping[str, float]) -> Figure:
    """What is left of the driver where it decides nothing."""
    ours, floor = found["driver"], found[IO_ALONE]
    beside = f"its input and output alone: {floor:.1%}, {floor / found[BARE]:.2f} × the bare node"
    return Figure("driver: processor", f"{ours:.1%} of a processor", beside, ours / floor, "–", True)


def _axes(few: Mapping[str, float], many: Mapping[str, float]) -> Figure:
    """Each beside the bare node of its own run: the two were not at the same time."""
    two, eight = few["driver"] / few[BARE], many["driver"] / many[BARE]
    what = f"driver: processor with {MANY} axes"
    beside = f"two axes: {two:.2f} × the bare node"
    return Figure(
        what, f"{eight:.2f} × the bare node", beside, eight / two, f"≤ {AXES} × two axes", eight <= AXES * two
    )


def _memory(found: Mapping[str, float]) -> Figure:
    ours = sum(found[part] for part in PARTS)
    beside = f"the bare node: {found[BARE]:.0f} MB"
    return Figure("whole chain: memory", f"{ours:.0f} MB", beside, ours / found[BARE], "≤ 196 MB", ours <= MEMORY_MB)


if __name__ == "__main__":
    for figure in measure():
        print(figure)
