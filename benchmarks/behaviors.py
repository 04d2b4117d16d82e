"""How exactly do Nav2's behaviours stop, driven by canbase and by loops written after Nav2's own?

    python benchmarks/behaviors.py [--goals 300] [--write docs]

Every goal of DriveOnHeading and of Spin is driven once by each loop on the same base, with the same noise: the bases
and the straight goals of accuracy.py. The loops of Nav2 are written after nav2_behaviors (branches jazzy and main),
with their default parameters, and order the base directly: velocity_smoother and collision_monitor would add delay.
Their collision check is left out: nothing is in the way.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from accuracy import cases, quantile
from canbase_action_server.goal_request import Request
from canbase_action_server.inputs import Odometry
from canbase_action_server.motion import STOP, BaseTwist
from canbase_action_server.nav2_request import Target, drive_on_heading, spin
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from drive_rig import Case, Rig
from drive_ways import Controller, Ours
from figures import replace_section

NAV2_PERIOD_S = 0.1
"""behavior_server's cycle_frequency is 10 Hz."""
AFTER_S = 1.5
"""The base is watched for this long after the result [s]."""
LIMIT_S = 200.0
HEADING = "### Nav2's behaviours"


class ConstantSpeed:
    """DriveOnHeading of branch jazzy: the goal's speed until the distance is there, then one zero, and the result."""

    period_s = NAV2_PERIOD_S

    def __init__(self, start: Odometry, distance_m: float, speed_mps: float) -> None:
        self._start, self._distance_m = start.pose, distance_m
        self._speed_mps = math.copysign(speed_mps, distance_m)

    def cycle(self, odometry: Odometry, now_s: float) -> tuple[BaseTwist, bool]:
        """One cycle."""
        left_m = abs(self._distance_m) - self._driven_m(odometry)
        return (STOP, True) if left_m <= 0.0 else (BaseTwist(self._speed(left_m)), False)

    def _driven_m(self, odometry: Odometry) -> float:
        return math.hypot(odometry.pose.x_m - self._start.x_m, odometry.pose.y_m - self._start.y_m)

    def _speed(self, left_m: float) -> float:
        return self._speed_mps


class LimitedSpeed(ConstantSpeed):
    """DriveOnHeading of the branch main: limited acceleration, v² = 2as before the end, and a minimum speed."""

    LIMIT_MPS2 = 2.5
    MINIMUM_MPS = 0.1

    def __init__(self, start: Odometry, distance_m: float, speed_mps: float) -> None:
        super().__init__(start, distance_m, speed_mps)
        self._last_mps = 0.0

    def _speed(self, left_m: float) -> float:
        step_mps = self.LIMIT_MPS2 * NAV2_PERIOD_S
        feasible_mps = max(self._last_mps - step_mps, min(self._last_mps + step_mps, abs(self._speed_mps)))
        stopping_mps = math.sqrt(2.0 * self.LIMIT_MPS2 * left_m)
        self._last_mps = max(min(feasible_mps, stopping_mps), self.MINIMUM_MPS)
        return math.copysign(self._last_mps, self._speed_mps)


class Nav2Spin:
    """Spin of both branches: v² = 2as between a minimum and a maximum speed, then one zero and the result."""

    period_s = NAV2_PERIOD_S
    SLOWEST_RADPS, FASTEST_RADPS, LIMIT_RADPS2 = 0.4, 1.0, 3.2

    def __init__(self, start: Odometry, angle_rad: float) -> None:
        self._angle_rad, self._last_rad, self._turned_rad = angle_rad, start.pose.yaw_rad, 0.0

    def cycle(self, odometry: Odometry, now_s: float) -> tuple[BaseTwist, bool]:
        """One cycle."""
        self._turned_rad += math.remainder(odometry.pose.yaw_rad - self._last_rad, 2.0 * math.pi)
        self._last_rad = odometry.pose.yaw_rad
        left_rad = abs(self._angle_rad) - abs(self._turned_rad)
        if left_rad < 1e-6:
            return STOP, True
        radps = min(max(math.sqrt(2.0 * self.LIMIT_RADPS2 * left_rad), self.SLOWEST_RADPS), self.FASTEST_RADPS)
        return BaseTwist(0.0, math.copysign(radps, self._angle_rad)), False


@dataclass(frozen=True, slots=True)
class Measured:
    """One goal, in its direction [m, or rad of a turn], by encoder."""

    error: float
    """Where the base stood in the end, beyond (+) or short of (-) the goal."""
    after: float
    """Driven or turned after the result."""
    duration_s: float


