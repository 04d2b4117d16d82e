"""What was found so far, and what is printed at the end. Pure."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Final

from canbase_campaign.properties import PROPERTIES
from canbase_qualification.job import Load
from canbase_qualification.outcome import DRIVING, SCENARIO, STOP, MeasuredStop, Outcome, Violation
from canbase_qualification.runs import OWN_PROPERTIES

LONGEST: Final = 5
"""So many stops are printed, those with the longest way."""
SHOWN: Final = 10
"""So many violations are printed one by one."""
OPTIONS: Final = {SCENARIO: "--scenario", STOP: "--stop"}
"""How `canbase prove qualify` tells one run."""
SENTENCES: Final = {**PROPERTIES, **OWN_PROPERTIES}


@dataclass(slots=True)
class Tally:
    """Of all outcomes that were added."""

    runs: Counter[str] = field(default_factory=Counter)
    violations: list[tuple[Outcome, Violation]] = field(default_factory=list)
    worst: dict[str, tuple[MeasuredStop, int]] = field(default_factory=dict)
    """By failure: the stop with the longest way, and its seed."""
    virtual_s: float = 0.0

    def add(self, outcomes: Iterable[Outcome]) -> None:
        """More of them."""
        for outcome in outcomes:
            self.runs[outcome.kind] += 1
            self.virtual_s += outcome.virtual_s
            self.violations += [(outcome, violation) for violation in outcome.violations]
            for stop in outcome.stops:
                before = self.worst.get(stop.fault)
                if before is None or _badness(stop) > _badness(before[0]):
                    self.worst[stop.fault] = stop, outcome.seed

    @property
    def found(self) -> str:
        """For the progress bar."""
        way_m = max((stop.way_m for stop, _ in self.worst.values()), default=0.0)
        stop = f", longest stop {way_m:.2f} m" if self.worst else ""
        return f"{len(self.violations)} violations{stop}"


def _badness(stop: MeasuredStop) -> tuple[bool, float]:
    """What never stops is worse than any distance."""
    return not math.isfinite(stop.time_s), stop.way_m


def lines(tally: Tally, file: str, load: Load) -> Iterator[str]:
    """The end of a qualification, for people."""
    runs = tally.runs
    yield f"{runs[STOP]} stops, {runs[SCENARIO]} scenarios, {runs[DRIVING]} drives without a failure"
    longest = sorted(tally.worst.values(), key=lambda each: _badness(each[0]), reverse=True)[:LONGEST]
    for stop, seed in longest:
        yield f"  {_words(stop)}; --stop {seed}"
    if not tally.violations:
        yield "Every property held in every run. Simulation, no certificate."
        return
    names = Counter(violation.property for _, violation in tally.violations)
    for name, count in sorted(names.items()):
        yield f"VIOLATED {name}, {count} times: {SENTENCES.get(name, '')}"
    for outcome, violation in tally.violations[:SHOWN]:
        detail = violation.detail.strip().splitlines()[-1] if violation.detail else ""
        yield f"  {outcome.kind} {outcome.seed}, {', '.join(outcome.faults)}: {violation.property}: {detail}"
        yield f"    {command(outcome, file, load)}"
    if len(tally.violations) > SHOWN:
        yield f"  … and {len(tally.violations) - SHOWN} more"


def _words(stop: MeasuredStop) -> str:
    name, cause = stop.fault or "ordinary stop", f" ({stop.cause})" if stop.cause else ""
    ends = f"{stop.time_s:.2f} s" if math.isfinite(stop.time_s) else "and it goes on,"
    return f"{stop.way_m:.2f} m, {ends} from {stop.speed_mps:.2f} m/s: {name}{cause}"


def command(outcome: Outcome, file: str, load: Load) -> str:
    """The command that tells this run as a log; a drive has none: its seed."""
    if outcome.kind not in OPTIONS:
        return f"{outcome.kind}, seed {outcome.seed}: {outcome.robot}"
    low, high = load.payloads
    given = "" if load == Load() else f" --payload {low:g}..{high:g} --slope {load.slope:g}"
    return f"canbase prove qualify {file} {OPTIONS[outcome.kind]} {outcome.seed}{given}"
