"""The last way to stop a motor that takes no setpoints any more: its controlword by SDO, and a look at its speed.

A drive without 6007h that misses a heartbeat leaves NMT operational (CiA 301, 1029h) and may go on turning, deaf to
PDOs. One that brakes by itself then may do so by a faulty sensor, and sends no TPDO that shows it. While the
watchdog lives that is its ladder's task; without it only this is left. Objects: CiA 402-2, 6040h and 606Ch.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from canbase_config.drive import Drive
from canbase_config.object_map import CONTROLWORD, VELOCITY_ACTUAL, place
from canbase_driver.boot.settings import write_at
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import SDO_TO_CLIENT
from canbase_driver.cia301.sdo_client import Read, SdoClient, Write

PERIOD_S, AGAIN_S = 0.02, 0.05
"""Between two requests; and until the same one is sent again: a drive keeps one, and may be busy with another's."""
TRIES = 3
"""Of a controlword. A speed is requested once: a drive that never sends it must not delay the next controlword."""
_UPLOADED, _COMMAND, _EXPEDITED = 2 << 5, 7 << 5, 0x02
"""First byte of an answer to a Read (CiA 301, SDO upload)."""


class SdoStop:
    """Writes the controlwords of one node and reads its speeds in turn. It waits for no answer: one may be lost."""

    def __init__(self, node_id: int, drives: Sequence[Drive]) -> None:
        """`drives`: its axes, in the order of the controlwords."""
        self._node_id, self._drives = node_id, drives
        speeds = [place(drive.kind, VELOCITY_ACTUAL, drive.axis) for drive in drives]
        self._reads = [Read(at.index, at.sub) for at in speeds]
        self._sizes = [at.bits // 8 for at in speeds]
        self._sent_at = -math.inf
        self._turn, self._tries = -1, 0
        self._waits_for = b""
        """Address of the request that is not answered yet."""

    def frames(self, controlwords: Sequence[int], now_s: float) -> list[Frame]:
        """The next request, PERIOD_S after the last one that was answered: 6040h of each axis, once where motors share
        one, then 606Ch of each. A controlword that is not answered is sent again."""
        if now_s - self._sent_at < (AGAIN_S if self._waits_for else PERIOD_S):
            return []
        words = zip(self._drives, controlwords, strict=True)
        writes = dict.fromkeys(write_at(drive, CONTROLWORD, word) for drive, word in words)
        steps: list[Read | Write] = [*writes, *self._reads]
        reads = isinstance(steps[self._turn % len(steps)], Read)
        if not self._waits_for or reads or self._tries >= TRIES:
            self._turn, self._tries = self._turn + 1, 0
        frame = SdoClient(self._node_id, AGAIN_S, attempts=1).start(steps[self._turn % len(steps)], now_s)
        self._sent_at, self._waits_for, self._tries = now_s, frame.data[1:4], self._tries + 1
        return [frame]

    def speed(self, frame: Frame) -> tuple[int, int] | None:
        """Which axis an answer is about, as its place in `drives`, and its 606Ch [raw]. None: it is no speed."""
        data = frame.data
        if frame.cob_id != SDO_TO_CLIENT + self._node_id or len(data) != 8:
            return None
        if data[1:4] == self._waits_for:
            self._waits_for = b""
        if data[0] & _COMMAND != _UPLOADED or not data[0] & _EXPEDITED:
            return None
        address = Read(int.from_bytes(data[1:3], "little"), data[3])
        if address not in self._reads:
            return None
        axis = self._reads.index(address)
        return axis, int.from_bytes(data[4 : 4 + self._sizes[axis]], "little", signed=True)
