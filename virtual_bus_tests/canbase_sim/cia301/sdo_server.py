"""SDO server: that of the package canopen over our dictionary; block transfers are in `sdo_block.py` (CiA 301, SDO)."""

from __future__ import annotations

from collections.abc import Callable

from canopen import SdoAbortedError
from canopen.sdo.server import SdoServer

from canbase_sim.cia301.dictionary import Dictionary
from canbase_sim.cia301.sdo_block import BlockDownload, BlockUpload
from canbase_sim.frame import Frame

REQUEST = 0x600
"""COB-ID of requests: 600h + node id."""
RESPONSE = 0x580
"""COB-ID of answers: 580h + node id."""
ABORT = 0x80
"""Command byte of an abort."""


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
        self.block: BlockUpload | BlockDownload | None = None
        """The block transfer under way."""
        self._has_blocks = dictionary.personality.block_transfers
        self.reset()

    def renumber(self, node_id: int) -> None:
        """The channel of another node id."""
        self.rx_cobid, self.tx_cobid = REQUEST + node_id, RESPONSE + node_id

    def reset(self) -> None:
        """Forget a transfer that is under way."""
        self._index, self._subindex, self._buffer, self._toggle = 0, 0, bytearray(), 0
        self.block = None

    def receive(self, data: bytes) -> None:
        """One request. An SDO frame has eight bytes (CiA 301); any other is dropped and counted in `malformed`."""
        if len(data) != 8:
            self.malformed += 1
            return
        if self.block is None or data[0] == ABORT:
            self.block = None
            self.on_request(self.rx_cobid, bytearray(data), 0.0)
        else:
            self._go_on(self.block, data)

    def block_upload(self, data: bytearray) -> None:
        """Begins a block upload; an object that is short enough for the client is sent by an ordinary one."""
        if not self._has_blocks:
            self.block_download(data)
            return
        index, subindex = self._address(data)
        content = self._node.get_data(index, subindex, check_readable=True)
        if len(content) <= data[5]:
            self.init_upload(data)
        else:
            self.block = BlockUpload(bytes(data), content, self._reply)

    def block_download(self, data: bytearray) -> None:
        """Begins a block download."""
        index, subindex = self._address(data)
        if not self._has_blocks:
            super().block_download(data)
            return

        def store(content: bytes) -> None:
            self._node.set_data(index, subindex, content, check_writable=True)

        self.block = BlockDownload(bytes(data), store, self._reply)

    def _address(self, data: bytearray) -> tuple[int, int]:
        """Of the object, remembered for an abort."""
        self._index, self._subindex = int.from_bytes(data[1:3], "little"), data[3]
        return self._index, self._subindex

    def _go_on(self, block: BlockUpload | BlockDownload, data: bytes) -> None:
        try:
            block.receive(data)
        except SdoAbortedError as refusal:
            self.block = None
            self.abort(refusal.code)
        if block.is_done:
            self.block = None

    def _reply(self, data: bytes) -> None:
        self.send_response(bytearray(data))
