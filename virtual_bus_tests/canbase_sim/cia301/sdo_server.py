"""SDO server: that of the package canopen, expedited and segmented, over our dictionary (CiA 301, SDO)."""

from __future__ import annotations

from collections.abc import Callable

from canopen.sdo.server import SdoServer

from canbase_sim.cia301.dictionary import Dictionary
from canbase_sim.frame import Frame

REQUEST = 0x600
"""COB-ID of requests: 600h + node id."""
RESPONSE = 0x580
"""COB-ID of answers: 580h + node id."""


class _Store:
    """What canopen's SdoServer needs of a node."""

    def __init__(self, dictionary: Dictionary) -> None:
        self.object_dictionary = dictionary
        self.get_data = dictionary.get_data

    def set_data(self, index: int, subindex: int, data: bytes | bytearray, check_writable: bool = False) -> None:
        self.object_dictionary.set_data(index, subindex, bytes(data), check_writable)


class _Wire:
    """What canopen's SdoServer needs of a network."""

    def __init__(self, send: Callable[[Frame], None]) -> None:
        self._send = send

    def send_message(self, cob_id: int, data: bytes | bytearray) -> None:
        self._send(Frame(cob_id, bytes(data)))


class SdoService(SdoServer):
    """Answers the default SDO channel of one node."""

    def __init__(self, node_id: int, dictionary: Dictionary, send: Callable[[Frame], None]) -> None:
        super().__init__(REQUEST + node_id, RESPONSE + node_id, _Store(dictionary))
        self.network = _Wire(send)  # type: ignore[assignment]
        self.malformed = 0
        self.reset()

    def reset(self) -> None:
        """Forget a transfer that is under way."""
        self._index, self._subindex, self._buffer, self._toggle = 0, 0, bytearray(), 0

    def receive(self, data: bytes) -> None:
        """One request. An SDO frame has eight bytes (CiA 301); any other is dropped and counted in `malformed`."""
        if len(data) != 8:
            self.malformed += 1
            return
        self.on_request(self.rx_cobid, bytearray(data), 0.0)
