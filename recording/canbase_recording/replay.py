"""The watchdog once more: the recorded frames and leases into its real core, in virtual time. Pure.

A watchdog that has just started is fed from the begin of the recording, and ticks as its loop does: every TICK_S, and
when a timeout runs out. It does not know what was before; where it trips for that reason within WARM_UP_S, and the one
that ran did not, it is started again. What its process alone knows (its own lateness, its bus adapter, its record on
disk, a request to end) is not in a recording.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from canbase_config.watchdog import WatchdogConfig
from canbase_recording.entry import RecordedFrame
from canbase_recording.recorded_inputs import RecordedInputs
from canbase_recording.recorded_leases import Leases, datagram, leases
from canbase_recording.recorded_watchdog import Life, Trip, heard, lives, seen, tick_phase_s
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import State, Watchdog

TICK_S: Final = 0.005
"""Of canbase_watchdog.loop."""
WARM_UP_S: Final = 1.0
AFTER_S: Final = 0.1
"""So long after the recorded trip it may still trip: what a recording shows after it is not what caused it [s]."""
EDGE: Final = 0.002
"""Accuracy of the time between two recorded moments, as a share: the driver records when it gave a frame to the bus,
not when the watchdog heard it. Where a limit is reached to within that, the one that ran may have judged a cycle sooner
or later."""
EVIDENCE: Final = ("motion_missing_s", "slow_wheel_s", "stand_answer_s", "twist_s")
"""Keys of WatchdogConfig: for so long a sensor or a wheel must have shown it. It adds up from cycle to cycle."""
NOT_RECORDED: Final = {
    TripCause.BUS_FAILED: "the watchdog's own bus adapter failed, which the driver's recording does not show",
    TripCause.LOOP_LATE: "the watchdog's own loop was late, which the recording does not show",
    TripCause.ENDED: "the watchdog's process was requested to end, which the recording does not show",
    TripCause.POWER_AT_END: "the cause comes from the watchdog's record on disk, of its life before",
    TripCause.RECORD_UNUSABLE: "the watchdog's record on disk could not be read",
}
"""Causes that cannot be replayed, and why."""


@dataclass(frozen=True, slots=True)
class Replayed:
    """One life of the recorded watchdog, and what a new one does in it. None: no trip."""

    life: Life
    trip: Trip | None
    starts: int
    """How often it was started again in the warm-up."""
    tolerance_s: float = TICK_S
    """A tick, and the time for which the frames of the trip are on the bus."""
    cycle_s: float = 0.01
    """Of the driver."""
    lacks_a_cycle: bool = False
    """It trips where the evidence against a sensor has to last one cycle less: the new watchdog began it later."""
    on_edge: bool = False
    """It agrees within the accuracy of the recorded times, EDGE: a limit was reached just so."""
    whole: bool = False
    """It had all inputs of the watchdog that ran, from its own file."""

    @property
    def cannot(self) -> str:
        """Why this trip cannot be replayed; empty: it can."""
        trip = self.life.trip
        if trip is None:
            return self._blind
        if trip.cause is None:
            return "this canbase does not know the cause that was recorded"
        if self.whole:
            return self._short
        return NOT_RECORDED.get(trip.cause, "") or self._blind or self._short

    @property
    def _blind(self) -> str:
        """One of them trips while the recording shows nothing of the watchdog."""
        for begin_s, end_s in self.life.silent:
            for trip in (self.life.trip, self.trip):
                if trip is not None and begin_s < trip.at_s <= end_s + BLIND_S:
                    return "no frame of the watchdog came just before: driver or watchdog was cut off, or did not run"
        return ""

    @property
    def _short(self) -> str:
        """The recording begins so shortly before the trip that the limits of a new watchdog are still open."""
        before_s = self.life.until_s - self.life.from_s
        if self.agrees or self.life.starts or before_s >= WARM_UP_S:
            return ""
        return f"only {before_s:.2f} s are recorded before it; a new watchdog needs {WARM_UP_S:g} s to know its limits"

    @property
    def late_s(self) -> float:
        """How much later than the recorded trip [s]; NaN where one of them is missing."""
        return self.trip.at_s - self.life.trip.at_s if self.trip and self.life.trip else math.nan

    @property
    def agrees(self) -> bool:
        """Both trip by the same cause within one tick, and the time of a frame on the bus; or none trips."""
        if self.trip is None or self.life.trip is None:
            return self.trip is self.life.trip is None
        near = abs(self.late_s) <= self.tolerance_s
        return self.trip.cause is self.life.trip.cause and near and not self.lacks_a_cycle

    @property
    def is_a_cycle_apart(self) -> bool:
        """The same cause, one control cycle sooner or later: what a sensor must have shown adds up from cycle to cycle,
        and a new watchdog began at another point."""
        same = self.trip is not None and self.life.trip is not None and self.trip.cause is self.life.trip.cause
        return same and not self.agrees and abs(self.late_s) <= self.tolerance_s + self.cycle_s

    @property
    def differs(self) -> bool:
        """It should do what was recorded, and does not."""
        return not (self.agrees or self.is_a_cycle_apart or self.cannot)


STOP_FRAMES: Final = 3
"""Of each node: quick stop, NMT, SDO. They leave before the state frame."""
FRAME_BITS: Final = 130
BLIND_S: Final = 0.3
"""What was missed shows so long after it [s]."""


def tolerance_s(inputs: RecordedInputs) -> float:
    """How far the times of two trips may be apart: a tick, and until the driver has the state frame [s]."""
    nodes = len({drive.node_id for drive in inputs.watchdog.drives})
    return TICK_S + (nodes * STOP_FRAMES + 2) * FRAME_BITS / inputs.bitrate


@dataclass(frozen=True, slots=True)
class WatchdogReplay:
    """All lives, and the leases and frames that were taken. `source`: whose recording it is, for people."""

    lives: tuple[Replayed, ...]
    leases: Leases
    lease_count: int
    frames: int
    source: str = "of the driver's recording"


@dataclass(frozen=True, slots=True)
class _Inputs:
    """What goes into the watchdog, in the order of time, and what is known of the one that ran."""

    frames: tuple[RecordedFrame, ...]
    leases: Leases
    lives: tuple[Life, ...]
    phase_s: float
    tolerance_s: float
    cycle_s: float

    def stretched(self, share: float, fixed_s: float) -> _Inputs:
        """The same with all times from `fixed_s` longer by this share."""
        frames = tuple(frame._replace(at_s=frame.at_s + share * (frame.at_s - fixed_s)) for frame in self.frames)
        moved = [replace(lease, at_s=lease.at_s + share * (lease.at_s - fixed_s)) for lease in self.leases.leases]
        return replace(self, frames=frames, leases=replace(self.leases, leases=moved))


def _given(inputs: RecordedInputs) -> _Inputs:
    states = seen(inputs.frames)
    found = tuple(lives(states, inputs.began_s, inputs.ends_s))
    trips = [life.trip for life in found if life.trip is not None]
    frames = tuple(heard(inputs.frames, trips))
    phase_s = tick_phase_s(states, TICK_S, FRAME_BITS / inputs.bitrate)
    return _Inputs(
        frames, leases(inputs.commands, states), found, phase_s, tolerance_s(inputs), 1.0 / inputs.watchdog.control_hz
    )


def replay_watchdog(inputs: RecordedInputs, config: WatchdogConfig | None = None) -> WatchdogReplay:
    """`config`: None: the recorded one. With another one a life ends at the recorded trip."""
    given = _given(inputs)
    after_s = AFTER_S if config is None else 0.0
    config = config or inputs.watchdog
    lives = tuple(_life(given, life, config, after_s) for life in given.lives)
    return WatchdogReplay(lives, given.leases, len(given.leases.leases), len(inputs.frames))


def _life(given: _Inputs, life: Life, config: WatchdogConfig, after_s: float) -> Replayed:
    """The first replay counts, unless one within the accuracy of the recorded times does what was recorded."""
    until_s = life.until_s + after_s if life.trip else life.until_s
    first = _warmed_up(given, life, config, until_s)
    if first.agrees or first.cannot or after_s == 0.0:
        return first
    edges = (_warmed_up(given.stretched(edge, life.until_s), life, config, until_s) for edge in (EDGE, -EDGE))
    found = next((replace(edge, on_edge=True) for edge in edges if edge.agrees and edge.trip is not None), first)
    if found.agrees or found.is_a_cycle_apart:
        return found
    short = replace(_warmed_up(given, life, _a_cycle_less(config), until_s), lacks_a_cycle=True)
    return short if short.is_a_cycle_apart else first


def _a_cycle_less(config: WatchdogConfig) -> WatchdogConfig:
    return replace(config, **{name: getattr(config, name) - 1.0 / config.control_hz for name in EVIDENCE})


def _warmed_up(given: _Inputs, life: Life, config: WatchdogConfig, until_s: float) -> Replayed:
    """A watchdog that is started again knows less; it counts where it does what the recorded one did."""
    trip = _first_trip(given, config, life.from_s, until_s)
    first = found = Replayed(life, trip, 0, given.tolerance_s, given.cycle_s)
    while not found.agrees and found.trip is not None and _in_warm_up(found, life):
        trip = _first_trip(given, config, found.trip.at_s + TICK_S, until_s)
        found = Replayed(life, trip, found.starts + 1, given.tolerance_s, given.cycle_s)
    return found if found.agrees else first


def _in_warm_up(found: Replayed, life: Life) -> bool:
    if life.starts or found.trip is None:
        return False
    return found.trip.at_s < min(life.from_s + WARM_UP_S, life.until_s - found.tolerance_s)


def _first_trip(given: _Inputs, config: WatchdogConfig, from_s: float, until_s: float) -> Trip | None:
    watchdog = Watchdog(_any_user(config), from_s)
    frames = iter([frame for frame in given.frames if from_s <= frame.at_s <= until_s])
    held = [(number, lease) for number, lease in enumerate(given.leases.leases, 1) if from_s <= lease.at_s <= until_s]
    waiting = iter(held)
    frame, lease = next(frames, None), next(waiting, None)
    for now_s in _ticks(watchdog, given.phase_s, from_s, until_s):
        while lease is not None and lease[1].at_s <= now_s:
            watchdog.on_lease(datagram(*lease), None, lease[1].at_s)
            lease = next(waiting, None)
        while frame is not None and frame.at_s <= now_s:
            watchdog.on_frame(frame.cob_id, frame.data, frame.at_s)
            frame = next(frames, None)
        watchdog.tick(now_s)
        status = watchdog.status
        if status.state is State.TRIPPED:
            return Trip(now_s, status.verdict.cause, status.verdict.node_id, status.verdict.detail)
    return None


def _any_user(config: WatchdogConfig) -> WatchdogConfig:
    return replace(config, lease_uid=None)


def _ticks(watchdog: Watchdog, phase_s: float, from_s: float, until_s: float) -> Iterator[float]:
    """On the grid, and just when a timeout runs out."""
    due = phase_s + math.ceil((from_s - phase_s) / TICK_S) * TICK_S
    acted_at = from_s
    while True:
        wake = min(due, watchdog.next_expiry(acted_at))
        if wake > until_s:
            return
        yield wake
        acted_at = wake
        if wake >= due:
            due += TICK_S
