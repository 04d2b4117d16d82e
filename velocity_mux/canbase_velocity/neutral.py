"""Neutral start: a source that ordered motion while the base could not move is not followed before it commands zero.

Rules, for each source:
1. At the start of the mux no source is armed. Only an armed source is followed.
2. A zero command arms. One that arrives too late does not: what the source wants now is unknown.
3. With `absent_s` (key neutral_after_s), that long without any message arms too: a program that begins with a velocity.
   What this process did not watch, because it stood still itself, is no absence. Nor is there an absence while the last
   command is still fresh: it would be followed, although its sender may have ended before the stop.
4. Whose last command orders motion while the base is not ready is armed no more, however old that command is. A radio
   gap across a reset changes nothing.
5. A source that publishes nothing while the base is not ready is disarmed too, unless absence may arm it (rule 3): its
   last zero is old, and the operator may have moved the joystick since.
6. A pause counts like 4 and 5 for whom only a zero arms: a lock held him back, or there was no usable scan for
   WITHOUT_SCANS_S. People walk up to a base that is at standstill. A program with `absent_s` goes on after a pause:
   docs/decisions/0029.
"""

from __future__ import annotations

import math

from canbase_velocity.twist import Twist

BLIND_S = 0.2
"""The mux decides at 20 Hz at least. After a longer pause it has missed messages, and every absence starts again."""
STARTED = "velocity_mux started"


class Arming:
    """Whether one source may be followed. `waits_since`: what disarmed it, for people; empty while it is armed."""

    def __init__(self, absent_s: float | None) -> None:
        """`absent_s`: time without a message that arms [s]; None: a zero command alone does."""
        self._absent_s = absent_s
        self._absent_from = math.inf
        self._moves = False
        self.waits_since = STARTED

    @property
    def armed(self) -> bool:
        """It may be followed."""
        return not self.waits_since

    def command(self, twist: Twist, now_s: float, *, on_time: bool) -> None:
        """A command arrived at `now_s` [s, monotonic]."""
        self._absent_from = now_s
        self._moves = not twist.is_zero
        if twist.is_zero and on_time:
            self.waits_since = ""

    def disarm(self, why: str) -> None:
        """It needs a zero again. The first reason is kept."""
        self.waits_since = self.waits_since or why

    def advance(self, not_ready: str, now_s: float, *, silent: bool, paused: str = "") -> None:
        """Time has passed. `not_ready`: why the base cannot move; empty: it can. `silent`: it is not fresh.

        `paused`: why this source is not followed although the base is ready; empty: it is.
        """
        needs_zero = self._absent_s is None
        stopped = not_ready or (paused if needs_zero else "")
        if stopped and (self._moves or (silent and needs_zero)):
            self.disarm(stopped)
        if silent and self._absent_s is not None and now_s - self._absent_from >= self._absent_s:
            self.waits_since, self._moves = "", False

    def missed(self, now_s: float) -> None:
        """Until `now_s` nothing was watched: absence counts from here."""
        self._absent_from = now_s

    @property
    def reason(self) -> str:
        """For people, while it is not armed."""
        silence = f" or {self._absent_s:.1f} s of silence" if self._absent_s is not None else ""
        return f"waiting for zero{silence} ({self.waits_since})"
