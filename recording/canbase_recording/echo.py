"""Frames that a recording has twice, as sent and as received: on a bus where each sender hears itself. Pure."""

from __future__ import annotations

import itertools
import math
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
HEAD_S: Final = 1.0
"""Entries of this time [s] wait for the first heartbeat: only then is it known what the frames before it were."""
MOST_WAITING: Final = 20_000


class EchoFilter:
    """Takes each received copy of a sent frame away, one copy of each. `echoes`: how many."""

    def __init__(self) -> None:
        self.echoes = 0
        self._hears_itself = False
        self._sent: dict[tuple[int, bytes], deque[float]] = {}

    def without(self, entries: Iterable[Entry]) -> Iterator[Entry]:
        """The same entries without the echoes."""
        following = iter(entries)
        head = list(self._head(following))
        for entry in itertools.chain(head, following):
            if not isinstance(entry, RecordedFrame) or not self._is_echo(entry):
                yield entry

    def _head(self, entries: Iterator[Entry]) -> Iterator[Entry]:
        """The first entries, until the driver has received its own heartbeat."""
        first_s, sent_s = math.nan, -math.inf
        for entry in itertools.islice(entries, MOST_WAITING):
            yield entry
            first_s = entry.at_s if math.isnan(first_s) else first_s
            if isinstance(entry, RecordedFrame) and entry.cob_id == OWN_HEARTBEAT:
                self._hears_itself = not entry.sent and entry.at_s - sent_s <= ECHO_S
                sent_s = entry.at_s if entry.sent else sent_s
            if self._hears_itself or entry.at_s - first_s > HEAD_S:
                return

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
