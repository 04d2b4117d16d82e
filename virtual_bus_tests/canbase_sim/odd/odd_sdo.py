"""The SDO server of an odd drive: refusals with any abort code, and every form of answer that CiA 301 has (SDO)."""

from __future__ import annotations

import struct
from collections.abc import Callable

from canbase_sim.cia301.dictionary import Dictionary, key
from canbase_sim.cia301.sdo_server import SdoService
from canbase_sim.frame import Frame
from canbase_sim.odd.manner import Manner

DOWNLOAD, UPLOAD, SEGMENT = 1, 2, 3
"""Client command specifiers: initiate download, initiate upload, upload segment."""
EXPEDITED = 0x02
DEVICE_STATE = 0x0800_0022


class OddSdoService(SdoService):
    """It looks at each request before the ordinary server does, and at each answer after it."""

    def __init__(self, node_id: int, dictionary: Dictionary, send: Callable[[Frame], None], manner: Manner) -> None:
        super().__init__(node_id, dictionary, lambda frame: self._answer(frame))
        self._manner, self._really_send = manner, send
        self._segment = b""
        self._refused: set[int] = set()

    def receive(self, data: bytes) -> None:
        """One request."""
        if len(data) == 8 and data[0] >> 5 == SEGMENT and self._segment:
            return self._send_segment(data)
        self._segment = b""
        if len(data) != 8 or not (code := self._refusal(data)):
            return super().receive(self._taken(data))
        return self._say(b"\x80" + data[1:4] + code.to_bytes(4, "little"))

    def _refusal(self, data: bytes) -> int:
        """Abort code; 0: none."""
        manner, entry = self._manner, _entry(data)
        if data[0] >> 5 == UPLOAD:
            return manner.refused_reads.get(entry, 0)
        if data[0] >> 5 != DOWNLOAD:
            return 0
        if manner.refuses_first and entry not in self._refused:
            self._refused.add(entry)
            return DEVICE_STATE
        bounds = manner.bounds.get(entry)
        if bounds is not None and bounds.code and bounds.nearest(_value(data)) != _value(data):
            return bounds.code
        return manner.refused_writes.get(entry, 0)

    def _taken(self, data: bytes) -> bytes:
        """The request with the value that it takes in place of the wanted one."""
        bounds = self._manner.bounds.get(_entry(data)) if len(data) == 8 and data[0] >> 5 == DOWNLOAD else None
        if bounds is None:
            return data
        return data[:4] + bounds.nearest(_value(data)).to_bytes(4, "little")

    def _answer(self, frame: Frame) -> None:
        """Of the ordinary server."""
        data = frame.data
        if data[0] >> 5 != UPLOAD or not data[0] & EXPEDITED:
            self._say(data)
        elif not self._manner.answers_expedited:
            self._segment = data[4 : 8 - (data[0] >> 2 & 3)]
            self._say(b"\x41" + data[1:4] + struct.pack("<I", len(self._segment)))
        else:
            self._say(data if self._manner.answers_sized else b"\x42" + data[1:])

    def _send_segment(self, data: bytes) -> None:
        part, self._segment = self._segment, b""
        self._say(bytes(((data[0] & 0x10) | (7 - len(part)) << 1 | 1,)) + part.ljust(7, b"\0"))

    def _say(self, data: bytes) -> None:
        self._really_send(Frame(self.tx_cobid, data))


def _entry(data: bytes) -> int:
    return key(int.from_bytes(data[1:3], "little"), data[3])


def _value(data: bytes) -> int:
    """Of an expedited download."""
    return int.from_bytes(data[4 : 8 - (data[0] >> 2 & 3)], "little")
