"""The watchdog once more, call by call: the file of a trip's inputs into its real core. Pure.

The core decides by its calls alone, so with all of them it does the same at the same tick. Where the file begins in the
middle of a life, a new watchdog begins there: what it does not know is what was more than `black_box.seconds` before.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from canbase_config.watchdog import WatchdogConfig
from canbase_recording.trip_inputs import Call, RecordedVerdict, TripInputs
from canbase_watchdog.input_ring import END, EXPIRE, FRAME, LEASE, SUSPEND, TICK
from canbase_watchdog.trip_cause import FINE, TripCause
from canbase_watchdog.watchdog import Watchdog

TICK_S: Final = 0.005
"""Of canbase_watchdog.loop."""
WARM_UP_S: Final = 1.0
"""A watchdog that knows nothing of what was before may trip within this time [s]: then it is started again."""


@dataclass(frozen=True, slots=True)
class Trip:
    """The watchdog stopped the drives: when [s], why, because of which node (0: none), and its detail."""

    at_s: float
    cause: TripCause | None
    """None: a number that this canbase does not know."""
    node_id: int
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Life:
    """From a start or a reset of the watchdog, or the begin of the file, to its trip or the end of the file."""

    from_s: float
    until_s: float
    trip: Trip | None
    starts: bool
    """It begins with the start of a watchdog."""


@dataclass(frozen=True, slots=True)
class Replayed:
    """One life of the recorded watchdog, and what a new one does in it. `trip` None: no trip."""

    life: Life
    trip: Trip | None
    starts: int = 0
    """How often it was started again in the warm-up."""

    @property
    def cannot(self) -> str:
        """Why this trip cannot be replayed; empty: it can."""
        if self.life.trip is not None and self.life.trip.cause is None:
            return "this canbase does not know the cause that was recorded"
        before_s = self.life.until_s - self.life.from_s
        if self.life.trip is None or self.agrees or self.life.starts or before_s >= WARM_UP_S:
            return ""
        return f"only {before_s:.2f} s are recorded before it; a new watchdog needs {WARM_UP_S:g} s to know its limits"

    @property
    def late_s(self) -> float:
        """How much later than the recorded trip [s]; NaN where one of them is missing."""
        return self.trip.at_s - self.life.trip.at_s if self.trip and self.life.trip else math.nan

    @property
    def agrees(self) -> bool:
        """Both trip by the same cause within one tick; or none trips."""
        if self.trip is None or self.life.trip is None:
            return self.trip is self.life.trip is None
        return self.trip.cause is self.life.trip.cause and abs(self.late_s) <= TICK_S

    @property
    def differs(self) -> bool:
        """It should do what was recorded, and does not."""
        return not (self.agrees or self.cannot)


@dataclass(frozen=True, slots=True)
class WatchdogReplay:
    """All lives in the file of this name, and how many leases and frames it has."""

    lives: tuple[Replayed, ...]
    leases: int
    frames: int
    file: str


def replay_own(inputs: TripInputs, name: str) -> WatchdogReplay:
    """`name`: of the file."""
    counts = Counter(call[0] for call in inputs.calls)
    return WatchdogReplay(replay_trip(inputs), counts[LEASE], counts[FRAME], name)


def replay_trip(inputs: TripInputs, config: WatchdogConfig | None = None) -> tuple[Replayed, ...]:
    """All lives of the watchdog in this file. `config` None: the recorded one. With another one a life ends at the
    recorded trip: what comes after it is the consequence of it."""
    lives = tuple(_lives(inputs))
    if config is not None:
        return tuple(_alone(inputs, life, config, life.until_s) for life in lives)
    through = list(
        _verdicts(inputs, inputs.head.config, inputs.began_s, inputs.head.past if inputs.has_start else None)
    )
    return tuple(_replayed(inputs, life, through) for life in lives)


def _replayed(inputs: TripInputs, life: Life, through: Sequence[Trip]) -> Replayed:
    """By the watchdog that was fed from the begin of the file; else by one that begins with this life."""
    found = _beside(life, next((trip for trip in through if life.from_s <= trip.at_s <= life.until_s + TICK_S), None))
    if found.agrees or inputs.has_start:
        return found
    alone = _alone(inputs, life, inputs.head.config, life.until_s + TICK_S)
    return alone if alone.agrees else found


def _alone(inputs: TripInputs, life: Life, config: WatchdogConfig, until_s: float) -> Replayed:
    """A new watchdog from the begin of this life. Without its past it may trip at once: then it begins again."""
    exact = life.starts and inputs.has_start
    past = inputs.head.past if exact else None
    first = found = _beside(life, _first(inputs, config, life.from_s, until_s, past))
    while not found.agrees and not exact and found.trip is not None and _is_early(found.trip, life):
        trip = _first(inputs, config, found.trip.at_s + TICK_S, until_s, None)
        found = replace(_beside(life, trip), starts=found.starts + 1)
    return found if found.agrees else first


def _is_early(trip: Trip, life: Life) -> bool:
    return trip.at_s < min(life.from_s + WARM_UP_S, life.until_s - TICK_S)


def _beside(life: Life, trip: Trip | None) -> Replayed:
    return Replayed(life, trip)


def _first(inputs: TripInputs, config: WatchdogConfig, from_s: float, until_s: float, past: Any) -> Trip | None:
    return next((trip for trip in _verdicts(inputs, config, from_s, past, until_s)), None)


def _lives(inputs: TripInputs) -> Iterator[Life]:
    from_s, starts = inputs.began_s, inputs.has_start
    tripped = bool(inputs.verdicts) and inputs.verdicts[0].cause == TripCause.NONE and not starts
    for verdict in inputs.verdicts:
        if verdict.cause != TripCause.NONE:
            yield Life(from_s, verdict.at_s, _trip(verdict), starts)
            tripped = True
        elif tripped:
            from_s, starts, tripped = verdict.at_s, False, False
    if not tripped:
        yield Life(from_s, inputs.ends_s, None, starts)


def _trip(verdict: RecordedVerdict) -> Trip:
    known = verdict.cause in tuple(TripCause)
    return Trip(verdict.at_s, TripCause(verdict.cause) if known else None, verdict.node_id, verdict.detail)


def _verdicts(
    inputs: TripInputs, config: WatchdogConfig, from_s: float, past: Any, until_s: float = float("inf")
) -> Iterator[Trip]:
    """The trips of a watchdog that is fed from `from_s` on."""
    watchdog = Watchdog(config, from_s, past, loopback=config.hears_itself)
    verdict = FINE
    for call in inputs.calls:
        if not from_s <= call[1] <= until_s:
            continue
        do = _DO.get(call[0])
        if do is not None:
            do(watchdog, call)
        if call[0] == TICK and watchdog.verdict is not verdict:
            verdict = watchdog.verdict
            if verdict is not FINE:
                yield Trip(call[1], verdict.cause, verdict.node_id, verdict.detail)


def _tick(watchdog: Watchdog, call: Call) -> None:
    _, at_s, failed_since, errors = call
    watchdog.on_bus(failed_since, errors)
    watchdog.tick(at_s)


_DO: Final[Mapping[str, Callable[[Watchdog, Call], object]]] = {
    FRAME: lambda watchdog, call: watchdog.on_frame(call[2], call[3], call[1]),
    LEASE: lambda watchdog, call: watchdog.on_lease(call[2], call[3], call[1], call[4]),
    TICK: _tick,
    EXPIRE: lambda watchdog, call: watchdog.expire(call[1]),
    SUSPEND: lambda watchdog, call: watchdog.on_suspend(call[2]),
    END: lambda watchdog, call: watchdog.end(call[1]),
}
