"""What a recording shows of the watchdog that ran: its states, its trips, and which leases it had. Pure; docs/bus.md.

Its state frame 1FEh comes every 50 ms and at once with each change. A life ends with a trip: what comes after it is
the consequence of it.
"""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from canbase_recording.entry import RecordedFrame
from canbase_watchdog import frames
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import State

SILENT_S: Final = 0.3
"""Without a state frame for so long the watchdog did not run, or its frames did not arrive [s]."""
AGE_S: Final = 0.001
"""The state frame has the age of the lease in whole milliseconds."""
WAY_S: Final = 0.003
"""A frame or a lease is on its way for less than this [s]."""
OWN_S: Final = 0.006
"""Its own stop frames come so shortly before the state frame that reports the trip [s]."""
BINS, NEAR_BINS = 50, 4
"""Parts of a tick, and so many of them are one place: frames differ in their stuff bits."""
_STATE: Final = struct.Struct("<BBBBHBB")
_SDO_REQUESTS: Final = range(frames.SDO_REQUEST + 1, frames.SDO_REQUEST + 0x80)
_STOP_PDOS: Final = range(frames.QUICK_STOP_RPDO + 1, frames.QUICK_STOP_RPDO + 0x80)


@dataclass(frozen=True, slots=True)
class Trip:
    """The watchdog stopped the drives: when [s], why, because of which node (0: none), and in words if it told them."""

    at_s: float
    cause: TripCause | None
    """None: a number that this canbase does not know."""
    node_id: int
    detail: str = ""

    @property
    def name(self) -> str:
        """Of the cause, for people."""
        return "unknown" if self.cause is None else self.cause.name.lower().replace("_", " ")


@dataclass(frozen=True, slots=True)
class Seen:
    """One state frame. `lease_at_s`: what the age of its newest lease counts from, at most AGE_S later; -inf: none."""

    at_s: float
    state: int
    cause: int
    node_id: int
    lease_at_s: float


@dataclass(frozen=True, slots=True)
class Life:
    """From a start or a reset of the watchdog, or the begin of the recording, to its trip or the recording's end."""

    from_s: float
    until_s: float
    trip: Trip | None
    starts: bool
    """It begins with the start of a watchdog."""
    silent: tuple[tuple[float, float], ...]
    """When no state frame came for SILENT_S: from and to [s]."""


def seen(recorded: Iterable[RecordedFrame]) -> list[Seen]:
    """All state frames."""
    return [
        _seen(frame.at_s, frame.data)
        for frame in recorded
        if frame.cob_id == frames.STATE and len(frame.data) == _STATE.size
    ]


def _seen(at_s: float, data: bytes) -> Seen:
    state, cause, _rung, node_id, age_ms, _number, _answer = _STATE.unpack(data)
    lease_at_s = -math.inf if age_ms == frames.LEASE_AGE_UNKNOWN else at_s - age_ms * 1e-3
    return Seen(at_s, state, cause, node_id, lease_at_s)


def lives(states: Sequence[Seen], began_s: float, ends_s: float) -> list[Life]:
    """In their order. Empty: no state frame came, or it was tripped all the time."""
    found: list[Life] = []
    from_s, starts, before = began_s, False, State.WATCHING
    here: list[float] = [began_s]
    for each in states:
        tripped = each.state == State.TRIPPED
        if tripped and before != State.TRIPPED:
            first = each is states[0]
            if not first:  # else it was tripped before the recording began
                found.append(Life(from_s, each.at_s, _trip(each), starts, _silent([*here, each.at_s])))
        elif not tripped and (before == State.TRIPPED or (each.state == State.STARTING and before != State.STARTING)):
            if before == State.WATCHING and each is not states[0]:
                found.append(Life(from_s, here[-1], None, starts, _silent(here)))
            from_s, here = each.at_s, []
            starts = each.state == State.STARTING
        here.append(each.at_s)
        before = State(each.state) if each.state in tuple(State) else before
    if states and before != State.TRIPPED:
        found.append(Life(from_s, ends_s, None, starts, _silent([*here, ends_s])))
    return found


def _trip(each: Seen) -> Trip:
    return Trip(each.at_s, TripCause(each.cause) if each.cause in tuple(TripCause) else None, each.node_id)


def _silent(times: Sequence[float]) -> tuple[tuple[float, float], ...]:
    return tuple((a, b) for a, b in itertools.pairwise(times) if b - a > SILENT_S)


def heard(recorded: Iterable[RecordedFrame], trips: Sequence[Trip]) -> Iterator[RecordedFrame]:
    """The frames that the watchdog heard of others. Its own stop frames look like those of another master: of what is
    received shortly before a trip is reported they are taken away, and after it all that only a ladder sends.
    """
    for frame in recorded:
        if frame.cob_id not in (frames.STATE, frames.COUNTERS, frames.WATCHDOG_HEARTBEAT) and not _is_own(frame, trips):
            yield frame


def _is_own(frame: RecordedFrame, trips: Sequence[Trip]) -> bool:
    if frame.sent or not (frame.cob_id in _STOP_PDOS or frame.cob_id in _SDO_REQUESTS or frame.cob_id == frames.NMT):
        return False
    return any(
        trip.at_s <= frame.at_s or (trip.at_s - OWN_S <= frame.at_s and trip.cause is not TripCause.FOREIGN_MASTER)
        for trip in trips
    )


def tick_phase_s(states: Sequence[Seen], tick_s: float, frame_s: float) -> float:
    """A time on the grid of the watchdog's ticks [s]: state frames leave in a tick, and take `frame_s` on the bus. Some
    wait for it; those that do not are where most of them are. 0.0 where there is none.
    """
    if not states:
        return 0.0
    origin = states[0].at_s
    counts = [0] * BINS
    for each in states:
        counts[int((each.at_s - origin) % tick_s / tick_s * BINS) % BINS] += 1
    best = max(range(BINS), key=lambda at: sum(counts[(at + k) % BINS] for k in range(NEAR_BINS)))
    first = next(at for at in range(best, best + NEAR_BINS) if counts[at % BINS])
    return origin + first * tick_s / BINS - frame_s
