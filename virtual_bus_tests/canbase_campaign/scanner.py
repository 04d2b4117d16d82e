"""The laser scanner of the campaign, reading by reading, and ways in which it lies. Its faults are those of lidar.py.

Only scenarios with such a fault have it: their scans go the whole way through the filter, from the first one on.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from canbase_campaign.lidar import ByTurns, Fault, Frozen, Late, Lidar, blind, one_beam_left
from canbase_velocity.scan import Scan

NAN = math.nan
HALF_WALL_M = 0.6
FAR_M = 5.0
"""There always is something in the room."""
ROOM = [(FAR_M * math.cos(turn), FAR_M * math.sin(turn)) for turn in np.arange(0.1, 2.0 * math.pi, 0.2)]


@dataclass(frozen=True, slots=True)
class Lie:
    """`hides`: it has no reading of what is ahead, and reports that: NaN, or no reading."""

    sentence: str
    begin: Callable[[], Fault]
    hides: bool = False


def _mirrored(scan: Scan) -> Scan:
    """It counts its readings the other way round from now on."""
    flipped = np.asarray(scan.ranges_m)[::-1]
    return dataclasses.replace(
        scan,
        ranges_m=flipped,
        angle_min_rad=scan.angle_min_rad + scan.angle_increment_rad * (scan.count - 1),
        angle_increment_rad=-scan.angle_increment_rad,
        angle_max_rad=scan.angle_min_rad,
    )


class _Slewed:
    """Its stamps fall behind by SLEW_S more with each scan, up to `most_s`: chrony's fastest, ten scans a second.

    Negative: they run ahead.
    """

    SLEW_S = 0.0083

    def __init__(self, most_s: float) -> None:
        self._most_s, self._scans = most_s, 0

    def __call__(self, scan: Scan) -> Scan:
        self._scans += 1
        behind_s = math.copysign(min(self._scans * self.SLEW_S, abs(self._most_s)), self._most_s)
        return dataclasses.replace(scan, stamp_ns=(scan.stamp_ns or 0) - round(behind_s * 1e9))


LIES = {
    "scanner_blind": Lie("a scanner reads nothing but NaN", lambda: blind(NAN), hides=True),
    "scanner_blind_ahead": Lie("a scanner reads NaN in front", lambda: blind(NAN, 0.5), hides=True),
    "scanner_partly_blind": Lie("a scanner reads NaN in a fifth in front", lambda: blind(NAN, 0.2), hides=True),
    "scanner_zero_ahead": Lie("a scanner reads 0 in front", lambda: blind(0.0, 0.5), hides=True),
    "scanner_one_beam": Lie("one beam of a scanner is left", lambda: one_beam_left, hides=True),
    "scanner_frozen": Lie("old readings come with new stamps", lambda: Frozen(new_stamps=True)),
    "scanner_old_stamps": Lie("the same scan comes again and again", lambda: Frozen(new_stamps=False)),
    "scanner_by_turns": Lie("three old scans come by turns, with new stamps", lambda: ByTurns(3, new_stamps=True)),
    "scanner_late": Lie("each scan comes later than the one before", lambda: Late(2.0, per_s=1.0)),
    "scanner_delayed": Lie("each scan comes a second late", lambda: Late(1.0)),
    "scanner_clock_slewed": Lie("chrony slews the clock of a scanner's computer by 1 s", lambda: _Slewed(1.0)),
    "scanner_clock_ahead": Lie("chrony slews the clock of a scanner's computer ahead by 1 s", lambda: _Slewed(-1.0)),
    "scanner_mirrored": Lie("a scanner counts the other way round", lambda: _mirrored),
}


class Scanner:
    """One scanner in the middle of the base. `lies`: the faults that hold now, by name."""

    def __init__(self, front_m: float, rear_m: float) -> None:
        self._front_m, self._rear_m = front_m, rear_m
        self._lidar = Lidar()
        self.lies: dict[str, Fault] = {}

    def begin(self, name: str) -> None:
        """It lies so from now on."""
        self.lies[name] = LIES[name].begin()

    def end(self, name: str) -> None:
        """It does not lie so any more."""
        self.lies.pop(name, None)

    @property
    def hides(self) -> bool:
        """What is ahead is not seen, and the scanner reports that."""
        return any(LIES[name].hides for name in self.lies)

    def scan(self, ahead_m: float, behind_m: float, now_s: float) -> Scan:
        """What it sends, with walls so far from the footprint [m]; infinity: none."""
        places = list(ROOM)
        across = np.linspace(-HALF_WALL_M, HALF_WALL_M, 25)
        if ahead_m < math.inf:
            places += [(self._front_m + max(0.0, ahead_m), y_m) for y_m in across]
        if behind_m < math.inf:
            places += [(-self._rear_m - max(0.0, behind_m), y_m) for y_m in across]
        sent = dataclasses.replace(self._lidar.scan(np.array(places)), stamp_ns=round(now_s * 1e9))
        for lie in self.lies.values():
            sent = lie(sent)
        return sent
