"""`python -m campaign.replays`: black boxes of drawn scenarios, replayed as `canbase record replay` does it. What
agrees?

Each scenario drives in virtual time with faults; what its watchdog, mux and filter would have recorded is written to
files, read, and fed to new ones. Exit code 1: less than AGREE of the trips that have a file come out the same.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Final

from rich.console import Console
from rich.table import Table

from canbase_campaign import forked
from canbase_campaign.plan import draw_plan
from canbase_campaign.planned import Plan
from canbase_campaign.runner import start_of
from canbase_campaign.world import World
from canbase_recording.replay_file import read_trip, read_velocity
from canbase_recording.replay_text import verdict
from canbase_recording.replay_trip import Replayed, replay_trip
from canbase_recording.replay_velocity import VelocityReplay, causes, replay_velocity
from canbase_watchdog.trip_cause import TripCause
from support.recorded_stops import record_in_a_copy

STOPS = 100
AGREE = 0.9
STUFFING = (0.9, 1.05)
"""A frame has more or fewer stuff bits than the typical one: else everything lies on one grid, and on its limits."""
WATCHDOG, FILTER = "watchdog", "mux and filter"
SAME, CANNOT, DIFFERS = "same within a tick", "cannot be replayed", "differs"


@dataclass(frozen=True, slots=True)
class Outcome:
    """One life of the watchdog in one scenario."""

    seed: int
    faults: tuple[str, ...]
    cause: str
    """That was recorded."""
    result: str
    said: str
    late_s: float
    part: str = WATCHDOG


def replayed(seed: int, folder: Path) -> list[Outcome]:
    """The scenario of this seed: all trips of its watchdog, all stops of its filter."""
    start, plan = start_of(seed), draw_plan(seed)
    path = folder / f"{seed}.asc"

    def run() -> None:
        _wobble(start.world, plan)
        start.run(plan)

    record_in_a_copy(start.world, run, path, plan.bitrate)
    trips = [(at_s, TripCause(cause)) for at_s, cause in json.loads(path.with_suffix(".trips").read_text())]
    own = [life for file in folder.glob("watchdog_*.jsonl") for life in replay_trip(read_trip(file))]
    decided = [replay_velocity(read_velocity(file)) for file in sorted(folder.glob("velocity_*.jsonl"))]
    for file in folder.iterdir():
        file.unlink()
    faults = tuple(fault.name for fault in plan.faults)
    return [
        *_filter_outcomes(seed, faults, decided),
        *(_outcome(seed, faults, cause, _life_of(at_s, own)) for at_s, cause in trips),
    ]


def _filter_outcomes(seed: int, faults: tuple[str, ...], decided: Sequence[VelocityReplay]) -> list[Outcome]:
    """Each stop of the filter once, though two files may have it; and the other decisions of mux and filter."""
    stops = {recorded.at_s: (recorded, now) for found in decided for recorded, now in causes(found)}
    told = [
        Outcome(
            seed, faults, f"filter: {recorded.cause}", SAME if recorded.is_as(now) else DIFFERS, f"{now}", 0.0, FILTER
        )
        for recorded, now in stops.values()
    ]
    wrong = [found for found in decided if not found.agrees]
    return told + [
        Outcome(seed, faults, "filter and mux: others", DIFFERS, f"{found.different} decisions", 0.0, FILTER)
        for found in wrong
    ]


LOST: Final = "the watchdog's process ended before it wrote the inputs of this trip"
NEAR_S: Final = 0.02


def _life_of(at_s: float, own: Sequence[Replayed]) -> Replayed | None:
    ends = (life for life in own if life.life.trip is not None and abs(life.life.trip.at_s - at_s) < NEAR_S)
    return next(ends, None)


def _outcome(seed: int, faults: tuple[str, ...], cause: TripCause, life: Replayed | None) -> Outcome:
    name = cause.name.lower().replace("_", " ")
    if life is None:
        return Outcome(seed, faults, name, CANNOT, LOST, math.nan)
    result = SAME if life.agrees else CANNOT if life.cannot else DIFFERS
    return Outcome(seed, faults, name, result, verdict(life), life.late_s)


def _wobble(world: World, plan: Plan) -> None:
    random = Random(f"stuffing {plan.seed}")

    def on_frame(_sender: str, _cob_id: int, _data: bytes) -> None:
        world.bus.bitrate = round(plan.bitrate * random.uniform(*STUFFING))

    world.bus.watch = on_frame


def drawn(stops: int, first: int = 0) -> Iterator[Outcome]:
    """Scenarios from this seed on, until so many trips were recorded. Each in a process of its own robot's world."""
    tripped, seed = 0, first
    with tempfile.TemporaryDirectory(prefix="canbase-replays-") as folder:
        while tripped < stops:
            for outcome in in_a_copy(seed, Path(folder)):
                tripped += outcome.part == WATCHDOG
                yield outcome
            seed += 1


def in_a_copy(seed: int, folder: Path) -> list[Outcome]:
    """The replay is for every scenario the first thing that its process does: nothing is left of the one before."""
    start_of(seed)
    found = forked.in_a_copy(lambda: replayed(seed, folder))
    if found is None:
        raise RuntimeError(f"the replay of seed {seed} failed")
    return found


def table(outcomes: Iterable[Outcome]) -> Table:
    """By the recorded cause."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for outcome in outcomes:
        counts[outcome.cause][outcome.result] += 1
    shown = Table("recorded cause", SAME, DIFFERS, CANNOT)
    for cause in sorted(counts):
        shown.add_row(cause, *(str(counts[cause][result]) for result in (SAME, DIFFERS, CANNOT)))
    return shown


def main() -> int:
    """Print what differs, and the table."""
    parser = argparse.ArgumentParser(prog="campaign.replays", description=__doc__)
    parser.add_argument("--stops", type=int, default=STOPS, help="recorded trips")
    parser.add_argument("--first", type=int, default=0, help="seed of the first scenario")
    given = parser.parse_args()
    out, outcomes = Console(), []
    for outcome in drawn(given.stops, given.first):
        outcomes.append(outcome)
        if outcome.result == DIFFERS:
            told = f"seed {outcome.seed} ({', '.join(outcome.faults)}): recorded {outcome.cause}; {outcome.said}"
            out.print(told, highlight=False, markup=False, soft_wrap=True)
    out.print(table(outcomes))
    known = [outcome for outcome in outcomes if outcome.part == WATCHDOG and outcome.result != CANNOT]
    late_ms = sorted(1000.0 * outcome.late_s for outcome in known if outcome.result == SAME)
    if late_ms:
        out.print(f"replayed minus recorded: {late_ms[0]:.1f} to {late_ms[-1]:.1f} ms", highlight=False)
    same = sum(outcome.result == SAME for outcome in known)
    out.print(f"of {len(known)} trips that have a file {same} are the same within a tick", highlight=False)
    filtered = [outcome for outcome in outcomes if outcome.part == FILTER]
    agree = sum(outcome.result == SAME for outcome in filtered)
    out.print(f"of {len(filtered)} stops of the safety filter {agree} are the same at the same time", highlight=False)
    return 0 if same >= AGREE * len(known) and agree == len(filtered) else 1


if __name__ == "__main__":
    sys.exit(main())
