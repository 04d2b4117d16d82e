"""Further SDO servers of a node: 1201h to 127Fh, as many as its dictionary has (CiA 301, SDO server parameter)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from canopen import SdoAbortedError

from canbase_sim.cia301 import abort
from canbase_sim.cia301.dictionary import Dictionary, key
from canbase_sim.cia301.sdo_server import SdoService
from canbase_sim.frame import Frame

CHANNELS = range(0x1201, 0x1280)
NOT_VALID = 1 << 31
"""Bit 31 of either COB-ID: there is no such channel."""
REQUESTS, ANSWERS = 1, 2
"""Sub-indexes with the COB-IDs from client to server and from server to client."""
COB_ID = 0x7FF
UNCHANGED = 0x3FFF_FFFF
"""Bits that may be changed only while bit 31 is set."""


class SdoChannels:
    """They answer while both COB-IDs of a channel are valid. An open one takes any identifier, as real drives do."""

    def __init__(self, dictionary: Dictionary, send: Callable[[Frame], None], changed: Callable[[], None]) -> None:
        """`changed`: called when a channel was opened, closed or moved."""
        self._values = dictionary.values
        self._servers: dict[int, SdoService] = {}
        for index in CHANNELS:
            if key(index, REQUESTS) in dictionary.entries:
                self._servers[index] = SdoService(0, dictionary, send)
                dictionary.guard(index, partial(self._check, index))
                dictionary.on_write(index, lambda _sub, _value: changed())

    def routes(self) -> dict[int, Callable[[bytes, float], None]]:
        """What receives which COB-ID."""
        opened = [index for index in self._servers if self._is_open(index)]
        return {self._values[key(index, REQUESTS)] & COB_ID: self._open(index) for index in opened}

    def reset(self) -> None:
        """Forget the transfers that are under way."""
        for server in self._servers.values():
            server.reset()

    def _is_open(self, index: int) -> bool:
        return not any(self._values[key(index, sub)] & NOT_VALID for sub in (REQUESTS, ANSWERS))

    def _open(self, index: int) -> Callable[[bytes, float], None]:
        server = self._servers[index]
        server.rx_cobid = self._values[key(index, REQUESTS)] & COB_ID
        server.tx_cobid = self._values[key(index, ANSWERS)] & COB_ID
        return lambda data, _now_s: server.receive(data)

    def _check(self, index: int, sub: int, value: int) -> None:
        before = self._values[key(index, sub)]
        if not (before | value) & NOT_VALID and (before ^ value) & UNCHANGED:
            raise SdoAbortedError(abort.INVALID_VALUE)
