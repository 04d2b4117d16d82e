"""What the runs measured for each row of the catalogue of hazards: times, distances, worst runs, violations. Pure."""

from __future__ import annotations

import math
from array import array
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

from canbase_config.robot import Robot
from canbase_hazards.catalogue import Catalogue, Row
from canbase_hazards.formula import FormulaError, evaluate
from canbase_qualification.outcome import DRIVING, SCENARIO, Ages, MeasuredStop, Outcome, Violation
from canbase_qualification.statistics import Distribution, covered_share

MATRIX: Final = "matrix: "
"""A test of a row with this prefix names a failure of the exit matrix, and of `MeasuredStop.fault`."""
MOST_VIOLATIONS: Final = 100
"""So many kinds of them are kept with their first run; all are counted."""


@dataclass(frozen=True, slots=True)
class Run:
    """One measured stop, and the run that it comes from."""

    stop: MeasuredStop
    outcome: Outcome

    @property
    def distance_m(self) -> float:
        """A base that did not come to standstill has none: infinity."""
        return self.stop.way_m if math.isfinite(self.stop.time_s) else math.inf


@dataclass(frozen=True, slots=True)
class StopFigures:
    """All measured stops of some failures. Times [s] until the lasting standstill, distances [m] until then."""

    time_s: Distribution
    distance_m: Distribution
    slowest: Run
    farthest: Run
    """Of a base that never came to standstill the distance is infinite."""
    farthest_ended: Run | None
    """Of those that came to standstill; None: there is none."""
    fastest_mps: float
    """The highest speed at which one of the failures began."""
    bodies: int
    """How many different bodies had them: runs of one body are alike, so these are the independent draws."""

    @property
    def runs(self) -> int:
        """How many there are."""
        return len(self.time_s.values)

    @property
    def covered_share(self) -> float:
        """With 95 % confidence, at least this share of all such bodies is not beyond the greatest values."""
        return covered_share(self.bodies)

    @property
    def never(self) -> int:
        """How many did not come to standstill while they were watched."""
        return sum(math.isinf(value) for value in self.time_s.values)


@dataclass(frozen=True, slots=True)
class Found:
    """One property that did not hold after the same failures; `violation` and `outcome` are of the first run."""

    violation: Violation
    outcome: Outcome
    runs: int = 1


@dataclass(frozen=True, slots=True)
class HazardFigures:
    """One row. `scenarios`: with overlapping failures, in which this one took part; `violated`: those of them in which
    a property did not hold, whichever of the failures was the reason.
    """

    row: Row
    stops: StopFigures | None
    scenarios: int
    violated: int
    acts_within_s: float | None
    """What the row states for this robot; None: nothing, or its formula needs a key that the file does not have."""

    @property
    def is_covered(self) -> bool:
        """At least one run of the campaign has this failure."""
        return self.stops is not None or self.scenarios > 0


