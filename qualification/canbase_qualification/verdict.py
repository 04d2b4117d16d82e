"""The verdict of a qualification: one sentence that never says more than was measured. Pure."""

from __future__ import annotations

from enum import Enum
from typing import Final

from canbase_qualification.hazard_figures import Collected, StopFigures
from canbase_qualification.outcome import DRIVING, KINDS, SCENARIO, STOP
from canbase_qualification.qualified import Setup

NAMES = {
    STOP: ("stop", "stops"),
    SCENARIO: ("scenario", "scenarios"),
    DRIVING: ("run without a failure", "runs without a failure"),
}
"""One run of each kind, and several."""
STOPS: Final = "stops"
"""The property of a single failure that the base comes to a stand: runs.OWN_PROPERTIES."""
SHOWN: Final = 4
"""Failures by name."""


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
        *([_never(collected, never, stops.runs)] if stops and never else []),
    ]
    done = f"{_runs(collected)} of {setup.robot.name}"
    if failed:
        return Grade.FAILED, f"NOT PASSED: {' and '.join(failed)}; {done}."
    if missing or setup.problems:
        parts = ", ".join(f"{collected.runs[kind]:,} of {counted(kind, setup.asked[kind])}" for kind in missing)
        return Grade.INCOMPLETE, f"INCOMPLETE: {parts or setup.problems[0]}; no violation so far."
    return Grade.PASSED, f"No violation in {done}: {_stood(stops)}."


def _stood(stops: StopFigures | None) -> str:
    if stops is None:
        return "no stop was measured"
    time_s, distance_m = stops.time_s.greatest, stops.distance_m.greatest
    return f"every measured stop ended in standstill, at most {time_s:.2f} s and {distance_m:.2f} m after the failure"


def _never(collected: Collected, never: int, of: int) -> str:
    names = [name or "ordinary stop" for name in collected.never_stood]
    more = f"; {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"{never:,} of {of:,} stops did not end in standstill ({'; '.join(names[:SHOWN])}{more})"


def _violated(collected: Collected) -> list[str]:
    """Of a stop that never ended more is told elsewhere."""
    names = [f"{name} {count:,}" for name, count in collected.properties.most_common() if name != STOPS]
    return [f"properties did not hold ({', '.join(names)})"] if names else []


def _runs(collected: Collected) -> str:
    told = [counted(kind, collected.runs[kind]) for kind in KINDS if collected.runs[kind]]
    return ", ".join(told[:-1]) + (" and " if told[:-1] else "") + told[-1]


def counted(kind: str, number: int) -> str:
    """So many runs of this kind."""
    return f"{number:,} {NAMES[kind][number != 1]}"
