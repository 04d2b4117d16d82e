"""A drive that answers SDO without end: by empty segments, or each time just before the timeout. The transfer ends."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.sdo_block import MAX_BLOCK_BYTES, BlockRead, BlockSdoClient, BlockWrite
from canbase_driver.cia301.sdo_client import LONGEST_TRANSFER_S, MAX_UPLOAD_BYTES, Read, SdoError, Write

TIMEOUT_S, ATTEMPTS, STEP_S = 0.3, 3, 0.001
END_S = LONGEST_TRANSFER_S + ATTEMPTS * TIMEOUT_S
LONG = bytes(MAX_BLOCK_BYTES)
Drive = Callable[[bytes], bytes | None]


class Answers:
    """A drive: what it answers to each request, by the command in its first byte; it never finishes anything."""

    def __init__(self, *, segment: bytes = bytes(8), block_size: int = 127) -> None:
        self.segment, self.block_size, self.sequence = segment, block_size, 0

    def to(self, request: bytes) -> bytes | None:
        command, address = request[0], request[1:4]
        if command == 0x80:
            return None
        if command in (0x40, 0x21):  # initiate an upload, a download
            return bytes((command + 0x01 if command == 0x40 else 0x60,)) + address + b"\xff\0\0\0"
        if command in (0xA4, 0xC6):  # initiate a block upload, a block download
            return bytes((0xC0 if command == 0xA4 else 0xA0,)) + address + bytes((self.block_size, 0, 0, 0))
        if command >> 5 == 3:  # upload a segment; its toggle bit comes back
            return bytes((self.segment[0] | command & 0x10,)) + self.segment[1:]
        return bytes((0x20 | command & 0x10,)) + bytes(7)

    def block(self, request: bytes) -> bytes | None:
        """Of a block upload: one segment after the other; of a download: a confirmation of one segment."""
        if request[0] in (0x80, 0xA4, 0xC6, 0x40, 0x21):
            return self.to(request)
        return bytes((0xA2, 1, 1)) + bytes(5)


def played(step: Read | Write, drive: Drive, late_s: float) -> tuple[float, int, str]:
    """When the transfer has ended [s], after how many answers, and why. `late_s`: each answer comes after that."""
    sdo, now_s, answers = BlockSdoClient(5, TIMEOUT_S, ATTEMPTS), 0.0, 0
    waiting = [(late_s, drive(sdo.start(step, 0.0).data))]
    while sdo.busy:
        if now_s > 10 * LONGEST_TRANSFER_S:
            return now_s, answers, "it goes on"
        due = [data for at_s, data in waiting if at_s <= now_s and data is not None]
        waiting = [(at_s, data) for at_s, data in waiting if at_s > now_s]
        sent = [frame for data in due for frame in sdo.on_frame(Frame(0x585, data), now_s)]
        answers += len(due)
        sent += sdo.tick(now_s)
        waiting += [(now_s + late_s, drive(frame.data)) for frame in sent]
        now_s += STEP_S if late_s < 0.01 else 0.01
    with pytest.raises(SdoError) as error:
        sdo.answer()
    return now_s, answers, error.value.text


EMPTY, ONE_BYTE = b"\x0e" + bytes(7), b"\x0c" + bytes(7)


def test_empty_segments_without_end_are_counted() -> None:
    ended_s, answers, why = played(Read(0x1008), Answers(segment=EMPTY).to, late_s=0.0)
    assert "out of memory" in why
    assert answers == ATTEMPTS * (MAX_UPLOAD_BYTES + 2)
    assert ended_s < 2 * ATTEMPTS * MAX_UPLOAD_BYTES * STEP_S


@pytest.mark.parametrize(
    ("step", "drive"),
    [
        (Read(0x1008), Answers(segment=EMPTY).to),
        (Read(0x1008), Answers(segment=ONE_BYTE).to),
        (Write(0x2000, 0, LONG), Answers().to),
        (BlockRead(0x1008), Answers(segment=ONE_BYTE).to),
        (BlockWrite(0x2000, 0, LONG), Answers(block_size=1).block),
    ],
)
def test_a_drive_that_answers_just_in_time_each_time_is_given_up(step: Read | Write, drive: Drive) -> None:
    ended_s, _, why = played(step, drive, late_s=0.29)
    assert why == "not finished after 60 s, though the drive answers"
    assert ended_s == pytest.approx(END_S, abs=0.05)


def test_block_segments_that_come_just_in_time_are_given_up_too() -> None:
    """The drive sends them by itself: one each 0.29 s would take 45 minutes."""
    sdo, now_s, sequence = BlockSdoClient(5, TIMEOUT_S, ATTEMPTS), 0.0, 0
    sdo.start(BlockRead(0x1008), now_s)
    sdo.on_frame(Frame(0x585, b"\xc0\x08\x10\0\0\0\0\0"), now_s)
    while sdo.busy and now_s < 10 * LONGEST_TRANSFER_S:
        now_s += 0.29
        sequence = sequence % 127 + 1
        sdo.on_frame(Frame(0x585, bytes((sequence,)) + b"segment"), now_s)
        sdo.tick(now_s)
    assert not sdo.busy
    assert now_s == pytest.approx(END_S, abs=0.3)
    assert sdo.start(Read(0x1008), now_s).data[0] == 0x40


def test_a_slow_drive_has_the_time_for_the_longest_object() -> None:
    """586 segments, each after 0.1 s."""
    sdo, now_s = BlockSdoClient(5, TIMEOUT_S, ATTEMPTS), 0.0
    sdo.start(Read(0x1008), now_s)
    (sent,) = sdo.on_frame(Frame(0x585, b"\x40\x08\x10\0\0\0\0\0"), now_s)
    for left in range(586, 0, -1):
        now_s += 0.1
        assert sdo.tick(now_s) == []
        last = left == 1
        answer = bytes((sent.data[0] & 0x10 | last | (6 << 1 if last else 0),)) + b"segment"
        (sent,) = sdo.on_frame(Frame(0x585, answer), now_s) or [sent]
    assert sdo.answer() == b"segment" * 585 + b"s"


def test_a_drive_that_restarts_has_its_time_again() -> None:
    sdo = BlockSdoClient(5, TIMEOUT_S, ATTEMPTS)
    sdo.start(Write(0x2000, 0, LONG), 0.0)
    sdo.again(END_S - 0.1)
    assert sdo.tick(END_S + 0.1) == []
    assert sdo.busy
