"""Virtual time: events on a heap, run in the order of their time. Nothing here waits."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from typing import Any


class Clock:
    """`now` [s] jumps from one event to the next. Of events at one time, the one that was entered first comes first."""

    def __init__(self, now: float) -> None:
        self.now = now
        self._events: list[tuple[float, int, Callable[..., object], tuple[Any, ...]]] = []
        self._entered = 0

    def at(self, when: float, do: Callable[..., object], *arguments: Any) -> None:
        """Call `do(*arguments)` at `when` [s]; a time that is over counts as now."""
        self._entered += 1
        now = self.now
        heapq.heappush(self._events, (when if when > now else now, self._entered, do, arguments))

    def after(self, delay_s: float, do: Callable[..., object], *arguments: Any) -> None:
        """Call `do(*arguments)` after `delay_s`."""
        self.at(self.now + delay_s, do, *arguments)

    def run_until(self, end: float) -> None:
        """Let time pass up to and including `end` [s]."""
        events = self._events
        while events and events[0][0] <= end:
            self.now, _, do, arguments = heapq.heappop(events)
            do(*arguments)
        self.now = end
