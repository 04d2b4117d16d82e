"""The last way to stop a motor that takes no setpoints any more: its controlword by SDO. Source: CiA 402-2, 6040h.

A drive without 6007h that misses a heartbeat leaves NMT operational (CiA 301, 1029h) and may go on turning, deaf to
PDOs. While the watchdog lives that is its ladder's business; without it nobody else is left.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from canbase_config.drive import Drive
from canbase_config.places import CONTROLWORD
from canbase_driver.boot_settings import write_at
from canbase_driver.frame import Frame
from canbase_driver.sdo import SdoClient

PERIOD_S = 0.05
"""Between two writes: a drive answers within this, and the answer may be lost."""


class SdoStop:
    """Writes the controlwords of one node again and again. Nobody waits for the answers: the wheels tell."""

    def __init__(self, node_id: int, drives: Sequence[Drive]) -> None:
        """`drives`: its axes, in the order of the controlwords."""
        self._node_id, self._drives = node_id, drives
        self._sent_at = -math.inf

    def frames(self, controlwords: Sequence[int], now: float) -> list[Frame]:
        """6040h of each axis, once each PERIOD_S; motors that share one have it written once."""
        if now - self._sent_at < PERIOD_S:
            return []
        self._sent_at = now
        words = zip(self._drives, controlwords, strict=True)
        writes = dict.fromkeys(write_at(drive, CONTROLWORD, word) for drive, word in words)
        return [SdoClient(self._node_id, PERIOD_S, attempts=1).start(write, now) for write in writes]
