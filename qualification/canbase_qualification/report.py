"""The report of a qualification as plain values: verdict, assumptions, figures of each hazard, numbers to plan with.

Pure. `report_sections.py` puts it into words, `report_json.py` into JSON.
"""

from __future__ import annotations

from dataclasses import dataclass

from canbase_qualification.hazard_figures import Collected, HazardFigures, StopFigures
from canbase_qualification.qualified import Setup
from canbase_qualification.self_stop import MASTERS_DIE, OwnStop, own_stops
from canbase_qualification.stopping_distance import StoppingDistance, stopping_distances
from canbase_qualification.verdict import Grade, verdict_of


@dataclass(frozen=True, slots=True)
class Report:
    """The whole of it."""

    setup: Setup
    collected: Collected
    grade: Grade
    verdict: str
    hazards: tuple[HazardFigures, ...]
    unlisted: tuple[tuple[str, StopFigures | None], ...]
    """Failures that some run had and no row of the catalogue names."""
    ordinary_stops: StopFigures | None
    distances: tuple[StoppingDistance, ...]
    own_stops: tuple[OwnStop, ...]
    masters_die: tuple[tuple[str, StopFigures], ...]
    """What was measured where the drives receive neither driver nor watchdog."""

    @property
    def uncovered(self) -> list[HazardFigures]:
        """Rows whose failure no run has."""
        return [figures for figures in self.hazards if not figures.is_covered]


def report(setup: Setup, collected: Collected) -> Report:
    """What the runs came to."""
    stops = collected.figures(["", *collected.stop_faults])
    grade, verdict = verdict_of(setup, collected, stops)
    masters_die = ((name, collected.figures([name])) for name in MASTERS_DIE)
    return Report(
        setup,
        collected,
        grade,
        verdict,
        tuple(collected.row(row, setup.robot) for row in collected.catalogue.rows),
        tuple((name, collected.figures([name])) for name in collected.unlisted),
        collected.figures([""]),
        tuple(stopping_distances(collected, setup.robot)),
        own_stops(setup.robot),
        tuple((name, figures) for name, figures in masters_die if figures is not None),
    )
