"""Frames that a recording has twice, as sent and as received: on a bus where each sender hears itself. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from typing import Final

from canbase_config.robot import DRIVER_NODE_ID
from canbase_driver.cia301.nmt import HEARTBEAT
from canbase_recording.entry import Entry, RecordedFrame

OWN_HEARTBEAT: Final = HEARTBEAT + DRIVER_NODE_ID
"""The driver alone sends it. If it comes back, the bus echoes; if not, an equal frame is somebody else's."""
ECHO_S: Final = 0.1
"""An echo comes within this time [s]; what comes later was sent by somebody else."""


class EchoFilter:
    """Takes each received copy of a sent frame away, one copy of each. `echoes`: how many."""

    def __init__(self) -> None:
        self.echoes = 0
        self._hears_itself = False
        self._sent: dict[tuple[int, bytes], deque[float]] = {}

    def without(self, entries: Iterable[Entry]) -> Iterator[Entry]:
        """The same entries without the echoes."""
        for entry in entries:
            if not isinstance(entry, RecordedFrame) or not self._is_echo(entry):
                yield entry

    def _is_echo(self, frame: RecordedFrame) -> bool:
        key = (frame.cob_id, frame.data)
        if frame.sent:
            self._sent.setdefault(key, deque(maxlen=8)).append(frame.at_s)
            if len(self._sent) > MOST_KEYS:
                self._forget(frame.at_s)
            return False
        if not self._hears_itself and frame.cob_id != OWN_HEARTBEAT:
            return False
        times = self._sent.get(key)
        while times and times[0] < frame.at_s - ECHO_S:
            times.popleft()
        if not times:
            return False
        times.popleft()
        self._hears_itself = True
        self.echoes += 1
        return True

    def _forget(self, now_s: float) -> None:
        self._sent = {key: times for key, times in self._sent.items() if times and times[-1] >= now_s - ECHO_S}


MOST_KEYS: Final = 4_000
