"""The longest stop that docs/stop_times.md has of a row's failures: `Measured` on the page of hazards. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from canbase_hazards.catalogue import Row
from canbase_qualification.hazard_figures import faults_of
from exit_matrix.page_table import NOTHING, Key
from exit_matrix.page_table import Row as Cells
from exit_matrix.stop_table import REAL_RUN

MAX, RUNS = "max", "runs"
"""Columns of virtual time: the longest time and distance, and of how many runs."""


@dataclass(frozen=True, slots=True)
class LongestStop:
    """`cell`: time and distance, as the page has them. `name`: `what: how` of the failure. `source`: of which runs."""

    cell: str
    name: str
    source: str

    @property
    def time_s(self) -> float:
        """From the failure until standstill [s]; infinity: the base never stood."""
        return math.inf if self.cell.startswith("never") else float(self.cell.partition(" ")[0])


def longest_stop(row: Row, stops: Mapping[Key, Cells]) -> LongestStop | None:
    """Of all failures of `row`, in virtual time and in the one run of real processes; None: none was measured."""
    measured = [stop for name in faults_of(row) for stop in _stops(name, stops)]
    return max(measured, key=lambda stop: stop.time_s, default=None)


def _stops(name: str, stops: Mapping[Key, Cells]) -> Iterator[LongestStop]:
    cells = stops.get(tuple(name.split(": ", 1)), {})
    if (longest := cells.get(MAX, NOTHING)) != NOTHING:
        yield LongestStop(longest, name, f"{cells[RUNS]} runs")
    if (once := cells.get(REAL_RUN, NOTHING)) != NOTHING:
        yield LongestStop(once, name, "one real run")
