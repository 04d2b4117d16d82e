"""SDO block transfers (CiA 301, SDO block upload and download) in both directions, with CRC. No bus in here.

For the tools: the driver needs no long object. A drive that refuses or garbles a block transfer gets an ordinary one.
"""

from __future__ import annotations

import binascii
import struct
from dataclasses import dataclass
from typing import Final

from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import SDO_TO_CLIENT
from canbase_driver.cia301.sdo_client import (
    ACCESS_UNSUPPORTED,
    BLOCK_SIZE_INVALID,
    COMMAND_UNKNOWN,
    CRC_ERROR,
    GENERAL_ERROR,
    LENGTH_WRONG,
    OUT_OF_MEMORY,
    SEQUENCE_INVALID,
    TIMED_OUT,
    Read,
    SdoAborted,
    SdoClient,
    Transfer,
    Write,
    address,
)

MAX_BLOCK_BYTES: Final = 65_536
"""An object that is longer is not read by block transfer any further."""
BLOCK_SEGMENTS: Final = 127
"""Segments between two confirmations, the most that CiA 301 allows."""
SWITCH_BYTES: Final = 28
"""The drive may answer by an ordinary upload where the object has at most so many bytes."""
SEGMENTS_PER_TICK: Final = 2
"""A transmit queue takes few frames at once, and a slow bus one each millisecond."""
MAX_REPEATS: Final = 3
"""Confirmations in a row without one new segment."""
SEGMENT_BYTES: Final = 7
_ABORT: Final = 0x80
_ABOUT_BLOCKS: Final = frozenset(
    {COMMAND_UNKNOWN, GENERAL_ERROR, ACCESS_UNSUPPORTED, OUT_OF_MEMORY, TIMED_OUT}
    | {BLOCK_SIZE_INVALID, SEQUENCE_INVALID, CRC_ERROR}
)
"""Abort codes of a drive that may be about the block transfer, not about the object."""


@dataclass(frozen=True, slots=True)
class BlockRead(Read):
    """Upload of a long object: by block transfer where the drive has it."""


@dataclass(frozen=True, slots=True)
class BlockWrite(Write):
    """Download of a long object: by block transfer where the drive has it."""


class BlockError(Exception):
    """The drive breaks the protocol: `code` is the abort code for it."""

    def __init__(self, code: int) -> None:
        super().__init__(f"{code:08X}h")
        self.code = code


class UploadBlocks:
    """One block upload. Each frame of the drive brings the frames to send next; `data` is set at its end."""

    def __init__(self, step: Read) -> None:
        self.step = step
        self.begun = False
        """Whether the drive has agreed to a block transfer."""
        self.data: bytes | None = None
        self.dropped = 0
        self._buffer = bytearray()
        self._last = 0
        self._is_whole = self._has_crc = False
        self._announced: int | None = None
        self._repeats = 0

    def initiate(self) -> bytes:
        """The request."""
        return bytes((0xA4,)) + address(self.step) + bytes((BLOCK_SEGMENTS, SWITCH_BYTES))

    def take_answer(self, data: bytes) -> list[bytes]:
        """An answer of the drive, eight bytes. Raises BlockError."""
        if not self.begun:
            return self._on_initiated(data)
        return self._on_end(data) if self._is_whole else self._on_segment(data)

    def due(self) -> list[bytes]:
        """An upload waits for the drive."""
        return []

    def _on_initiated(self, data: bytes) -> list[bytes]:
        if data[0] & 0xE1 != 0xC0 or data[1:4] != address(self.step):
            self.dropped += 1
            return []
        self.begun, self._has_crc = True, bool(data[0] & 0x04)
        self._announced = int.from_bytes(data[4:], "little") if data[0] & 0x02 else None
        if (self._announced or 0) > MAX_BLOCK_BYTES:
            raise BlockError(OUT_OF_MEMORY)
        return [b"\xa3"]

    def _on_segment(self, data: bytes) -> list[bytes]:
        """Segments after a lost one are not kept: the drive sends them again."""
        sequence, is_last = data[0] & 0x7F, bool(data[0] & 0x80)
        if not self._last < sequence <= BLOCK_SEGMENTS:
            self.dropped += 1
            return []
        if sequence == self._last + 1:
            self._last, self._is_whole = sequence, is_last
            self._buffer += data[1:]
        else:
            self.dropped += 1
        if len(self._buffer) > MAX_BLOCK_BYTES + SEGMENT_BYTES:
            raise BlockError(OUT_OF_MEMORY)
        return self._confirm() if is_last or sequence == BLOCK_SEGMENTS else []

    def _confirm(self) -> list[bytes]:
        last, self._last = self._last, 0
        self._repeats = 0 if last else self._repeats + 1
        if self._repeats > MAX_REPEATS:
            raise BlockError(SEQUENCE_INVALID)
        return [bytes((0xA2, last, BLOCK_SEGMENTS))]

    def _on_end(self, data: bytes) -> list[bytes]:
        if data[0] & 0xE3 != 0xC1:
            self.dropped += 1
            return []
        data_bytes = bytes(self._buffer[: len(self._buffer) - (data[0] >> 2 & 0x07)])
        if self._announced not in (None, len(data_bytes)):
            raise BlockError(LENGTH_WRONG)
        if self._has_crc and crc(data_bytes) != int.from_bytes(data[1:3], "little"):
            raise BlockError(CRC_ERROR)
        self.data = data_bytes
        return [b"\xa1"]


