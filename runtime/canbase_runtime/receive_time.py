"""When a message counts as received, also after a pause of this process (SIGSTOP, a busy loop, a frozen computer).

A message that waited in a queue meanwhile looks new when it is taken out. It may be as old as the pause, so it counts
from before the pause: an order of that time orders nothing now.
"""

from __future__ import annotations

import math
from typing import Final

GAP_S: Final = 0.1
"""Two looks that are further apart mean that this process stood still between them."""
SETTLE_S: Final = 0.1
"""For this long after a pause a message that is taken out of the queues may be from before its end [s]."""
REQUEST_GAP_S: Final = 0.5
REQUEST_SETTLE_S: Final = 0.5
"""The same for requests, whose callers wait for seconds: a busy computer must not have them refused."""
RESENT_S: Final = 3.5
"""A request that did not fit into the buffers of a process that stood still is sent again by DDS: its heartbeat period
is 3 s. For this long after a pause a goal may be from before its end [s]."""


class ReceiveTimes:
    """The loop calls it in each of its turns, at the latest every `gap_s` / 2, and at each message."""

    def __init__(self, gap_s: float = GAP_S, settle_s: float = SETTLE_S) -> None:
        self._gap_s, self._settle_s = gap_s, settle_s
        self._looked_at = math.inf
        self._before_pause = self._settled_at = -math.inf

    def at(self, now_s: float) -> float:
        """The receive time of what is taken in at `now_s` (both monotonic, s): `now_s`, or before the last pause."""
        if now_s - self._looked_at > self._gap_s:
            if self._looked_at >= self._settled_at:  # else the queues are not empty yet since the pause before
                self._before_pause = self._looked_at
            self._settled_at = now_s + self._settle_s
        self._looked_at = now_s
        return now_s if now_s >= self._settled_at else self._before_pause

    @classmethod
    def of_requests(cls) -> ReceiveTimes:
        """For requests."""
        return cls(REQUEST_GAP_S, REQUEST_SETTLE_S)

    def waited(self, now_s: float) -> bool:
        """What is taken in at `now_s` may have waited while this process stood still."""
        return self.at(now_s) != now_s
