"""`python -m campaign.soak --hours 20`: ordinary driving for simulated hours; whatever trips is a false trip.

`--seed 7` drives one robot again and prints its story. Exit code 1: something tripped, latched or lost its power.
Ctrl-C prints what was driven until then, with exit code 130.
"""

from __future__ import annotations

import argparse
import gc
import math
import multiprocessing
import signal
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from canbase_campaign.ordinary import FalseTrip, OrdinaryHour

RUN_S = 120.0
"""One seed: one robot, one load, one floor."""
BROKEN_OFF = 128 + signal.SIGINT
"""Exit code after Ctrl-C, as of a shell."""


@dataclass(frozen=True, slots=True)
class Driven:
    """What came of one seed. `path_m`: of the base's centre; `moving_s`: how long it moved."""

    seed: int
    time_s: float
    moving_s: float
    path_m: float
    trip: FalseTrip | None
    processor_s: float = field(default=0.0, compare=False)


def drive(seed: int, seconds: float = RUN_S, loaded: bool = False) -> Driven:
    """One robot. `loaded`: with double payload on slopes."""
    gc.set_threshold(100_000)
    began = time.process_time()
    hour = OrdinaryHour(seed, loaded=loaded)
    trip = hour.run(seconds)
    return Driven(
        seed, hour.now_s, hour.moving_s, hour.world.drives.bench.base.path_m, trip, time.process_time() - began
    )


def drive_all(seeds: range, seconds: float, workers: int, loaded: bool = False) -> Iterator[Driven]:
    """As they end. Ctrl-C of a terminal is not for the workers."""
    if workers == 1:
        yield from (drive(seed, seconds, loaded) for seed in seeds)
        return
    with multiprocessing.get_context("spawn").Pool(workers, signal.signal, (signal.SIGINT, signal.SIG_IGN)) as pool:
        yield from pool.imap_unordered(partial(drive, seconds=seconds, loaded=loaded), seeds)


def told(trip: FalseTrip) -> str:
    """With its story."""
    lines = (f"seed {trip.seed}, after {trip.at_s:.3f} s: {trip.what}", trip.robot, *trip.story)
    return "\n    ".join(lines)


def main() -> int:
    """Hours, seeds and workers from the command line."""
    parser = argparse.ArgumentParser(prog="campaign.soak", description=__doc__)
    parser.add_argument("--hours", type=float, default=1.0, help="of simulated time, in all")
    parser.add_argument("--first", type=int, default=1, help="seed of the first robot; the others follow it")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--seed", type=int, help="this robot alone")
    parser.add_argument("--loaded", action="store_true", help="double payload, and slopes all the time")
    given = parser.parse_args()
    out = Console()
    seconds = min(RUN_S, given.hours * 3600.0)
    seeds = range(given.first, given.first + math.ceil(given.hours * 3600.0 / RUN_S))
    if given.seed is not None:
        seeds = range(given.seed, given.seed + 1)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    done, broken_off = [], False
    columns = TextColumn("{task.fields[told]}"), BarColumn(), TimeRemainingColumn()
    with Progress(*columns, console=out) as progress:
        task = progress.add_task("", total=len(seeds), told="")
        try:
            for driven in drive_all(seeds, seconds, min(given.workers, len(seeds)), given.loaded):
                done.append(driven)
                if driven.trip is not None:
                    out.print(told(driven.trip), highlight=False, soft_wrap=True, markup=False)
                progress.update(task, advance=1, told=_in_short(done))
        except KeyboardInterrupt:
            broken_off = True
    out.print(_sums(done) + (f"; broken off, {len(seeds)} robots were asked for" if broken_off else ""))
    return 1 if _trips(done) else BROKEN_OFF if broken_off else 0


def _trips(done: list[Driven]) -> int:
    return sum(driven.trip is not None for driven in done)


def _in_short(done: list[Driven]) -> str:
    return f"{sum(driven.time_s for driven in done) / 3600.0:.1f} h, {_trips(done)} false trips"


def _sums(done: list[Driven]) -> str:
    time_s, processor_s = sum(driven.time_s for driven in done), sum(driven.processor_s for driven in done)
    moving_s, path_m = sum(driven.moving_s for driven in done), sum(driven.path_m for driven in done)
    speed = f"{time_s / processor_s:.0f} s for each second of processor time: " if done else ""
    return (
        f"{len(done)} robots, {time_s / 3600.0:.2f} h in virtual time, {moving_s / 3600.0:.2f} h of them in motion, "
        f"{path_m / 1000.0:.2f} km, {speed}{_trips(done)} false trips"
    )


if __name__ == "__main__":
    sys.exit(main())
