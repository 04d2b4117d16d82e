"""EMCY producer with 1001h error register, 1003h history and 1014h COB-ID (CiA 301, EMCY and these objects)."""

from __future__ import annotations

import struct
from collections.abc import Callable

from canopen import SdoAbortedError

from canbase_sim.cia301 import abort
from canbase_sim.cia301.dictionary import Dictionary, key
from canbase_sim.frame import Frame

NO_ERROR = 0x0000
HEARTBEAT_LOST = 0x8130
BUS_OFF_RECOVERED = 0x8140
PDO_TOO_SHORT = 0x8210
PDO_TOO_LONG = 0x8220
SYNC_LENGTH = 0x8240
RPDO_TIMEOUT = 0x8250

GENERIC_BIT = 0x01
COMMUNICATION_BIT = 0x10
REGISTER_BIT_OF_CLASS = {0x2: 0x02, 0x3: 0x04, 0x4: 0x08, 0x8: COMMUNICATION_BIT}
"""Bit of 1001h by the first hex digit of the error code: current, voltage, temperature, communication."""
HISTORY = 8
"""Entries of 1003h."""
NOT_VALID = 1 << 31
"""Bit 31 of 1014h: no EMCY is sent."""


class EmcyService:
    """Active errors of one node. An error is sent once when it comes, and once, with code 0000h, when it goes."""

    def __init__(self, dictionary: Dictionary, send: Callable[[Frame], None]) -> None:
        self._values = dictionary.values
        self._send = send
        self._active: dict[tuple[int, int], None] = {}
        dictionary.guard(0x1003, _only_clearing)
        dictionary.on_write(0x1003, lambda subindex, value: self._clear_history())

    def raise_error(self, code: int, source: int = 0) -> None:
        """`code` holds from now on; `source` distinguishes errors of one code (node id, PDO number, axis)."""
        if (code, source) in self._active:
            return
        self._active[code, source] = None
        self._push(code | source << 16)
        self._tell(code, source)

    def clear_error(self, code: int, source: int = 0) -> None:
        """`code` holds no longer."""
        if self._active and self._active.pop((code, source), self) is None:
            self._tell(NO_ERROR, source)

    def reset(self) -> None:
        """After a reset there is no error, and nothing is sent."""
        self._active.clear()
        self._values[key(0x1001)] = 0

    def _tell(self, code: int, source: int) -> None:
        register = 0
        for active, _ in self._active:
            register |= GENERIC_BIT | REGISTER_BIT_OF_CLASS.get(active >> 12, 0)
        self._values[key(0x1001)] = register
        cob_id = self._values[key(0x1014)]
        if not cob_id & NOT_VALID:
            self._send(Frame(cob_id & 0x7FF, struct.pack("<HBB4x", code, register, source)))

    def _push(self, error: int) -> None:
        count = min(self._values[key(0x1003)] + 1, HISTORY)
        for subindex in range(count, 1, -1):
            self._values[key(0x1003, subindex)] = self._values[key(0x1003, subindex - 1)]
        self._values[key(0x1003, 1)] = error
        self._values[key(0x1003)] = count

    def _clear_history(self) -> None:
        for subindex in range(HISTORY + 1):
            self._values[key(0x1003, subindex)] = 0


def _only_clearing(subindex: int, value: int) -> None:
    """1003h:0 takes 0 alone (CiA 301, object 1003h)."""
    if value != 0:
        raise SdoAbortedError(abort.INVALID_VALUE)
