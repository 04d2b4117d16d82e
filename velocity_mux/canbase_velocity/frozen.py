"""Notices a scanner that sends the same again and again: with the same stamp, or with new stamps.

Rules:
1. A scan with the stamp of the one before is that one: it does not count again.
2. Real scanners are noisy: when every reading is exactly equal for `frozen_s` and FROZEN_SCANS scans, it is frozen. So
   it is when up to PERIODS scans come by turns, as from a driver that hands out its old buffers.
3. Where nothing is in range there is nothing to compare: such scans are never frozen (safety.scan.allow_empty). Less
   than MANY readings are equal to an older scan's by chance: they are compared with the scan before alone.
4. A simulator without noise (`noisy` false): equal scans count only while the base moves.
5. A part of a scanner may freeze while the rest lives. Readings beside each other that are equal for FROZEN_SCANS scans
   and for `frozen_s` in which the base moves: if PART of all readings, and MANY, are in range among them, the scanner
   is frozen. A reading at a limit of the range is no measurement. Without noise (rule 4) a part is not noticed: along a
   wall its readings are equal.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

from canbase_velocity.scan import Scan
from canbase_velocity.sweep import Bools, Floats

FROZEN_SCANS: Final = 4
"""A driver may send each scan twice; three repetitions are no accident."""
PERIODS: Final = 8
"""The number of scans that are remembered."""
MANY: Final = 8
"""This many readings in range distinguish one scan from another."""
PART: Final = 1.0 / 12.0
"""Of a scan's readings."""


class FrozenWatch:
    """Remembers the readings of the scans before, for one scanner."""

    def __init__(self, frozen_s: float, *, noisy: bool) -> None:
        self._frozen_s, self._noisy = frozen_s, noisy
        self._stamp_ns: int | None = None
        self._before: deque[tuple[bytes, float]] = deque(maxlen=PERIODS)
        """The readings, newest first, and when they were received first."""
        self._looked_at = math.nan
        self._repeats = [0] * PERIODS
        """How often in a row a scan was equal to the one this many places, plus one, before it."""
        self._same_s = [0.0] * PERIODS
        self._last: Floats = np.empty(0)
        self._equal_scans, self._equal_s = np.empty(0), np.empty(0)
        """Of each reading: how often in a row it was equal to the one before, and how long while the base moved [s]."""
        self.since = math.nan
        """When these readings were received first (monotonic) [s]."""

    def is_repeated(self, scan: Scan) -> bool:
        """Rule 1: the stamp is that of the scan before."""
        before, self._stamp_ns = self._stamp_ns, scan.stamp_ns
        return scan.stamp_ns is not None and scan.stamp_ns == before

    def check_scan(self, scan: Scan, now_s: float, *, moves: bool) -> str:
        """Why the scanner counts as frozen, empty: it does not. `moves`: the base may have moved since the last one."""
        ranges = np.asarray(scan.ranges_m, dtype=np.float64)
        in_range = int(np.count_nonzero((ranges >= scan.range_min_m) & (ranges <= scan.range_max_m)))
        part = self._part(ranges, scan, now_s - self._looked_at if moves and self._noisy else 0.0)
        step_s = now_s - self._looked_at if moves or self._noisy else 0.0
        readings, self._looked_at, self.since = ranges.tobytes(), now_s, now_s
        compared = len(self._before) if in_range >= MANY else min(len(self._before), 1 if in_range else 0)
        for place in range(PERIODS):
            if place < compared and self._before[place][0] == readings:
                self._repeats[place] += 1
                self._same_s[place] += step_s
                self.since = self._before[place][1]
            else:
                self._repeats[place], self._same_s[place] = 0, 0.0
        self._before.appendleft((readings, self.since))
        return self._sentence(ranges.size) or part

    def _sentence(self, count: int) -> str:
        for place, (repeats, same_s) in enumerate(zip(self._repeats, self._same_s, strict=True)):
            if repeats + 1 >= FROZEN_SCANS and same_s >= self._frozen_s:
                turns = f", {place + 1} scans by turns" if place else ""
                return f"the same {count} readings for {same_s:.1f} s, {repeats + 1} scans{turns}"
        return ""

    def _part(self, ranges: Floats, scan: Scan, moved_s: float) -> str:
        """Rule 5. `moved_s`: how long the base has moved since the scan before [s]."""
        if ranges.size != self._last.size:
            self._last = ranges
            self._equal_scans, self._equal_s = np.zeros((2, ranges.size))
            return ""
        equal = (ranges == self._last) | (np.isnan(ranges) & np.isnan(self._last))
        self._last = ranges
        self._equal_scans = np.where(equal, self._equal_scans + 1, 0)
        self._equal_s = np.where(equal, self._equal_s + moved_s, 0.0)
        frozen = (self._equal_scans + 1 >= FROZEN_SCANS) & (self._equal_s >= self._frozen_s)
        most = _most_in_a_row(frozen, (ranges > scan.range_min_m) & (ranges < scan.range_max_m))
        if most < max(MANY, PART * ranges.size):
            return ""
        return f"{most} of its {ranges.size} readings, beside each other, the same for {self._frozen_s:.1f} s of motion"


def _most_in_a_row(frozen: Bools, in_range: Bools) -> int:
    """How many readings are in range in the longest row of frozen ones; the last one has the first one beside it."""
    if frozen.all():
        return int(np.count_nonzero(in_range))
    edges = np.flatnonzero(np.diff(np.tile(frozen, 2), prepend=False, append=False))
    counts = np.concatenate(([0], np.cumsum(np.tile(in_range, 2))))
    return int((counts[edges[1::2]] - counts[edges[::2]]).max(initial=0))
