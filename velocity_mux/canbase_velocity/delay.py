"""How late the messages of one sender arrive, without a clock that it shares with this computer.

Each stamped message has an offset: local receive time minus its stamp. It is the difference of two clocks plus the time
on the way. The least offset stands for the fastest way, and what is above it is delay. Rules:
1. The least offset rises by DRIFT at most: so far clocks drift apart. A delay that stays is a delay for ever, also one
   that grows slowly.
2. A stamp below the one before means that the sender's clock was set back, or that another sender took over: the
   offsets before it are worth nothing. A source of the mux needs a zero command then (neutral.py).
3. After SILENCE_S without any message the sender's clock may have changed: the least offset of FORGET_S of
   messages since then counts, if it is above the one before.
4. With `same_clock` the age of the stamp itself is the delay, and a stamp from the future counts like an old one.
A delay that is there from the first message on, and never less, cannot be seen without `same_clock`. Without stamps
(an unstamped Twist, or a stamp of zero) no delay can be seen at all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

DRIFT = 1e-3
"""Seconds a second: quartz and the slewing of a time service (0.0005) together stay below it."""
SILENCE_S = 60.0
FORGET_S = 60.0
SET_BACK_S = 0.005
"""Stamps of one sender may be out of order by less than this: no clock was set."""


@dataclass(frozen=True, slots=True)
class Sent:
    """The times of one message [s]: its stamp by the sender's clock; when it was taken in by this computer's clock, and
    by the monotonic one."""

    stamp_s: float
    wall_s: float
    now_s: float


class Delay:
    """Of one sender. `set_back`: the last stamp was below the one before."""

    def __init__(self, same_clock: bool = False) -> None:
        self._same_clock = same_clock
        self._least_s = math.inf
        self._stamp_s = -math.inf
        self._at_s = -math.inf
        self._silence_until = -math.inf
        self._least_since_s = math.inf
        self.set_back = False

    def take(self, sent: Sent) -> float:
        """The delay of a message [s]; negative only with `same_clock`, for a stamp from the future."""
        if self._same_clock:
            return sent.wall_s - sent.stamp_s
        self.set_back = sent.stamp_s < self._stamp_s - SET_BACK_S
        if self.set_back:
            self._least_s = self._least_since_s = math.inf
        offset_s = sent.now_s - sent.stamp_s
        self._least_s = min(self._least_s + DRIFT * max(0.0, sent.now_s - self._at_s), offset_s)
        self._look_back(offset_s, sent.now_s)
        self._stamp_s, self._at_s = sent.stamp_s, sent.now_s
        return offset_s - self._least_s

    def _look_back(self, offset_s: float, now_s: float) -> None:
        """Rule 3."""
        if now_s - self._at_s > SILENCE_S:
            self._silence_until, self._least_since_s = now_s, math.inf
        self._least_since_s = min(self._least_since_s, offset_s)
        if now_s - self._silence_until >= FORGET_S:
            self._least_s = max(self._least_s, self._least_since_s)
            self._silence_until = math.inf
