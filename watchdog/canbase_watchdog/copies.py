"""Whether frames of an identifier are sent again: by a gateway, a bridge, a second interface or a defective adapter.

A second master sends at a moment of its own, and other setpoints; it never sends the heartbeat of this watchdog. A copy
has the data of the frame before it, and follows it by the time that it takes to pass it on. That is no proof, and
nothing is decided by it: a stop remains a stop. It orders what a person looks at first.
"""

from __future__ import annotations

import math

COPY_S = 0.002
"""From a frame to its copy at most [s]: one frame of eight bytes takes 1.1 ms at 125 kbit/s (ISO 11898-1)."""


class Copies:
    """The frames of one identifier. `at`: when the last copy came [s, monotonic]; minus infinity: none has."""

    __slots__ = ("_data", "_frame_at", "at")

    def __init__(self) -> None:
        self._data = b""
        self._frame_at = self.at = -math.inf

    def take(self, data: bytes, now_s: float) -> None:
        """One more frame, at the monotonic time `now_s` [s]."""
        if data == self._data and now_s - self._frame_at <= COPY_S:
            self.at = now_s
        self._data, self._frame_at = data, now_s
