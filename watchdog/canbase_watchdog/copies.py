"""Whether frames are sent again: by a gateway, a bridge, a second interface or a defective adapter.

A copy has the data of the frame before it, and follows it by the time that it takes to pass it on. What copies SYNCs
copies setpoints and the own heartbeats of this watchdog as well, as often; another master sends its SYNCs at a moment
of its own, other setpoints or none, and never an own heartbeat of this watchdog. That is no proof, and nothing is
decided by it: a stop remains a stop. It orders what a person looks at first.
"""

from __future__ import annotations

import math

COPY_S = 0.002
"""From a frame to its copy at most [s]: one frame of eight bytes takes 1.1 ms at 125 kbit/s (ISO 11898-1)."""
WITHIN_S = 10.0
"""Copies of SYNCs that are further apart begin a count of their own [s]."""
EXPECTED = 3.0
"""So many copies that were to come and did not, by the share of the SYNCs, are no chance (1 in 20)."""


class Copies:
    """The frames of one identifier. `at`: when the last copy came [s, monotonic]; minus infinity: none has."""

    __slots__ = ("_data", "_frame_at", "at")

    def __init__(self) -> None:
        self._data = b""
        self._frame_at = self.at = -math.inf

    def note_frame(self, data: bytes, now_s: float) -> bool:
        """One more frame, at the monotonic time `now_s` [s]. Whether it is a copy."""
        is_copy = data == self._data and now_s - self._frame_at <= COPY_S
        if is_copy:
            self.at, self._frame_at = now_s, -math.inf  # a third one is no copy of a copy
        else:
            self._data, self._frame_at = data, now_s
        return is_copy


class _Share:
    """How many frames of one sort came since the SYNCs have copies, and how many copies among them."""

    __slots__ = ("copies", "frames")

    def __init__(self) -> None:
        self.frames = self.copies = 0

    def count(self, is_copy: bool) -> None:
        self.copies += is_copy
        self.frames += not is_copy


class SentAgain:
    """The copies of SYNCs, of setpoints and of this watchdog's own heartbeats, counted since the SYNCs have some."""

    def __init__(self, *, loopback: bool) -> None:
        """`loopback`: the frames of this watchdog come back to it, and their copies with them."""
        self._loopback = loopback
        self._sync, self._own = Copies(), Copies()
        self._setpoints: dict[int, Copies] = {}
        self._begin()

    def _begin(self) -> None:
        self._of_syncs, self._of_setpoints, self._of_own = _Share(), _Share(), _Share()

    def on_sync(self, now_s: float) -> None:
        """A SYNC, at the monotonic time `now_s` [s]."""
        copied_at = self._sync.at
        is_copy = self._sync.note_frame(b"", now_s)
        if is_copy and now_s - copied_at > WITHIN_S:
            self._begin()
            self._of_syncs.frames = 1
        self._of_syncs.count(is_copy)

    def on_setpoint(self, cob_id: int, data: bytes, now_s: float) -> None:
        """A setpoint of one axis."""
        copies = self._setpoints.get(cob_id)
        if copies is None:
            copies = self._setpoints[cob_id] = Copies()
        self._of_setpoints.count(copies.note_frame(data, now_s))

    def on_own(self, now_s: float) -> None:
        """A heartbeat 77Eh of this watchdog's node."""
        self._of_own.count(self._own.note_frame(b"", now_s))

    def is_likely(self, now_s: float) -> bool:
        """SYNCs have copies now, and nothing else lacks the copies that it would have."""
        if now_s - self._sync.at > WITHIN_S:
            return False
        share = self._of_syncs.copies / self._of_syncs.frames
        others = (self._of_setpoints, self._of_own) if self._loopback else (self._of_setpoints,)
        return all(other.copies > 0 or share * other.frames < EXPECTED for other in others)
