"""Many scenarios in several processes: a worker boots the world of a robot, and forks it once per scenario."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby

from canbase_campaign.judge import Violation
from canbase_campaign.plan import draw_plan
from canbase_campaign.robots import SCENARIOS, robot_of
from canbase_campaign.scenario import Result, Start

_start: tuple[int, Start] | None = None
"""The robot that this worker has booted, by its number."""


@dataclass(slots=True)
class Tally:
    """What all scenarios came to."""

    scenarios: int = 0
    faults: Counter[str] = field(default_factory=Counter)
    at_once: Counter[int] = field(default_factory=Counter)
    lives: Counter[int] = field(default_factory=Counter)
    trips: Counter[str] = field(default_factory=Counter)
    goals: Counter[str] = field(default_factory=Counter)
    violations: list[tuple[int, Violation]] = field(default_factory=list)
    virtual_s: float = 0.0
    processor_s: float = 0.0
    moved_m: float = 0.0
    moving_s: float = 0.0
    excused_s: dict[tuple[str, str], float] = field(default_factory=dict)
    """By property and row of canbase_campaign.excuses: in motion, and held by that row alone."""
    broken_off: bool = False
    """By Ctrl-C: the other numbers are of what was done until then."""

    def add(self, result: Result) -> None:
        """One more result."""
        self.scenarios += 1
        self.faults.update(result.faults)
        self.at_once[len(result.faults)] += 1
        self.trips.update(result.trips)
        self.lives[result.lives] += 1
        self.goals.update(result.goals)
        self.violations += [(result.seed, violation) for violation in result.violations]
        self.virtual_s += result.virtual_s
        self.processor_s += result.processor_s
        self.moved_m += result.moved_m
        self.moving_s += result.moving_s
        for name, row, seconds in result.excused_s:
            self.excused_s[name, row] = self.excused_s.get((name, row), 0.0) + seconds


def run(
    seeds: Iterable[int],
    workers: int,
    only: Sequence[str] = (),
    prepare: Callable[[], None] | None = None,
    on_result: Callable[[Result], None] | None = None,
) -> Tally:
    """Run the scenarios of these seeds, with faults from `only` (empty: all).

    `prepare`: what each worker does first. Ctrl-C ends it after the robots at hand, with what was done.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # numpy's threads have nothing to do, and each fork ends them
    tally = Tally()
    batches = [list(batch) for _, batch in groupby(seeds, lambda seed: seed // SCENARIOS)]
    # Not forked from here: the caller may have threads, and a forked scenario must have none.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, initializer=_begin, initargs=(prepare,)) as pool:
        try:
            for results in pool.map(partial(_run, only), batches):
                for result in results:
                    tally.add(result)
                    if on_result is not None:
                        on_result(result)
        except KeyboardInterrupt:
            tally.broken_off = True
            pool.shutdown(cancel_futures=True)
    return tally


def _begin(prepare: Callable[[], None] | None) -> None:
    """A worker: Ctrl-C of a terminal reaches it too, and is for the process that started the work."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if prepare is not None:
        prepare()


def start_of(seed: int) -> Start:
    """The world of this seed's robot, booted when the seed before had another one."""
    global _start
    drawn = robot_of(seed)
    if _start is None or _start[0] != drawn.number:
        _start = drawn.number, Start(drawn)
    return _start[1]


def _run(only: Sequence[str], seeds: list[int]) -> list[Result]:
    return [start_of(seed).fork(draw_plan(seed, only)) for seed in seeds]