class DownloadBlocks:
    """One block download, as `UploadBlocks`; `due` gives the segments, a few at a time."""

    def __init__(self, step: Write) -> None:
        self.step = step
        self.begun = False
        self.data: bytes | None = None
        self.dropped = 0
        self._bytes = step.data
        self._confirmed = self._sent = 0
        """Bytes that the drive has, and the segments of this block that were sent."""
        self._segments = 0
        """Segments of this block; 0: none is to be sent."""
        self._has_crc = self._has_ended = False
        self._repeats = 0

    def initiate(self) -> bytes:
        """The request."""
        return bytes((0xC6,)) + address(self.step) + len(self._bytes).to_bytes(4, "little")

    def take_answer(self, data: bytes) -> list[bytes]:
        """An answer of the drive, eight bytes. Raises BlockError."""
        if not self.begun:
            return self._on_initiated(data)
        if self._has_ended and data[0] & 0xE3 == 0xA1:
            self.data = b""
            return []
        if not self._has_ended and data[0] & 0xE3 == 0xA2:
            return self._on_confirmed(data[1], data[2])
        self.dropped += 1
        return []

    def due(self) -> list[bytes]:
        """The next segments of the block."""
        return [self._segment() for _ in range(min(SEGMENTS_PER_TICK, self._segments - self._sent))]

    def _on_initiated(self, data: bytes) -> list[bytes]:
        if data[0] & 0xE3 != 0xA0 or data[1:4] != address(self.step):
            self.dropped += 1
            return []
        self.begun, self._has_crc = True, bool(data[0] & 0x04)
        self._begin_block(data[4])
        return []

    def _begin_block(self, segments: int) -> None:
        if not 1 <= segments <= BLOCK_SEGMENTS:
            raise BlockError(BLOCK_SIZE_INVALID)
        left = len(self._bytes) - self._confirmed
        self._sent, self._segments = 0, min(segments, -(-left // SEGMENT_BYTES))

    def _segment(self) -> bytes:
        begin = self._confirmed + SEGMENT_BYTES * self._sent
        self._sent += 1
        is_last = begin + SEGMENT_BYTES >= len(self._bytes)
        return bytes((is_last << 7 | self._sent,)) + self._bytes[begin : begin + SEGMENT_BYTES]

    def _on_confirmed(self, sequence: int, segments: int) -> list[bytes]:
        if sequence > self._sent:
            raise BlockError(SEQUENCE_INVALID)
        self._repeats = 0 if sequence else self._repeats + 1
        if self._repeats > MAX_REPEATS:
            raise BlockError(SEQUENCE_INVALID)
        self._confirmed += SEGMENT_BYTES * sequence
        if self._confirmed < len(self._bytes):
            self._begin_block(segments)
            return []
        self._has_ended, self._segments = True, 0
        self._sent = 0
        unused = -len(self._bytes) % SEGMENT_BYTES
        return [struct.pack("<BH", 0xC1 | unused << 2, crc(self._bytes) if self._has_crc else 0)]


class BlockSdoClient(SdoClient):
    """An SdoClient that moves BlockRead and BlockWrite by block transfer, and by an ordinary one where that fails.

    `block_transfers` counts those that worked. A drive that does not know the command is not tried again.
    """

    def __init__(self, node_id: int, timeout_s: float, attempts: int) -> None:
        super().__init__(node_id, timeout_s, attempts)
        self.block_transfers = 0
        self._blocks: UploadBlocks | DownloadBlocks | None = None
        self._without: set[type[Read | Write]] = set()
        """What the drive has no block transfer for."""

    def tick(self, now_s: float) -> list[Frame]:
        """As SdoClient, and the segments that are due."""
        if now_s >= self._ends_s:
            self._blocks = None
        due = self._blocks.due() if self._blocks else []
        return self._frames(due, now_s) if due else super().tick(now_s)

    def on_frame(self, frame: Frame, now_s: float) -> list[Frame]:
        """As SdoClient."""
        blocks, transfer = self._blocks, self._transfer
        if blocks is None or transfer is None or frame.cob_id != SDO_TO_CLIENT + self.node_id:
            return super().on_frame(frame, now_s)
        if len(frame.data) != 8:
            return self._drop()
        if frame.data[0] == _ABORT:
            return self._on_block_abort(transfer, frame.data, now_s)
        if not blocks.begun and frame.data[0] >> 5 == 2 and isinstance(blocks, UploadBlocks):
            self._blocks = None
            return super().on_frame(frame, now_s)
        return self._take(transfer, blocks, frame.data, now_s)

    def _begin(self, step: Read | Write, attempts: int, now_s: float) -> Frame:
        self._blocks = None
        if type(step) in self._without or not isinstance(step, BlockRead | BlockWrite):
            return super()._begin(step, attempts, now_s)
        self._blocks = UploadBlocks(step) if isinstance(step, BlockRead) else DownloadBlocks(step)
        self._transfer = Transfer(step, attempts - 1, now_s, b"")
        return self._request(self._transfer, self._blocks.initiate(), now_s)

    def _take(
        self, transfer: Transfer, blocks: UploadBlocks | DownloadBlocks, data: bytes, now_s: float
    ) -> list[Frame]:
        dropped = blocks.dropped
        try:
            answers = blocks.take_answer(data)
        except BlockError as error:
            return self._fail(transfer, error.code, now_s)
        self.dropped += blocks.dropped - dropped
        if blocks.dropped == dropped:
            transfer.deadline = now_s + self._timeout_s
        frames = self._frames(answers, now_s)
        if blocks.data is not None:
            self.block_transfers += 1
            self._blocks = None
            self._finish(blocks.data)
        return frames

    def _on_block_abort(self, transfer: Transfer, data: bytes, now_s: float) -> list[Frame]:
        code = int.from_bytes(data[4:], "little")
        if data[1:4] != address(transfer.step):
            return self._drop()
        if code in _ABOUT_BLOCKS:
            return self._by_segments(transfer, code, now_s)
        self._blocks = None
        return self._finish(SdoAborted(self.node_id, transfer.step, code))

    def _fail(self, transfer: Transfer, code: int, now_s: float) -> list[Frame]:
        """A block transfer that fails is followed by an ordinary one, unless the object is too long."""
        blocks = self._blocks
        if blocks is None:
            return super()._fail(transfer, code, now_s)
        abort = self._abort_frame(transfer.step, code)
        if code == OUT_OF_MEMORY:
            self._blocks = None
            self._finish(SdoAborted(self.node_id, transfer.step, code))
            return [abort]
        return [abort, *self._by_segments(transfer, COMMAND_UNKNOWN if not blocks.begun else code, now_s)]

    def _by_segments(self, transfer: Transfer, code: int, now_s: float) -> list[Frame]:
        if code == COMMAND_UNKNOWN:
            self._without.add(type(transfer.step))
        self._blocks = None
        return [super()._begin(transfer.step, self._attempts, now_s)]

    def _frames(self, datas: list[bytes], now_s: float) -> list[Frame]:
        transfer = self._transfer
        return [] if transfer is None else [self._request(transfer, data, now_s) for data in datas]


def crc(data: bytes) -> int:
    """The checksum of a block transfer: x^16 + x^12 + x^5 + 1, begun with 0 (CiA 301)."""
    return binascii.crc_hqx(data, 0)
