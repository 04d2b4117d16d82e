"""Values over time out of the frames of a few seconds: each axis with its speeds in m/s where robot.yaml has its units.

Pure. Times are seconds of the recording.
"""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, TypeVar

from canbase_config.robot import Robot
from canbase_driver.cia402 import Command, DriveState, decode_statusword
from canbase_driver.drive_units import AxisUnits
from canbase_recording.frame_words import controlword_command

T = TypeVar("T")
Line = list[tuple[float, T]]
"""Values with their times, in order."""
COUNTER_BITS: Final = 32
MOVES_SHARE: Final = 0.05
MOST_POINTS: Final = 1_500
"""Of one line that is shown."""


@dataclass(slots=True)
class AxisTrace:
    """One CiA 402 axis. Raw values of the drive; `*_mps` and `*_m` convert them, forward positive."""

    node_id: int
    axis: int
    name: str
    units: AxisUnits | None
    status: Line[int] = field(default_factory=list)
    control: Line[int] = field(default_factory=list)
    target: Line[int] = field(default_factory=list)
    velocity: Line[int] = field(default_factory=list)
    position: Line[int] = field(default_factory=list)
    torque: Line[int] = field(default_factory=list)
    silent_since: list[float] = field(default_factory=list)
    """After `slim`: the last statuswords before pauses."""

    @property
    def has_units(self) -> bool:
        """Whether speeds and ways are in SI."""
        return self.units is not None

    def speed(self, raw: int) -> float:
        """Of 60FFh or 606Ch: rim speed [m/s], or the raw value without units."""
        return float(raw) if self.units is None else self.units.velocity_mps(raw)

    def way(self, counts: int) -> float:
        """Of a difference of 6064h: distance [m], or increments without units."""
        return float(counts) if self.units is None else self.units.position_m(counts)

    def state_at(self, at_s: float) -> DriveState | None:
        """The state that the last statusword showed; None: none came."""
        word = value_at(self.status, at_s)
        return None if word is None else decode_statusword(word)

    def command_at(self, at_s: float) -> Command | None:
        """The command that the last controlword had."""
        word = value_at(self.control, at_s)
        return None if word is None else controlword_command(word)

    def slim(self, silent_s: float, ended_s: float) -> None:
        """Fewer points to show; of the words their changes, and when none came for `silent_s` until `ended_s`."""
        times = [*(at_s for at_s, _ in self.status), ended_s]
        self.silent_since = [a for a, b in itertools.pairwise(times) if b - a > silent_s]
        self.status, self.control = _changes(self.status, silent_s), _changes(self.control, silent_s)
        self.target, self.velocity, self.torque = thinned(self.target), thinned(self.velocity), thinned(self.torque)
        self.position = thinned(self.position)

    def was_enabled(self, since_s: float, until_s: float) -> bool:
        """Whether it reported operation enabled at some time."""
        if self.state_at(since_s) is DriveState.OPERATION_ENABLED:
            return True
        words = (word for _, word in between(self.status, since_s, until_s))
        return any(decode_statusword(word) is DriveState.OPERATION_ENABLED for word in words)

    def travel(self, since_s: float, until_s: float) -> float | None:
        """Length of the way between two times, turns of the counter taken out; None: 6064h did not come."""
        counts = [value for _, value in around(self.position, since_s, until_s)]
        if len(counts) < 2:
            return None
        return sum(abs(self.way(wrapped(b - a))) for a, b in itertools.pairwise(counts))

    @property
    def peak(self) -> int:
        """The greatest number of 60FFh and 606Ch."""
        return max((abs(value) for line in (self.target, self.velocity) for _, value in line), default=0)

    def moves_at(self, at_s: float) -> bool:
        """Whether motion is ordered or measured, without knowing its unit: a share of the greatest number here."""
        now = [value_at(line, at_s) or 0 for line in (self.target, self.velocity)]
        return max(abs(value) for value in now) > MOVES_SHARE * self.peak

    def last_change(self, line: Line[int], until_s: float) -> float | None:
        """When a line last took another value, at or before `until_s`; None: it never did, or is empty."""
        end = bisect.bisect_right(line, until_s, key=_time)
        if not end:
            return None
        last = line[end - 1][1]
        for at in range(end - 2, -1, -1):
            if line[at][1] != last:
                return line[at + 1][0]
        return None


def thinned(points: list[T]) -> list[T]:
    """Every one, or every second, third, … of a long line."""
    return points[:: max(1, -(-len(points) // MOST_POINTS))]


def wrapped(counts: int) -> int:
    """A difference of two readings of a 32-bit counter."""
    half = 1 << (COUNTER_BITS - 1)
    return (counts + half) % (1 << COUNTER_BITS) - half


def _changes(line: Line[int], silent_s: float) -> Line[int]:
    """Another value, or the first one after a silence."""
    pairs = itertools.pairwise(line)
    return line[:1] + [entry for before, entry in pairs if entry[1] != before[1] or entry[0] - before[0] > silent_s]


def _time(entry: tuple[float, T]) -> float:
    return entry[0]


def value_at(line: Line[T], at_s: float) -> T | None:
    """The last value at or before a time."""
    at = bisect.bisect_right(line, at_s, key=_time)
    return line[at - 1][1] if at else None


def between(line: Line[T], since_s: float, until_s: float) -> Sequence[tuple[float, T]]:
    """Those with since_s < time <= until_s."""
    return line[bisect.bisect_right(line, since_s, key=_time) : bisect.bisect_right(line, until_s, key=_time)]


def around(line: Line[T], since_s: float, until_s: float) -> Sequence[tuple[float, T]]:
    """The same, with the one that was valid at `since_s`."""
    first = max(bisect.bisect_right(line, since_s, key=_time) - 1, 0)
    return line[first : bisect.bisect_right(line, until_s, key=_time)]


def times_between(times: Sequence[float], since_s: float, until_s: float) -> Sequence[float]:
    """Those with since_s < time <= until_s."""
    return times[bisect.bisect_right(times, since_s) : bisect.bisect_right(times, until_s)]


def around_times(times: Sequence[float], since_s: float, until_s: float) -> Sequence[float]:
    """The same, with the last one before them."""
    return times[max(bisect.bisect_right(times, since_s) - 1, 0) : bisect.bisect_right(times, until_s)]


def last_before(times: Sequence[float], at_s: float) -> float:
    """The last time at or before; minus infinity: none."""
    at = bisect.bisect_right(times, at_s)
    return times[at - 1] if at else -math.inf


def first_after(times: Sequence[float], at_s: float) -> float:
    """The first time after; infinity: none."""
    at = bisect.bisect_right(times, at_s)
    return times[at] if at < len(times) else math.inf


def units_of(robot: Robot | None) -> dict[tuple[int, int], tuple[str, AxisUnits]]:
    """Joint and units of each axis of robot.yaml."""
    drives = robot.drives if robot else ()
    base = robot.base if robot else None
    return {(drive.node_id, drive.axis): (drive.joint, AxisUnits(drive, base)) for drive in drives if base is not None}
