"""Outcomes of a qualification made by hand, with known quantiles, for the tests of its report."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Final

from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_hazards.catalogue import load
from canbase_qualification.hazard_figures import Collected
from canbase_qualification.job import Load
from canbase_qualification.outcome import DRIVING, SCENARIO, STOP, Ages, MeasuredStop, Outcome, Violation
from canbase_qualification.qualified import Setup
from canbase_qualification.report import Report, report

KILLED, PRESSED, ALL_KILLED, STRANGE = (
    "motor_driver: SIGKILL", "emergency stop: pressed", "all processes: are killed", "gear: breaks",
)  # fmt: skip
"""Of rows of the catalogue; the last one is of none."""
CATALOGUE: Final = load()
BODY = "60 kg × 1.00, slope +0.0%"


def stop(fault: str, seed: int, time_s: float, way_m: float, speed_mps: float = 0.8) -> Outcome:
    """A run with one measured stop."""
    measured = MeasuredStop(fault, "watchdog: driver silent", speed_mps, time_s, way_m, time_s + 0.1)
    return Outcome(
        STOP,
        seed,
        f"{BODY}, body {seed}",
        1.0,
        0.0,
        (fault,) if fault else (),
        stops=(measured,),
        virtual_s=2.0,
        moved_m=1.0,
    )


def stops(fault: str, runs: int, first: int = 0) -> list[Outcome]:
    """The run number n of `runs` takes n / runs seconds and a tenth of that in metres; in no order."""
    numbers = sorted(range(1, runs + 1), key=lambda number: (number * 7919) % runs)
    return [stop(fault, first + number, number / runs, number / runs / 10.0) for number in numbers]


def scenario(seed: int, *faults: str, violations: tuple[Violation, ...] = ()) -> Outcome:
    """A run with overlapping failures."""
    return Outcome(SCENARIO, seed, BODY, 1.5, 0.03, faults, violations, virtual_s=3.0, moved_m=0.5)


def driving(seed: int, **longest_s: float) -> Outcome:
    """A run without a failure, with the longest ages of timeouts of 0.25 s."""
    ages = tuple(Ages(f"timeouts.{key}", value, 0.25) for key, value in longest_s.items())
    return Outcome(DRIVING, seed, BODY, 0.5, -0.03, ages=ages, virtual_s=60.0, moved_m=20.0)


def never(fault: str, seed: int) -> Outcome:
    """The base did not come to standstill."""
    return stop(fault, seed, math.inf, 6.0)


def passed() -> list[Outcome]:
    """Enough of everything, and nothing wrong."""
    several = [stops(KILLED, 1000), stops(PRESSED, 100, 2000), stops(ALL_KILLED, 20, 3000), stops(STRANGE, 5, 4000)]
    ordinary = [stop("", 5000 + number, 0.4, 0.1) for number in range(10)]
    scenarios = [scenario(seed, "driver_dies", "cable_cut") for seed in range(30)]
    drives = [driving(0, lease_s=0.081, feedback_s=0.034), driving(1, lease_s=0.062)]
    return [*(outcome for each in several for outcome in each), *ordinary, *scenarios, *drives]


def setup(robot: Robot | None = None, **changes: Any) -> Setup:
    """Of the bench's robot."""
    given: dict[str, Any] = {
        "robot_file": "robot.yaml",
        "robot": robot or load_robot(sample("bench")).robot,
        "configuration_sha256": "ab" * 32,
        "configuration": "name: bench\n",
        "versions": {"canbase": "0.1.0", "python": "3.11.2"},
        "load": Load(),
        "asked": {},
        "assumed": ("The emergency stop button publishes ten times a second.",),
        "not_judged": ("safety.more_scans: failures of one alone were not tried.",),
    }
    return Setup(**{**given, **changes})


def collected(outcomes: Iterable[Outcome]) -> Collected:
    """All of them."""
    found = Collected(CATALOGUE)
    for outcome in outcomes:
        found.add(outcome)
    return found


def made(outcomes: Iterable[Outcome], robot: Robot | None = None, **changes: Any) -> Report:
    """The report of these."""
    return report(setup(robot, **changes), collected(outcomes))
