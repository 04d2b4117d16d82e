"""`python -m campaign.hazard_cases`: hazards on drawn robots, straight on and in turns: who acts when, and the promise.

`Case.run` is one hazard at one motion of one robot, for any search. A promise is the formula `within_s` of the row in
hazards.yaml, from the failure, or from the order of zero after it, until a component reports that it stops the base.
Exit code 1: one did not hold.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from random import Random

from rich.console import Console

from canbase_campaign.cruise import JOYSTICK_S, Cruise, Run
from canbase_campaign.robots import DrawnRobot, draw_robot
from canbase_campaign.twins import DRIVER, JOYSTICK, MEASURED, Twin
from canbase_config.robot import Robot
from canbase_hazards.catalogue import load
from canbase_hazards.formula import evaluate

SHARES = (0.1, 0.25, 0.3, 0.4, 0.6, 0.8, 1.0)
"""Of the limits: motions that are tried. The worst lies just under a threshold, so they are varied by VARIES."""
VARIES = 0.15
ROWS = {row.id: row for row in load().rows}


@dataclass(frozen=True, slots=True)
class Motion:
    """What the joystick orders. Forward and counter-clockwise positive (REP 103)."""

    linear_mps: float
    angular_radps: float

    def fastest_mps(self, robot: Robot) -> float:
        """Of both sides, whichever is faster [m/s]."""
        return abs(self.linear_mps) + abs(self.angular_radps) * robot.base.track_m / 2.0

    def slowest_mps(self, robot: Robot) -> float:
        """Of both sides, whichever is slower [m/s]."""
        return abs(abs(self.linear_mps) - abs(self.angular_radps) * robot.base.track_m / 2.0)


@dataclass(frozen=True, slots=True)
class Case:
    """A failure of a row of hazards.yaml: `what` and `how` of its twin.

    `from_fastest`, `from_slowest`: it counts where the fastest, and the slowest wheel is ordered at least this many
    times watchdog.motion_tolerance_mps; what holds for slower ones is in `not_covered` of the row.
    """

    row: str
    what: str
    how: str
    alone: bool = False
    """A second driven wheel on the same side carries the failed one along: the base moves as ordered."""
    from_fastest: float = 0.0
    from_slowest: float = 0.0

    @property
    def twin(self) -> Twin:
        """The failure in virtual time, in a base that the joystick drives."""
        return next(twin for twin in MEASURED if twin.key == (self.what, self.how))

    def covers(self, robot: Robot, motion: Motion) -> bool:
        """Whether the promise is about this motion."""
        slack_mps, sides = robot.watchdog.motion_tolerance_mps, [drive.side for drive in robot.drives]
        if self.alone and max(map(sides.count, sides)) > 1:
            return False
        fast, slow = motion.fastest_mps(robot), motion.slowest_mps(robot)
        return fast >= self.from_fastest * slack_mps and slow >= self.from_slowest * slack_mps

    def within_s(self, robot: Robot) -> float:
        """The promise for this robot, and the time until the joystick sends the zero that it is measured from [s]."""
        waits_s = JOYSTICK_S if self.twin.then_zero_s else 0.0
        return evaluate(ROWS[self.row].within_s, robot) + waits_s

    def run(self, drawn: DrawnRobot, motion: Motion, seed: int = 0) -> Run:
        """One run; `acts_s` is what the promise is about. Raises RuntimeError: the drives cannot be enabled."""
        cruise = Cruise(JOYSTICK, motion.linear_mps, drawn, motion.angular_radps)
        return cruise.fork(self.twin, seed)


CASES = (
    Case(
        "driver_repeats_setpoints",
        DRIVER,
        "repeats its last setpoints for ever, then zero is commanded",
        from_fastest=1.5,
    ),
    Case("driver_repeats_setpoints", DRIVER, "ignores zero, then zero is commanded", from_fastest=1.5),
    Case("wheel_does_not_follow", "wheel", "blocked", from_slowest=1.0),
    Case("motor_without_force", "wheel", "motor without force", alone=True, from_slowest=1.5),
    Case("setpoint_lost_at_the_drive", "wheel", "setpoints lost, then zero is commanded", from_slowest=1.5),
)


@dataclass(frozen=True, slots=True)
class Tried:
    """One run of one case."""

    case: Case
    number: int
    motion: Motion
    run: Run
    within_s: float

    @property
    def holds(self) -> bool:
        """The component acted in time, or the base stood by then: the drive did not need what it lost."""
        return min(self.run.acts_s, self.run.time_s) <= self.within_s

    def __str__(self) -> str:
        return (
            f"{'ok' if self.holds else 'LATE'} {self.case.row} ({self.case.how}), robot {self.number}, "
            f"{self.motion.linear_mps:.3f} m/s {self.motion.angular_radps:+.3f} rad/s: {self.run.acts_s:.3f} s of "
            f"{self.within_s:.3f} s, {self.run.cause}"
        )


def drawn_motions(robot: Robot, random: Random, count: int) -> list[Motion]:
    """Motions within the limits: straight on, in place, and curves."""
    limits, motions = robot.limits, []
    for _ in range(count):
        linear, angular = (random.choice(SHARES) * (1.0 - VARIES * random.random()) for _ in range(2))
        kind = random.choice(("straight", "curve", "curve", "in place"))
        motions.append(
            Motion(
                0.0 if kind == "in place" else linear * limits.linear_mps,
                0.0 if kind == "straight" else random.choice((-1.0, 1.0)) * angular * limits.angular_radps,
            )
        )
    return motions


def tried(case: Case, numbers: range, motions: int, runs: int) -> Iterator[Tried]:
    """`motions` of each drawn robot, each with `runs` moments and wheels of the failure."""
    for number in numbers:
        drawn = draw_robot(number)
        for motion in drawn_motions(drawn.robot, Random(f"{case.how} {number}"), motions):
            if not case.covers(drawn.robot, motion):
                continue
            cruise = Cruise(JOYSTICK, motion.linear_mps, drawn, motion.angular_radps)
            for seed in range(runs):
                run = cruise.fork(case.twin, seed)
                yield Tried(case, number, motion, run, case.within_s(drawn.robot))


def main() -> int:
    """Robots and motions from the command line."""
    parser = argparse.ArgumentParser(prog="campaign.hazard_cases", description=__doc__)
    parser.add_argument("--robots", type=int, default=20, help="how many")
    parser.add_argument("--first", type=int, default=0, help="number of the first robot; 0 is the sample")
    parser.add_argument("--motions", type=int, default=6, help="of each robot and case")
    parser.add_argument("--runs", type=int, default=3, help="of each motion")
    parser.add_argument("--only", default="", help="cases with this in their row or failure")
    given = parser.parse_args()
    out, late = Console(soft_wrap=True, highlight=False, markup=False), 0
    for case in CASES:
        if given.only not in f"{case.row} {case.how}":
            continue
        runs = list(tried(case, range(given.first, given.first + given.robots), given.motions, given.runs))
        late += sum(not each.holds for each in runs)
        out.print(f"{case.row}: {len(runs)} runs, {sum(not each.holds for each in runs)} late")
        for each in sorted(runs, key=lambda each: each.within_s - each.run.acts_s)[:5]:
            out.print(f"    {each}")
    return 1 if late else 0


if __name__ == "__main__":
    sys.exit(main())
