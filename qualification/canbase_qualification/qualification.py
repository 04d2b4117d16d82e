"""A qualification from its robot.yaml to its results: what is to be run, and what of it is still missing."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from canbase_config.robot import Robot
from canbase_qualification.crew import LocalCrew
from canbase_qualification.job import Amount, Batch, Job, Load, batches
from canbase_qualification.outcome import Outcome
from canbase_qualification.results_file import ResultsFile
from canbase_qualification.simulated_robot import Simulated, UnfitError, simulated

SLOWEST_MPS = 0.05
"""A base that drives no faster at full speed shows nothing about stops."""


def job_of(robot: Robot, load: Load) -> tuple[Job, Simulated]:
    """What is to be run with a robot as it was loaded. UnfitError."""
    found = simulated(robot)
    own = {drive.profile for drive in robot.drives if drive.profile.endswith((".yaml", ".yml"))}
    profiles = tuple((path, Path(path).read_text(encoding="utf-8")) for path in sorted(own))
    return Job(found.robot, found.faults, found.failures, load, profiles), found


def check_trial(job: Job, speed_mps: float, why: str) -> tuple[str, ...]:
    """What the stops are measured from, as sentences for people. UnfitError: the base hardly drives."""
    limit_mps = job.robot.limits.linear_mps
    if speed_mps < SLOWEST_MPS:
        raise UnfitError(
            f"the base does not drive when its joystick orders {limit_mps:g} m/s ({why}): no stop can be measured. "
            "Try the same file with canbase up and a simulated bus"
        )
    if why:
        return (f"Stops are measured from {speed_mps:.2f} m/s, not from limits.linear_mps {limit_mps:g} m/s: {why}.",)
    return ()


def missing(job: Job, amount: Amount, done: frozenset[tuple[str, int]]) -> list[Batch]:
    """What is still to be run."""
    return [left for batch in batches(job, amount) if (left := batch.without(done)) is not None]


def carry_out(
    job: Job, todo: list[Batch], crew: LocalCrew, results: ResultsFile, on_outcomes: Callable[[Iterable[Outcome]], None]
) -> None:
    """Run what is missing. What is done is in the file at once, whatever comes then; at the end it is sorted."""
    for done in crew.results(job, todo):
        results.append(done.outcomes)
        on_outcomes(done.outcomes)
    results.sort()
