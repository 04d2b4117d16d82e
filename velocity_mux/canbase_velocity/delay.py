"""How late the commands of one source arrive, without a clock that sender and mux share.

Each stamped command has an offset: local receive time minus its stamp. It is the difference of two clocks plus the time
on the way. The least offset of the last minute stands for the fastest way, and what is above it is delay. Rules:
1. The least offset is that of the last WINDOWS × WINDOW_S of messages. So a clock that drifts is followed, and a sender
   whose clock was set back while it was silent counts as delayed for one minute of messages at most.
2. A stamp below the one before says that the sender's clock was set back, or that another sender took over: the offsets
   before it are worth nothing. The source needs a zero command then (neutral.py).
3. With `same_clock` the age of the stamp itself is the delay, and a stamp from the future counts like an old one.
A delay that is there from the first message on, and never less, cannot be seen without `same_clock`. Without stamps
(an unstamped Twist, or a stamp of zero) no delay can be seen at all.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

WINDOW_S = 10.0
WINDOWS = 6
SET_BACK_S = 0.005
"""Stamps of one sender may be out of order by less than this: no clock was set."""


@dataclass(frozen=True, slots=True)
class Sent:
    """The times of one message [s]: its stamp by the sender's clock; when it was taken in by this computer's clock, and
    by the monotonic one."""

    stamp_s: float
    wall_s: float
    now: float


class Delay:
    """Of one source. `set_back`: the last stamp was below the one before."""

    def __init__(self, same_clock: bool) -> None:
        self._same_clock = same_clock
        self._least: deque[float] = deque(maxlen=WINDOWS)
        self._window_from = 0.0
        self._stamp_s: float | None = None
        self.set_back = False

    def take(self, sent: Sent) -> float:
        """The delay of a message [s]; negative only with `same_clock`, for a stamp from the future."""
        if self._same_clock:
            return sent.wall_s - sent.stamp_s
        self.set_back = self._stamp_s is not None and sent.stamp_s < self._stamp_s - SET_BACK_S
        self._stamp_s = sent.stamp_s
        if self.set_back:
            self._least.clear()
        offset_s = sent.now - sent.stamp_s
        if not self._least or sent.now - self._window_from >= WINDOW_S:
            self._window_from = sent.now
            self._least.append(offset_s)
        self._least[-1] = min(self._least[-1], offset_s)
        return offset_s - min(self._least)
