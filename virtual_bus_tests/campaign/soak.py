"""`python -m campaign.soak --hours 20`: ordinary driving for simulated hours; whatever trips is a false trip.

`--seed 7` drives one robot again and tells its story. Exit code 1: something tripped, latched or lost its power.
"""

from __future__ import annotations

import argparse
import gc
import math
import multiprocessing
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from campaign.ordinary import FalseTrip, OrdinaryHour

RUN_S = 120.0
"""One seed: one robot, one load, one floor."""


@dataclass(frozen=True, slots=True)
class Driven:
    """What came of one seed. `path_m`: of the base's centre; `moving_s`: so long it moved."""

    seed: int
    time_s: float
    moving_s: float
    path_m: float
    trip: FalseTrip | None
    processor_s: float = field(default=0.0, compare=False)


def drive(seed: int, seconds: float = RUN_S) -> Driven:
    """One robot."""
    gc.set_threshold(100_000)
    began = time.process_time()
    hour = OrdinaryHour(seed)
    trip = hour.run(seconds)
    return Driven(
        seed, hour.now_s, hour.moving_s, hour.world.drives.bench.base.path_m, trip, time.process_time() - began
    )


def drive_all(seeds: range, seconds: float, workers: int) -> Iterator[Driven]:
    """As they end."""
    if workers == 1:
        yield from (drive(seed, seconds) for seed in seeds)
        return
    with multiprocessing.get_context("spawn").Pool(workers) as pool:
        yield from pool.imap_unordered(partial(drive, seconds=seconds), seeds)


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
    given = parser.parse_args()
    out = Console()
    seconds = min(RUN_S, given.hours * 3600.0)
    seeds = range(given.first, given.first + math.ceil(given.hours * 3600.0 / RUN_S))
    if given.seed is not None:
        seeds = range(given.seed, given.seed + 1)
    time_s = moving_s = path_m = processor_s = 0.0
    trips = 0
    columns = TextColumn("{task.fields[told]}"), BarColumn(), TimeRemainingColumn()
    with Progress(*columns, console=out) as progress:
        task = progress.add_task("", total=len(seeds), told="")
        for driven in drive_all(seeds, seconds, min(given.workers, len(seeds))):
            time_s, moving_s, path_m = time_s + driven.time_s, moving_s + driven.moving_s, path_m + driven.path_m
            processor_s += driven.processor_s
            if driven.trip is not None:
                trips += 1
                out.print(told(driven.trip), highlight=False, soft_wrap=True, markup=False)
            progress.update(task, advance=1, told=f"{time_s / 3600.0:.1f} h, {trips} false trips")
    out.print(
        f"{len(seeds)} robots, {time_s / 3600.0:.2f} h in virtual time, {moving_s / 3600.0:.2f} h of them in motion, "
        f"{path_m / 1000.0:.2f} km, {time_s / processor_s:.0f} s for each second of processor time: {trips} false trips"
    )
    return 1 if trips else 0


if __name__ == "__main__":
    sys.exit(main())
