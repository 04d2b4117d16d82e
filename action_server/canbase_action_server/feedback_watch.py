"""Whether the feedback of a goal is missing: its server then hangs, has ended, or cannot be reached. Pure.

Every open goal has feedback: a goal that runs at `action.feedback_hz`, one that waits once a second. Only time counts
in which somebody looked: what arrived while this process was suspended, or waited for nothing, is not read yet.
"""

from __future__ import annotations

from typing import Final

FEEDBACK_TIMEOUT_S: Final = 3.0
"""Three periods of the slowest feedback of canbase's action server (1 Hz)."""
MAX_TIMEOUT_S: Final = 3600.0
PAUSE_S: Final = 1.0
"""Between two looks of a client that spins there are 0.1 s. After a longer gap it counts anew."""


class FeedbackWatch:
    """Of one goal. `now_s`: time.monotonic() of the client."""

    def __init__(self, timeout_s: float) -> None:
        """ValueError for a timeout that would be none."""
        if not 0.0 < timeout_s <= MAX_TIMEOUT_S:
            raise ValueError(f"the feedback timeout is {timeout_s} s; expected more than 0 and up to {MAX_TIMEOUT_S} s")
        self.timeout_s = timeout_s
        self._received_s = 0.0
        self._looked_s: float | None = None

    def begin(self, now_s: float) -> None:
        """The client waits from now on."""
        self._received_s = self._looked_s = now_s

    def received(self, now_s: float) -> None:
        """Feedback was read."""
        self._received_s = now_s

    def missing(self, now_s: float) -> bool:
        """No feedback for longer than the timeout."""
        if self._looked_s is None or now_s - self._looked_s > PAUSE_S:
            self.begin(now_s)
        self._looked_s = now_s
        return now_s - self._received_s > self.timeout_s
