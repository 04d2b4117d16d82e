"""Notices a scanner that sends the same again and again: with the same stamp, or with new stamps.

Rules:
1. A scan with the stamp of the one before is that one: it does not count again.
2. Real scanners are noisy: when every reading is exactly equal for `frozen_s` and FROZEN_SCANS scans, it is frozen.
3. Where nothing is in range there is nothing to compare: such scans are never frozen (safety.scan.allow_empty).
4. A simulator without noise (`noisy` false): equal scans count only while the base moves.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from canbase_velocity.scan import Scan
from canbase_velocity.sweep import Floats

FROZEN_SCANS: Final = 4
"""A driver may send each scan twice; three repetitions are no accident."""


class FrozenWatch:
    """Remembers the readings of the scan before, for one scanner."""

    def __init__(self, frozen_s: float, *, noisy: bool) -> None:
        self._frozen_s, self._noisy = frozen_s, noisy
        self._stamp_ns: int | None = None
        self._ranges: Floats = np.empty(0)
        self._looked_at = math.nan
        self._same = 0
        self._same_s = 0.0
        self.since = math.nan
        """When these readings were received first (monotonic) [s]."""

    def is_repeated(self, scan: Scan) -> bool:
        """Rule 1: the stamp is that of the scan before."""
        before, self._stamp_ns = self._stamp_ns, scan.stamp_ns
        return scan.stamp_ns is not None and scan.stamp_ns == before

    def look(self, scan: Scan, now: float, *, moves: bool) -> str:
        """Why the scanner counts as frozen, empty: it does not. `moves`: the base may have moved since the last one."""
        ranges = np.array(scan.ranges_m, dtype=np.float64)  # a copy: the message may be used again
        before, self._ranges = self._ranges, ranges
        in_range = (ranges >= scan.range_min_m) & (ranges <= scan.range_max_m) & np.isfinite(ranges)
        if not in_range.any() or not np.array_equal(ranges, before, equal_nan=True):
            self._same, self._same_s, self.since = 1, 0.0, now
        else:
            self._same += 1
            self._same_s += now - self._looked_at if moves or self._noisy else 0.0
        self._looked_at = now
        if self._same < FROZEN_SCANS or self._same_s < self._frozen_s:
            return ""
        return f"the same {ranges.size} readings for {self._same_s:.1f} s, {self._same} scans"
