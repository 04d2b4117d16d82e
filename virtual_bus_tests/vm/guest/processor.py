"""What the parts take of the processor, beside a bare rclpy node. Time of this guest is counted in instructions: a
nanosecond is one of them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from vm.guest.robot import Robot
from vm.guest.scenario import Row, elapsed
from vm.guest.system import PARTS, ROBOT_YAML, TARGET, BrokenPromiseError, run, show, unit

REST_S: Final = 10.0
GOAL_M: Final = 3.0
GOAL_S: Final = 6.0
"""At the speed of the scenarios it is driven for longer than it is measured."""
SETTLE_S: Final = 3.0
MILLION: Final = 1e6
BARE: Final = "a bare node of 100 Hz"
BARE_DOMAIN: Final = "77"
"""It hears nothing of the robot, nor the robot of it."""

OWN_RATES: Final = re.compile(r"^(rates|action):.*\n", re.MULTILINE)
"""The scenarios' robot has those of a small computer, overlay.py."""


def processor(robot: Robot) -> Row:
    """Instructions of each part in a second, the kernel's work for it included: at rest, and while a goal drives."""
    return _measured(robot, "control 50 Hz, odometry 25 Hz: 10 s at rest, 6 s of a goal")


def processor_at_standard_rates(robot: Robot) -> Row:
    """The same at 100 and 50 Hz; then robot.yaml is as before."""
    before = ROBOT_YAML.read_text()
    try:
        _restart(robot, OWN_RATES.sub("", before))
        return _measured(robot, "control 100 Hz, odometry 50 Hz: 10 s at rest, 6 s of a goal")
    finally:
        _restart(robot, before)


def _restart(robot: Robot, robot_yaml: str) -> None:
    ROBOT_YAML.write_text(robot_yaml)
    (pid,) = show(unit("driver"), "MainPID")
    run("systemctl", "restart", TARGET)
    robot.restarted("driver", pid)


def _measured(robot: Robot, how: str) -> Row:
    robot.make_ready()
    with _bare_node() as bare:
        robot.spin(SETTLE_S)
        rest = _in_a_second(robot, REST_S, bare)
    goal = robot.goal(GOAL_M)
    robot.spin(1.0)
    driving = _in_a_second(robot, GOAL_S)
    if goal.result is not None:
        raise BrokenPromiseError(f"the goal ended before the measurement: {goal.result}")
    goal.cancel()
    told = "; ".join(f"{part} {_millions(rest[part])}, {_millions(driving[part])}" for part in PARTS)
    return Row("processor", how, then=f"million instructions a second: {told}; {BARE} {_millions(rest[BARE])}")


@contextmanager
def _bare_node() -> Iterator[int]:
    """The floor that the benchmarks have as well; its process id."""
    child = subprocess.Popen(
        [sys.executable, "-m", "support.bare_node"], env=os.environ | {"ROS_DOMAIN_ID": BARE_DOMAIN}
    )
    try:
        yield child.pid
    finally:
        child.kill()
        child.wait()


def _in_a_second(robot: Robot, for_s: float, bare: int | None = None) -> Mapping[str, float]:
    pids = {part: int(show(unit(part), "MainPID")[0]) for part in PARTS} | ({BARE: bare} if bare else {})
    before = {part: _instructions(pid) for part, pid in pids.items()}
    begun_s = elapsed(0.0)
    robot.spin(for_s)
    lasted_s = elapsed(begun_s)
    return {part: (_instructions(pid) - before[part]) / lasted_s for part, pid in pids.items()}


def _instructions(pid: int) -> int:
    """Of all threads of a process so far (Documentation/scheduler/sched-stats: the first field is time on the CPU)."""
    return sum(int(file.read_text().split()[0]) for file in Path(f"/proc/{pid}/task").glob("*/schedstat"))


def _millions(instructions: float) -> str:
    return f"{instructions / MILLION:.0f}"
