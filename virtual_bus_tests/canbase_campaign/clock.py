"""Virtual time: events on a heap, run in the order of their time. Nothing here waits."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Any


@dataclass(frozen=True, slots=True)
class Pace:
    """How finely a world cuts its time [s]: the timers that are no key of robot.yaml, and what varies between runs."""

    watchdog_tick_s: float = 0.005
    """As in canbase_watchdog.loop."""
    drives_poll_s: float = 0.005
    """How often the drives look at their own timers: heartbeats, and heartbeats that are missing."""
    command_parts: float = 4.0
    """The timers of mux and filter are looked at this many times in a period of rates.command_hz."""
    topic_jitter_s: float = 0.0005
    cycle_jitter_s: float = 0.0005
    sdo_delay_s: float = 0.001
    plant_step_s: float = 0.002
    bandwidth_radps: float = 200.0
    """Velocity loop of the drives; times `plant_step_s` at most 0.5."""


FINE = Pace()


def call(do: Callable[..., object], arguments: tuple[Any, ...]) -> None:
    """`do(*arguments)`. Compiled, a star makes a list of them first, and these calls are most of what a world does."""
    count = len(arguments)
    if count == 0:
        do()
    elif count == 1:
        do(arguments[0])
    elif count == 2:
        do(arguments[0], arguments[1])
    else:
        do(*arguments)


class Clock:
    """`now_s` [s] jumps from one event to the next. Of several at one time the one entered first comes first."""

    def __init__(self, now_s: float) -> None:
        self.now_s = now_s
        self._events: list[tuple[float, int, Callable[..., object], tuple[Any, ...]]] = []
        self._entered = 0

    def at(self, when: float, do: Callable[..., object], *arguments: Any) -> None:
        """Call `do(*arguments)` at `when` [s]; a time that is over counts as now."""
        self._entered += 1
        now_s = self.now_s
        heappush(self._events, (when if when > now_s else now_s, self._entered, do, arguments))

    def after(self, delay_s: float, do: Callable[..., object], *arguments: Any) -> None:
        """Call `do(*arguments)` after `delay_s`."""
        self._entered += 1
        now_s = self.now_s
        when = now_s + delay_s
        heappush(self._events, (when if when > now_s else now_s, self._entered, do, arguments))

    def run_until(self, end: float) -> None:
        """Let time pass up to and including `end` [s]."""
        events = self._events
        while events and events[0][0] <= end:
            self.now_s, _, do, arguments = heappop(events)
            call(do, arguments)
        self.now_s = end


class ComputerClock:
    """CLOCK_MONOTONIC of a computer in a world: it does not run while the computer is suspended, and no timer ends.

    `suspended_s`: how long that was in all, as CLOCK_BOOTTIME shows it [s].
    """

    def __init__(self, world: Clock) -> None:
        self._world = world
        self.suspended_s = 0.0
        self._suspended_at = math.inf
        self._timers: list[tuple[float, Callable[..., object], tuple[Any, ...]]] = []

    @property
    def now_s(self) -> float:
        """[s]."""
        return min(self._world.now_s, self._suspended_at) - self.suspended_s

    @property
    def is_suspended(self) -> bool:
        """It does not run."""
        return self._suspended_at < math.inf

    def at(self, when: float, do: Callable[..., object], *arguments: Any) -> None:
        """Call `do(*arguments)` at `when` [s], by this clock."""
        if self.is_suspended:
            self._timers.append((when, do, arguments))
        else:
            self._world.at(when + self.suspended_s, do, *arguments)

    def after(self, delay_s: float, do: Callable[..., object], *arguments: Any) -> None:
        """Call `do(*arguments)` after `delay_s`, by this clock."""
        self.at(self.now_s + delay_s, do, *arguments)

    def suspend(self) -> None:
        """Until `resume`. A computer that is suspended already goes on so."""
        self._suspended_at = min(self._suspended_at, self._world.now_s)

    def resume(self) -> None:
        """It runs again, or goes on running."""
        if not self.is_suspended:
            return
        self.suspended_s += self._world.now_s - self._suspended_at
        self._suspended_at = math.inf
        timers, self._timers = self._timers, []
        for when, do, arguments in timers:
            self.at(when, do, *arguments)
