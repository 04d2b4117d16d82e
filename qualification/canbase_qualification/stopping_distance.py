"""The distance to plan the fields of a scanner with: the worst measured stop, and what passes before it. Pure.

The form is that of ISO 13855: speed × response times, the braking, and a person who approaches meanwhile. For a base
that drives, the fields of its scanner move with it, so the distance of the base comes first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from canbase_config.robot import Robot
from canbase_qualification.hazard_figures import Collected, Run, StopFigures

WALKING_MPS: Final = 1.6
"""Approach speed K of a person who walks (ISO 13855)."""
PRESSED: Final = ("emergency stop: pressed", "estop_pressed")
"""The failures of runs in which nothing fails: the filter is ordered to stop the base hard."""


@dataclass(frozen=True, slots=True)
class Term:
    """One line of the sum."""

    name: str
    time_s: float
    distance_m: float
    source: str
    """Where it comes from: the key, or the run."""


@dataclass(frozen=True, slots=True)
class StoppingDistance:
    """One sum. `measured`: the stops whose worst one is its first term."""

    name: str
    speed_mps: float
    measured: StopFigures
    terms: tuple[Term, ...]

    @property
    def time_s(self) -> float:
        """Of all terms: how long a person who appears can go on walking."""
        return sum(term.time_s for term in self.terms)

    @property
    def distance_m(self) -> float:
        """From where the base is when a person could first be seen to where it stands."""
        return sum(term.distance_m for term in self.terms)

    @property
    def approach_m(self) -> float:
        """How far a person walks toward the base meanwhile."""
        return WALKING_MPS * self.time_s


def stopping_distances(collected: Collected, robot: Robot) -> list[StoppingDistance]:
    """Without a failure, and with the worst single one; a case without a stop that ended is left out."""
    cases = (
        ("stop ordered, nothing fails", collected.figures(PRESSED)),
        ("one part fails at that moment", collected.figures(collected.stop_faults)),
    )
    return [
        _distance(name, figures, figures.farthest_ended, robot)
        for name, figures in cases
        if figures and figures.farthest_ended
    ]


def _distance(name: str, figures: StopFigures, worst: Run, robot: Robot) -> StoppingDistance:
    speed_mps = max(robot.limits.linear_mps, figures.fastest_mps)
    time_s = max(value for value in figures.time_s.values if math.isfinite(value))
    slower = "" if worst.stop.time_s == time_s else "; the longest time is that of another run"
    failure = worst.stop.fault or "ordinary stop"
    of = f"{failure}, the worst of {figures.runs:,} runs, from {worst.stop.speed_mps:.2f} m/s{slower}"
    measured = Term("measured stop, reaction of canbase included", time_s, worst.stop.way_m, of)
    return StoppingDistance(name, speed_mps, figures, (measured, *_before(robot, speed_mps)))


def _before(robot: Robot, speed_mps: float) -> list[Term]:
    """What passes between a person in the plane of a scanner and the order to stop."""
    scans = [scan for scan in robot.safety.scans if scan.required] or list(robot.safety.scans)
    age_s, period_s = max(scan.timeout_s for scan in scans), 1.0 / robot.rates.command_hz
    found = [
        ("age of a scan: an older one stops the base", age_s, "safety.scan.timeout_s"),
        ("the filter decides once in this time", period_s, "1 / rates.command_hz"),
    ]
    if any(scan.min_points > 1 for scan in scans):
        found.append(("one more scan for an object seen by few beams", age_s, "safety.scan.min_points"))
    return [Term(name, time_s, speed_mps * time_s, source) for name, time_s, source in found]
