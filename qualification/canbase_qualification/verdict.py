"""The verdict of a qualification: one sentence that never says more than was measured. Pure."""

from __future__ import annotations

from enum import Enum

from canbase_qualification.hazard_figures import Collected, StopFigures
from canbase_qualification.outcome import DRIVING, KINDS, SCENARIO, STOP
from canbase_qualification.qualified import Setup

NAMES = {
    STOP: ("stop", "stops"),
    SCENARIO: ("scenario", "scenarios"),
    DRIVING: ("run without a failure", "runs without a failure"),
}
"""One run of each kind, and several."""


class Grade(Enum):
    """What came out, in one word."""

    PASSED = "passed"
    FAILED = "failed"
    INCOMPLETE = "incomplete"


def verdict_of(setup: Setup, collected: Collected, stops: StopFigures | None) -> tuple[Grade, str]:
    """`stops`: all of them; None: there is none."""
    never = stops.never if stops else 0
    missing = [kind for kind in KINDS if collected.runs[kind] < setup.asked.get(kind, 0)]
    if not collected.runs.total():
        return Grade.INCOMPLETE, "Nothing was measured: there is no result of any run."
    failed = [
        *_violated(collected),
        *([f"{never:,} of {stops.runs:,} stops did not end in standstill"] if stops and never else []),
    ]
    done = f"{_runs(collected)} of {setup.robot.name}"
    if failed:
        return Grade.FAILED, f"NOT PASSED: {' and '.join(failed)}; {done}."
    if missing or setup.problems:
        parts = ", ".join(f"{collected.runs[kind]:,} of {counted(kind, setup.asked[kind])}" for kind in missing)
        return Grade.INCOMPLETE, f"INCOMPLETE: {parts or setup.problems[0]}; no violation so far."
    worst = (
        f", at most {stops.time_s.greatest:.2f} s and {stops.distance_m.greatest:.2f} m after the failure"
        if stops
        else ""
    )
    return Grade.PASSED, f"No violation in {done}: every measured stop ended in standstill{worst}."


def _violated(collected: Collected) -> list[str]:
    if not collected.violated:
        return []
    names = ", ".join(f"{name} {count}" for name, count in collected.properties.most_common())
    runs = "run" if collected.violated == 1 else "runs"
    return [f"a property did not hold in {collected.violated:,} {runs} ({names})"]


def _runs(collected: Collected) -> str:
    told = [counted(kind, collected.runs[kind]) for kind in KINDS if collected.runs[kind]]
    return ", ".join(told[:-1]) + (" and " if told[:-1] else "") + told[-1]


def counted(kind: str, number: int) -> str:
    """So many runs of this kind."""
    return f"{number:,} {NAMES[kind][number != 1]}"