def follow(rig: Rig, case: Case, controller: Controller, goal: float, read: Callable[[], float]) -> Measured:
    """One goal until the base stands after the result. `read`: what the base has driven or turned."""
    next_cycle, ended, ended_at = 0.0, math.inf, 0.0
    for step in range(1, round(LIMIT_S / case.body.step_s)):
        now_s = step * case.body.step_s
        rig.step(now_s)
        if now_s >= next_cycle and ended == math.inf:
            next_cycle += controller.period_s
            twist, is_result = controller.cycle(rig.odometry, now_s)
            rig.order(twist, now_s)
            if is_result:
                ended, ended_at = now_s, read()
        if now_s >= ended + AFTER_S:
            return Measured(math.copysign(1.0, goal) * read() - abs(goal), abs(read() - ended_at), ended)
    raise RuntimeError(f"no result within {LIMIT_S} s: {case}")


Drive = Callable[[Robot, Case, Odometry], Controller]
STRAIGHT: dict[str, Drive] = {
    "drive_on_heading of canbase": lambda robot, case, start: Ours(robot, start, _heading(robot, case)),
    "DriveOnHeading, Nav2 jazzy": lambda robot, case, start: ConstantSpeed(start, case.distance_m, case.speed_mps),
    "DriveOnHeading, Nav2 main": lambda robot, case, start: LimitedSpeed(start, case.distance_m, case.speed_mps),
}
TURNS: dict[str, Callable[[Robot, float, Odometry], Controller]] = {
    "spin of canbase": lambda robot, angle_rad, start: Ours(robot, start, spin(robot, angle_rad, 0.0)),
    "Spin, Nav2 jazzy and main": lambda robot, angle_rad, start: Nav2Spin(start, angle_rad),
}


def _heading(robot: Robot, case: Case) -> Request:
    return drive_on_heading(robot, Target(case.distance_m), math.copysign(case.speed_mps, case.distance_m), 0.0)


def straight(robot: Robot, case: Case, way: Drive) -> Measured:
    """One goal of DriveOnHeading."""
    rig = Rig(robot, case)
    return follow(rig, case, way(robot, case, rig.odometry), case.distance_m, lambda: rig.way_m)


def turn(robot: Robot, case: Case, angle_rad: float, way: Callable[[Robot, float, Odometry], Controller]) -> Measured:
    """One goal of Spin."""
    rig = Rig(robot, case)
    return follow(rig, case, way(robot, angle_rad, rig.odometry), angle_rad, lambda: rig.turned_rad)


def angles(count: int) -> list[float]:
    """`count` random goals of Spin [rad]; the same ones in every run."""
    chance = random.Random(21)
    return [chance.choice((-1.0, 1.0)) * chance.uniform(0.2, 2.0 * math.pi) for _ in range(count)]


def table(results: dict[str, list[Measured]], unit: float, name: str) -> str:
    """As Markdown; values are multiplied by `unit`, whose name is `name`."""
    head = [f"{what} {mark}" for what in ("error", "moved after the result") for mark in ("p50", "p99", "max")]
    lines = [f"| [{name}] | {' | '.join(head)} | median time [s] |", "|---" * (len(head) + 2) + "|"]
    for way, measured in results.items():
        columns = [[abs(m.error) for m in measured], [m.after for m in measured]]
        cells = [f"{unit * quantile(column, share):.1f}" for column in columns for share in (0.5, 0.99, 1.0)]
        lines.append(f"| {way} | {' | '.join(cells)} | {quantile([m.duration_s for m in measured], 0.5):.1f} |")
    return "\n".join(lines)


def section(robot: Robot, count: int) -> str:
    """The section of docs/odometry.md."""
    chosen = cases(robot, count)
    lines = {name: [straight(robot, case, way) for case in chosen] for name, way in STRAIGHT.items()}
    turned = [(replace(case, distance_m=1.0), angle) for case, angle in zip(chosen, angles(count), strict=True)]
    turns = {name: [turn(robot, case, angle, way) for case, angle in turned] for name, way in TURNS.items()}
    return f"""{HEADING}

Loops written after Nav2's published sources (branches jazzy and main), with their default parameters: 10 Hz, one zero
command at the goal, and the result at once. {count} goals on the bases above.
`python benchmarks/behaviors.py --write docs` writes this section.

{table(lines, 1000.0, "mm")}

{table(turns, 1000.0, "mrad")}

Nav2's own code does not run here. The loops command the base directly; on a robot velocity_smoother and
collision_monitor add their delay.
"""


def main() -> int:
    """Exit code 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--goals", type=int, default=300)
    parser.add_argument("--write", type=Path, metavar="FOLDER", help="replace the section of odometry.md there")
    arguments = parser.parse_args()
    text = section(load_robot(sample("bench")).robot, arguments.goals)
    print(text)
    if arguments.write:
        replace_section(arguments.write / "odometry.md", text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
