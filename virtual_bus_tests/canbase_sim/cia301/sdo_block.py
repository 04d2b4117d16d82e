"""SDO block upload and download of a simulated drive, with CRC (CiA 301, SDO block protocols).

`sdo_server.py` hands the frames over while a block transfer is under way.
"""

from __future__ import annotations

from collections.abc import Callable

from canopen import SdoAbortedError

from canbase_sim.cia301 import abort

SEGMENT = 7
"""Bytes in a segment."""
MOST_SEGMENTS = 127
"""In a block."""
MOST_BYTES = 65_536
"""Of one object."""
CRC_POLYNOMIAL = 0x1021

Reply = Callable[[bytes], None]


def checksum(data: bytes) -> int:
    """CRC of CiA 301: polynomial x^16 + x^12 + x^5 + 1, begun with 0, bit by bit as the standard has it."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ CRC_POLYNOMIAL if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


class BlockUpload:
    """Sends one object. `request`: the eight bytes that began it. Raises SdoAbortedError to abort."""

    def __init__(self, request: bytes, data: bytes, reply: Reply) -> None:
        self.is_done = False
        self.lose: set[int] = set()
        """For tests: these segments of the next block are lost on the bus."""
        self._data, self._reply = data, reply
        self._position = self._sent = 0
        self._started = self._ending = False
        self._segments = _block_size(request[4])
        size = len(data).to_bytes(4, "little")
        reply(bytes((0xC6,)) + request[1:4] + size)

    def receive(self, data: bytes) -> None:
        """The client's next frame."""
        command = data[0]
        if command == 0xA3 and not self._started:
            self._started = True
            self._send_block()
        elif command == 0xA2 and self._started and not self._ending:
            self._confirmed(data[1], _block_size(data[2]))
        elif command == 0xA1 and self._ending:
            self.is_done = True
        else:
            raise SdoAbortedError(abort.COMMAND)

    def _confirmed(self, sequence: int, segments: int) -> None:
        if sequence > self._sent:
            raise SdoAbortedError(abort.SEQUENCE)
        self._position += sequence * SEGMENT
        self._segments = segments
        if self._position < len(self._data):
            self._send_block()
            return
        self._ending = True
        unused = self._position - len(self._data)
        self._reply(bytes((0xC1 | unused << 2,)) + checksum(self._data).to_bytes(2, "little") + bytes(5))

    def _send_block(self) -> None:
        lost, self.lose = self.lose, set()
        self._sent = 0
        while self._sent < self._segments:
            begin = self._position + self._sent * SEGMENT
            part = self._data[begin : begin + SEGMENT]
            self._sent += 1
            is_last = begin + SEGMENT >= len(self._data)
            if self._sent not in lost:
                self._reply(bytes((self._sent | (0x80 if is_last else 0),)) + part.ljust(SEGMENT, b"\0"))
            if is_last:
                return


class BlockDownload:
    """Takes one object, and hands it to `store` when its CRC is right."""

    def __init__(self, request: bytes, store: Callable[[bytes], None], reply: Reply, segments: int = 32) -> None:
        """`segments`: of each block."""
        self.is_done = False
        self._store, self._reply, self._segments = store, reply, segments
        self._announced = int.from_bytes(request[4:], "little") if request[0] & 0x02 else None
        self._has_crc = bool(request[0] & 0x04)
        self._buffer = bytearray()
        self._sequence = 0
        self._is_whole = False
        if (self._announced or 0) > MOST_BYTES:
            raise SdoAbortedError(abort.MEMORY)
        reply(bytes((0xA4,)) + request[1:4] + bytes((segments, 0, 0, 0)))

    def receive(self, data: bytes) -> None:
        """The client's next frame."""
        if self._is_whole:
            self._end(data)
            return
        sequence = data[0] & 0x7F
        if not 1 <= sequence <= self._segments:
            raise SdoAbortedError(abort.SEQUENCE)
        if sequence == self._sequence + 1:
            self._sequence, self._is_whole = sequence, bool(data[0] & 0x80)
            self._buffer += data[1:]
        if len(self._buffer) > MOST_BYTES + SEGMENT:
            raise SdoAbortedError(abort.MEMORY)
        if sequence == self._segments or data[0] & 0x80:
            last, self._sequence = self._sequence, 0
            self._reply(bytes((0xA2, last, self._segments, 0, 0, 0, 0, 0)))

    def _end(self, data: bytes) -> None:
        if data[0] & 0xE3 != 0xC1:
            raise SdoAbortedError(abort.COMMAND)
        whole = bytes(self._buffer[: len(self._buffer) - (data[0] >> 2 & 0x07)])
        if self._announced not in (None, len(whole)):
            raise SdoAbortedError(abort.LENGTH)
        if self._has_crc and checksum(whole) != int.from_bytes(data[1:3], "little"):
            raise SdoAbortedError(abort.CRC)
        self._store(whole)
        self._reply(bytes((0xA1,)) + bytes(7))
        self.is_done = True


def _block_size(segments: int) -> int:
    if not 1 <= segments <= MOST_SEGMENTS:
        raise SdoAbortedError(abort.BLOCK_SIZE)
    return segments
