"""How many lines of the log others may cause: a burst, then a few each second. The others are counted, not written.

Rule. What one request or message writes is bounded, whoever sends it and however often: a disk or a journal that is
full of one client's requests has no room for the cause of a stop.
"""

from __future__ import annotations

import math
from typing import Final

BURST: Final = 20.0
"""So many lines at once."""
PER_S: Final = 1.0
"""Then so many each second."""


class LogBudget:
    """Of one kind of lines."""

    def __init__(self, burst: float = BURST, per_s: float = PER_S) -> None:
        self._burst, self._per_s = burst, per_s
        self._left, self._at_s = burst, -math.inf
        self.omitted = 0
        """Lines since the last one that was written."""

    def take(self, now_s: float) -> int | None:
        """Asks for a line at `now_s` [s, monotonic]. None: it is omitted, and counted.

        Otherwise it is written, and this is how many were omitted since the line before it.
        """
        self._left = min(self._burst, self._left + self._per_s * (now_s - self._at_s))
        self._at_s = now_s
        if self._left < 1.0:
            self.omitted += 1
            return None
        self._left -= 1.0
        omitted, self.omitted = self.omitted, 0
        return omitted
