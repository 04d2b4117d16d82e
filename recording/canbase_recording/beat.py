"""Something that comes again and again: its period, and whether it is missing. Pure."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Final

SAMPLES: Final = 25
"""Gaps that the period is taken from, the last ones: a process reads what waited for it in a burst."""
LEAST_GAPS: Final = 4
"""Fewer show no period."""
MISSING_PERIODS: Final = 3.0
LEAST_S: Final = 0.05
"""Nothing is missing sooner: a loaded computer writes frames down late."""


@dataclass(slots=True)
class Beat:
    """Times in seconds of the recording."""

    count: int = 0
    last_s: float = -math.inf
    longest_s: float = 0.0
    is_lost: bool = False
    """It has been reported as missing."""
    _gaps: deque[float] = field(default_factory=lambda: deque(maxlen=SAMPLES))
    _period_s: float = math.nan

    def on_beat(self, at_s: float) -> None:
        """It came."""
        if self.count:
            gap_s = at_s - self.last_s
            self.longest_s = max(self.longest_s, gap_s)
            self._gaps.append(gap_s)
            if len(self._gaps) >= LEAST_GAPS:
                self._period_s = sorted(self._gaps)[len(self._gaps) // 2]
        self.count += 1
        self.last_s = at_s

    @property
    def period_s(self) -> float:
        """The median of its last gaps [s]; NaN: it has none."""
        return self._period_s

    def limit_s(self) -> float:
        """After this long without it, it is missing [s]; infinity: it has no period."""
        return math.inf if math.isnan(self._period_s) else max(MISSING_PERIODS * self._period_s, LEAST_S)

    def is_missing(self, now_s: float) -> bool:
        """Whether it should have come by now."""
        return now_s - self.last_s > self.limit_s()