class Collected:
    """Takes the outcomes one by one, in bounded memory: 16 bytes a stop, and the text of each body."""

    def __init__(self, catalogue: Catalogue) -> None:
        self.catalogue = catalogue
        self.runs: Counter[str] = Counter()
        """How many there are of each kind (outcome.KINDS)."""
        self.seeds: dict[str, tuple[int, int]] = {}
        """The lowest and the highest seed of each kind."""
        self.payloads = self.slopes = (math.inf, -math.inf)
        """The lowest and the highest one of all runs."""
        self.virtual_s = 0.0
        self.driving_s = 0.0
        """Of it: without a failure."""
        self.moved_m = 0.0
        self.trips: Counter[str] = Counter()
        self.violated = 0
        """Runs in which at least one property did not hold."""
        self.ages: dict[str, Ages] = {}
        """By key of robot.yaml: the longest one of all runs without a failure."""
        self._found: dict[tuple[str, tuple[str, ...]], Found] = {}
        self.properties: Counter[str] = Counter()
        """How often each property did not hold."""
        self._rows: dict[str, list[str]] = {}
        for row in catalogue.rows:
            for name in faults_of(row):
                self._rows.setdefault(name, []).append(row.id)
        self._faults: set[str] = set()
        self._took_part: Counter[str] = Counter()
        self._violated: Counter[str] = Counter()
        self._stops: defaultdict[str, _Stops] = defaultdict(_Stops)

    def add(self, outcome: Outcome) -> None:
        """One more."""
        self.runs[outcome.kind] += 1
        low, high = self.seeds.get(outcome.kind, (outcome.seed, outcome.seed))
        self.seeds[outcome.kind] = min(low, outcome.seed), max(high, outcome.seed)
        self.payloads = _widened(self.payloads, outcome.payload)
        self.slopes = _widened(self.slopes, outcome.slope)
        self.virtual_s += outcome.virtual_s
        self.driving_s += outcome.virtual_s if outcome.kind == DRIVING else 0.0
        self.moved_m += outcome.moved_m
        self.trips.update(outcome.trips)
        rows = {row for name in outcome.faults for row in self._rows.get(name, ())}
        self._faults.update(outcome.faults)
        if outcome.kind == SCENARIO:
            self._took_part.update(rows)
        if outcome.violations:
            self.violated += 1
            self._violated.update(rows)
        for violation in outcome.violations:
            self.properties[violation.property] += 1
            self._find(violation, outcome)
        for age in outcome.ages:
            self.ages[age.key] = max(self.ages.get(age.key, age), age, key=lambda each: each.longest_s)
        for stop in outcome.stops:
            self._stops[stop.fault].add(Run(stop, outcome))

    def _find(self, violation: Violation, outcome: Outcome) -> None:
        kind = violation.property, outcome.faults
        before = self._found.get(kind)
        if before is not None:
            self._found[kind] = replace(before, runs=before.runs + 1)
        elif len(self._found) < MOST_VIOLATIONS:
            self._found[kind] = Found(violation, outcome)

    @property
    def violations(self) -> list[Found]:
        """One for each property and failures after which it did not hold, in the order of the results."""
        return list(self._found.values())

    @property
    def never_stood(self) -> list[str]:
        """Failures after which a base did not come to standstill."""
        return [name for name in self._stops if any(math.isinf(time_s) for time_s in self._stops[name].times)]

    @property
    def faults(self) -> frozenset[str]:
        """Every failure that some run had."""
        return frozenset(self._faults) | frozenset(self._stops)

    @property
    def stop_faults(self) -> list[str]:
        """Those of which stops were measured, in alphabetical order; without ordinary stops."""
        return sorted(name for name in self._stops if name)

    @property
    def unlisted(self) -> list[str]:
        """Those that no row names, in alphabetical order. An ordinary stop has no failure."""
        return sorted(name for name in self.faults if name and name not in self._rows)

    def figures(self, faults: Iterable[str]) -> StopFigures | None:
        """Of all stops of these failures; None: there is none."""
        found = [self._stops[name] for name in sorted(set(faults)) if name in self._stops]
        return _Stops.joined(found).figures() if found else None

    def row(self, row: Row, robot: Robot) -> HazardFigures:
        """What was measured of one row."""
        return HazardFigures(
            row,
            self.figures(faults_of(row)),
            self._took_part[row.id],
            self._violated[row.id],
            _acts_within_s(row, robot),
        )


class _Stops:
    """The stops of one failure, as numbers; and the two worst ones."""

    def __init__(self) -> None:
        self.times, self._ways = array("d"), array("d")
        self._slowest: Run | None = None
        self._farthest: Run | None = None
        self._farthest_ended: Run | None = None
        self._fastest_mps = 0.0
        self._bodies: set[str] = set()

    def add(self, run: Run) -> None:
        self.times.append(run.stop.time_s)
        self._ways.append(run.distance_m)
        self._bodies.add(run.outcome.robot)
        self._keep(run)

    def _keep(self, run: Run) -> None:
        self._fastest_mps = max(self._fastest_mps, run.stop.speed_mps)
        if self._slowest is None or run.stop.time_s > self._slowest.stop.time_s:
            self._slowest = run
        if self._farthest is None or run.distance_m > self._farthest.distance_m:
            self._farthest = run
        ended = self._farthest_ended
        if math.isfinite(run.stop.time_s) and (ended is None or run.distance_m > ended.distance_m):
            self._farthest_ended = run

    @staticmethod
    def joined(several: Iterable[_Stops]) -> _Stops:
        """Those of several failures."""
        whole = _Stops()
        for each in several:
            for run in (each._slowest, each._farthest, each._farthest_ended):
                if run is not None:
                    whole._keep(run)
            whole._fastest_mps = max(whole._fastest_mps, each._fastest_mps)
            whole._bodies |= each._bodies
            whole.times.extend(each.times)
            whole._ways.extend(each._ways)
        return whole

    def figures(self) -> StopFigures | None:
        if self._slowest is None or self._farthest is None:
            return None
        times, ways = Distribution.of(self.times), Distribution.of(self._ways)
        return StopFigures(
            times, ways, self._slowest, self._farthest, self._farthest_ended, self._fastest_mps, len(self._bodies)
        )


def _widened(span: tuple[float, float], value: float) -> tuple[float, float]:
    return min(span[0], value), max(span[1], value)


def faults_of(row: Row) -> tuple[str, ...]:
    """The failures of runs that are this row: its `faults`, and the rows of the exit matrix among its tests."""
    matrix = (name.removeprefix(MATRIX) for name in row.tests if name.startswith(MATRIX))
    return tuple(dict.fromkeys((*row.faults, *matrix)))


def _acts_within_s(row: Row, robot: Robot) -> float | None:
    if not row.within_s:
        return None
    try:
        return evaluate(row.within_s, robot)
    except FormulaError:
        return None
