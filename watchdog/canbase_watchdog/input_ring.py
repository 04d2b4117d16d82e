"""What the watchdog decided from in the last seconds, call by call: frames, leases, ticks, and its verdicts. Pure.

The same calls give a new watchdog the same verdicts at the same ticks (`canbase record replay`). The form of the file:
docs/ros_api.md, "The inputs of a trip".
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from canbase_base.latch_record import Defect, Found, Mark
from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog.trip_cause import FINE, Verdict
from canbase_watchdog.watchdog import Watchdog

FORMAT = 2
"""Grows when a reader of this form would misread a new one."""
MAX_INPUTS = 80_000
"""A full bus of 1 Mbit/s for nearly ten seconds; about 15 MB in memory, 4 MB in a file."""
LATEST_S = 3.0
"""A file is due when all drives stand, or so long after the trip [s]."""

START, FRAME, LEASE, TICK, EXPIRE, SUSPEND, END, VERDICT = (
    "start", "frame", "lease", "tick", "expire", "suspend", "end", "verdict",
)  # fmt: skip
Input = tuple[Any, ...]
"""What it is, its monotonic time [s], and its values. A plain tuple: the garbage collector need not look at it."""


@dataclass(frozen=True, slots=True)
class Trip:
    """The trip that a file is written for. `at_s`: monotonic [s]."""

    at_s: float
    cause: int
    name: str
    node_id: int
    detail: str


@dataclass(frozen=True, slots=True)
class Cut:
    """The inputs of a trip, in the order of the calls; those before `since_s` are left out."""

    kept: Iterable[Input]
    since_s: float

    def __iter__(self) -> Iterator[Input]:
        return (each for each in self.kept if each[1] >= self.since_s)


class InputRing:
    """Keeps the newest inputs. `note`: takes one, as the functions below make them; appending is all that it costs."""

    def __init__(self, seconds: float, started_s: float) -> None:
        """`seconds`: how far a file goes back. `started_s`: when the watchdog was made."""
        self._seconds = seconds
        self._inputs: deque[Input] = deque([(START, started_s)], maxlen=MAX_INPUTS)
        self.note: Callable[[Input], None] = self._inputs.append

    def cut(self, now_s: float) -> Cut:
        """Those of the last seconds before `now_s`. Copied at once, and looked at by who writes them."""
        return Cut(self._inputs.copy(), now_s - self._seconds)


class TripWatch:
    """Notes each change of the verdict in the ring, and finds out when the file of a trip is due."""

    def __init__(self, ring: InputRing, past: Found | None) -> None:
        """`past`: what the watchdog was made with."""
        self._ring, self._past = ring, past
        self._verdict: Verdict | None = None
        self.open: Trip | None = None
        """The trip of this life whose file is not due yet."""

    def due_trip(self, watchdog: Watchdog, now_s: float) -> Trip | None:
        """After each tick: the trip whose file is due now."""
        if watchdog.verdict is not self._verdict:
            self._on_verdict(watchdog.verdict, now_s)
        trip = self.open
        if trip is None or (now_s < trip.at_s + LATEST_S and not watchdog.status.settled):
            return None
        self.open = None
        return trip

    def _on_verdict(self, verdict: Verdict, now_s: float) -> None:
        before, self._verdict = self._verdict, verdict
        cause = verdict.cause
        self._ring.note((VERDICT, now_s, int(cause), verdict.node_id, verdict.detail))
        if verdict is not FINE and not (before is None and self._has_its_file):
            self.open = Trip(now_s, int(cause), cause.name.lower(), verdict.node_id, verdict.detail)

    @property
    def _has_its_file(self) -> bool:
        """It starts with a trip of an earlier life, which wrote it: each restart would write it again."""
        past = self._past
        return past is not None and past.defect is Defect.NONE and past.record.mark is Mark.LATCHED


def head(config: WatchdogConfig, past: Found | None, trip: Trip, wall_offset_s: float) -> dict[str, Any]:
    """The first line of the file. `past`: the record on disk at the start of this watchdog; None: none was kept."""
    return {
        "format": FORMAT,
        "part": "watchdog",
        "robot": config.robot,
        "trip": dataclasses.asdict(trip),
        "wall_offset_s": wall_offset_s,
        "past": None if past is None else {**dataclasses.asdict(past), "defect": past.defect.value},
        "config": dataclasses.asdict(config),
    }


def lines(first: dict[str, Any], inputs: Iterable[Input]) -> Iterator[str]:
    """The file, line by line: one JSON object, then one JSON array for each input."""
    yield json.dumps(first) + "\n"
    for values in inputs:
        yield json.dumps([_plain(value) for value in values]) + "\n"


def _plain(value: Any) -> Any:
    """Bytes as hex; JSON has no infinity: null."""
    if isinstance(value, bytes):
        return value.hex()
    return None if isinstance(value, float) and not math.isfinite(value) else value
