"""Sends NMT commands, and listens to what the nodes report afterwards (CiA 301, NMT). No bus in here."""

from __future__ import annotations

import math
from collections.abc import Sequence

from canbase_commissioning.bus_monitor import Listener
from canbase_driver.cia301.frame import Frame


class NmtSession:
    """Sends `frames`, then listens for `listen_s` [s]. `heard` has what came, from before the first frame on."""

    def __init__(self, frames: Sequence[Frame], heard: Listener, listen_s: float = 0.0) -> None:
        self.heard = heard
        self._frames, self._listen_s = list(frames), listen_s
        self._until_s = math.inf

    @property
    def done(self) -> bool:
        """Whether the time is over."""
        return self._until_s <= 0.0

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """Take a frame."""
        self.heard.on_frame(frame, now_s)

    def tick(self, now_s: float) -> list[Frame]:
        """All frames at once, with the first call."""
        if self._frames:
            frames, self._frames = self._frames, []
            self._until_s = now_s + self._listen_s
            return frames
        if now_s >= self._until_s:
            self._until_s = 0.0
        return []
