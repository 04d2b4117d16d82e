"""How late the messages of one sender arrive.

Rules:
1. With `same_clock` the age of the stamp is the delay. Nothing is learned from the messages, so no delay is forgotten:
   neither one that is there from the first message on, nor one that grows slowly, nor over a restart. It ends when the
   stamps are recent again. A stamp from the future is as bad as an old one.
2. A sender with another clock: each message has an offset, local receive time minus its stamp. The least one ever
   stands for the fastest way, and what is above it is delay. Neither messages nor time raise the least one: a clock
   that drifts or is slewed back looks like a delay, and counts as one. A delay from the first message on is not seen:
   how old its messages are is unknown (`canbase_config.stop_checks` says so at the start).
3. A stamp below the one before: another message has overtaken this one, the sender's clock was set back, or another
   sender took over. A source of the mux needs a zero command then (neutral.py).
Without stamps (an unstamped Twist, or a stamp of zero) no delay can be seen at all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

SET_BACK_S: Final = 0.005
"""Stamps of one sender may be out of order by less than this: no clock was set."""
FUTURE_S: Final = 0.1
"""So far a stamp may be ahead of this computer's clock: what a time service leaves between two computers."""


@dataclass(frozen=True, slots=True)
class Sent:
    """The times of one message [s]: its stamp by the sender's clock; when it was taken in by this computer's clock, and
    by the monotonic one."""

    stamp_s: float
    wall_s: float
    now_s: float


class Delay:
    """Of one sender. `set_back`: the last stamp was below the one before."""

    def __init__(self, same_clock: bool) -> None:
        self._same_clock = same_clock
        self._least_s = math.inf
        self._stamp_s = -math.inf
        self.set_back = False

    def measure(self, sent: Sent) -> float:
        """The delay of a message [s]; negative only with `same_clock`, for a stamp from the future."""
        self.set_back = sent.stamp_s < self._stamp_s - SET_BACK_S
        self._stamp_s = sent.stamp_s
        if self._same_clock:
            return sent.wall_s - sent.stamp_s
        offset_s = sent.now_s - sent.stamp_s
        self._least_s = min(self._least_s, offset_s)
        return offset_s - self._least_s

    def why_late(self, delay_s: float, limit_s: float) -> str:
        """Why a message with this delay does not count, for people; empty: it does."""
        clock = f"same_clock {str(self._same_clock).lower()}"
        if delay_s > limit_s:
            return f"delayed by {delay_s:.2f} s (limit {limit_s:.2f} s, {clock})"
        return f"stamped in the future by {-delay_s:.2f} s ({clock})" if delay_s < -FUTURE_S else ""
