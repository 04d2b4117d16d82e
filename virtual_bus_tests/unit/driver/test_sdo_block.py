"""SDO block transfers as byte scripts, and against the simulated drive, which has a server of its own."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.sdo_block import (
    BLOCK_SEGMENTS,
    MAX_BLOCK_BYTES,
    BlockRead,
    BlockSdoClient,
    BlockWrite,
    crc,
)
from canbase_driver.cia301.sdo_client import Read, SdoAborted, SdoTimeout
from canbase_sim.cia301.sdo_block import BlockDownload, BlockUpload, checksum

TEXT = b"a text that is longer than one segment"


def client(attempts: int = 2) -> BlockSdoClient:
    return BlockSdoClient(node_id=5, timeout_s=0.3, attempts=attempts)


def rx(data: str) -> Frame:
    """An answer of node 5."""
    return Frame(0x585, bytes.fromhex(data).ljust(8, b"\0"))


def tx(data: str) -> Frame:
    """A request to node 5."""
    return Frame(0x605, bytes.fromhex(data).ljust(8, b"\0"))


def test_an_upload_as_the_standard_has_it() -> None:
    sdo = client()
    assert sdo.start(BlockRead(0x1008), 0.0) == tx("A4 08 10 00 7F 1C")
    assert sdo.on_frame(rx("C6 08 10 00 0A 00 00 00"), 0.0) == [tx("A3")]
    assert sdo.on_frame(rx("01 57 68 65 65 6C 20 64"), 0.0) == []
    assert sdo.on_frame(rx("82 72 76 65 00 00 00 00"), 0.0) == [tx("A2 02 7F")]
    assert sdo.busy
    checked = crc(b"Wheel drve").to_bytes(2, "little").hex()
    assert sdo.on_frame(rx(f"D1 {checked}"), 0.0) == [tx("A1")]
    assert sdo.answer() == b"Wheel drve"
    assert sdo.block_transfers == 1


def test_a_download_sends_two_segments_a_tick_and_waits_for_the_confirmation() -> None:
    sdo = client()
    assert sdo.start(BlockWrite(0x2000, 1, b"0123456789abcdefghi"), 0.0) == tx("C6 00 20 01 13 00 00 00")
    assert sdo.on_frame(rx("A4 00 20 01 02"), 0.0) == []
    assert sdo.tick(0.0) == [tx("01 30 31 32 33 34 35 36"), tx("02 37 38 39 61 62 63 64")]
    assert sdo.tick(0.1) == []
    assert sdo.on_frame(rx("A2 01 7F"), 0.1) == []  # the second one was lost
    assert sdo.tick(0.1) == [tx("01 37 38 39 61 62 63 64"), tx("82 65 66 67 68 69 00 00")]
    checked = crc(b"0123456789abcdefghi").to_bytes(2, "little").hex()
    assert sdo.on_frame(rx("A2 02 7F"), 0.2) == [tx(f"C9 {checked}")]
    assert sdo.on_frame(rx("A1"), 0.2) == []
    assert sdo.answer() == b""


def test_both_sides_have_the_checksum_of_the_standard() -> None:
    assert crc(b"123456789") == checksum(b"123456789") == 0x31C3


def test_a_drive_without_block_transfers_is_read_by_segments_and_not_queried_again() -> None:
    sdo = client()
    sdo.start(BlockRead(0x1008), 0.0)
    assert sdo.on_frame(rx("80 08 10 00 01 00 04 05"), 0.0) == [tx("40 08 10 00")]
    sdo.on_frame(rx("43 08 10 00 41 42 43 44"), 0.0)
    assert sdo.answer() == b"ABCD"
    assert sdo.start(BlockRead(0x1009), 1.0) == tx("40 09 10 00")
    sdo.on_frame(rx("43 09 10 00 41 42 43 44"), 1.0)
    assert sdo.start(BlockWrite(0x2000, 0, TEXT), 2.0).data[0] == 0xC6  # the other direction is another command


def test_a_drive_that_does_not_answer_the_request_of_a_block_is_read_by_segments() -> None:
    sdo = client()
    sdo.start(BlockRead(0x1008), 0.0)
    assert sdo.tick(0.29) == []
    assert sdo.tick(0.31) == [tx("80 08 10 00 00 00 04 05"), tx("40 08 10 00")]
    for moment_s in (0.7, 1.1):
        sdo.tick(moment_s)
    with pytest.raises(SdoTimeout):
        sdo.answer()


def test_a_drive_may_answer_by_an_ordinary_upload() -> None:
    sdo = client()
    sdo.start(BlockRead(0x1008), 0.0)
    assert sdo.on_frame(rx("41 08 10 00 05 00 00 00"), 0.0) == [tx("60")]
    sdo.on_frame(rx("05 48 65 6C 6C 6F"), 0.0)
    assert sdo.answer() == b"Hello"
    assert sdo.block_transfers == 0


def test_what_is_about_the_object_is_an_answer() -> None:
    sdo = client()
    sdo.start(BlockRead(0x5FFF), 0.0)
    assert sdo.on_frame(rx("80 FF 5F 00 00 00 02 06"), 0.0) == []
    with pytest.raises(SdoAborted, match="the object does not exist"):
        sdo.answer()


def test_a_wrong_checksum_is_aborted_and_the_object_is_read_by_segments() -> None:
    sdo = client()
    sdo.start(BlockRead(0x1008), 0.0)
    sdo.on_frame(rx("C6 08 10 00 07 00 00 00"), 0.0)
    sdo.on_frame(rx("81 57 68 65 65 6C 20 64"), 0.0)
    assert sdo.on_frame(rx("C1 FF FF"), 0.0) == [tx("80 08 10 00 04 00 04 05"), tx("40 08 10 00")]


def test_an_object_that_is_too_long_is_not_followed_by_any_transfer() -> None:
    sdo = client()
    sdo.start(BlockRead(0x1021), 0.0)
    too_long = (MAX_BLOCK_BYTES + 1).to_bytes(4, "little").hex()
    assert sdo.on_frame(rx(f"C6 21 10 00 {too_long}"), 0.0) == [tx("80 21 10 00 05 00 04 05")]
    with pytest.raises(SdoAborted, match="out of memory"):
        sdo.answer()


def test_a_length_that_is_not_announced_is_bounded_too() -> None:
    sdo = client()
    sdo.start(BlockRead(0x1021), 0.0)
    sdo.on_frame(rx("C4 21 10 00"), 0.0)
    for segment in range(MAX_BLOCK_BYTES // 7 + 2):
        sent = sdo.on_frame(rx(f"{segment % BLOCK_SEGMENTS + 1:02X} 01 02 03 04 05 06 07"), 0.0)
    assert sent == [tx("80 21 10 00 05 00 04 05")]


@pytest.mark.parametrize(
    "noise", ["00 01 02 03 04 05 06 07", "01 00 00 00 00 00 00 00", "E0 00 00 00", "C4 09 10 00", "43 41 60 00 01"]
)
def test_frames_that_do_not_belong_to_it_are_dropped_and_counted(noise: str) -> None:
    sdo = client()
    sdo.start(BlockRead(0x1008), 0.0)
    assert sdo.on_frame(rx(noise), 0.0) == []
    assert sdo.dropped == 1
    assert sdo.on_frame(Frame(0x585, b"\xc6\x08\x10"), 0.0) == []
    assert sdo.dropped == 2


def test_an_ordinary_step_is_an_ordinary_transfer() -> None:
    assert client().start(Read(0x1008), 0.0) == tx("40 08 10 00")


def exchange(sdo: BlockSdoClient, first: Frame, server: BlockUpload | BlockDownload, said: list[bytes]) -> int:
    """Client and simulated server in turn; how many frames the client sent."""
    sent, now_s = 1, 0.0
    while sdo.busy:
        now_s += 0.001
        assert now_s < 60.0, "the transfer does not end"
        answers, said[:] = said[:], []
        frames = [frame for data in answers for frame in sdo.on_frame(Frame(0x585, data), now_s)]
        frames += sdo.tick(now_s)
        for frame in frames:
            sent += 1
            server.receive(frame.data)
    return sent


@given(st.binary(min_size=1, max_size=3000), st.sets(st.integers(1, 126), max_size=5))
def test_any_content_comes_over_with_segments_lost_on_the_way(content: bytes, lost: set[int]) -> None:
    sdo, said = client(), list[bytes]()
    first = sdo.start(BlockRead(0x2000), 0.0)
    server = BlockUpload(first.data, content, said.append)
    server.lose = {each for each in lost if each < -(-len(content) // 7)}  # the last one ends the block
    exchange(sdo, first, server, said)
    assert sdo.answer() == content
    assert server.is_done
    assert sdo.block_transfers == 1


@given(st.binary(min_size=1, max_size=3000), st.integers(1, 127))
def test_any_content_is_written_whatever_the_size_of_the_blocks(content: bytes, segments: int) -> None:
    sdo, said, stored = client(), list[bytes](), list[bytes]()
    first = sdo.start(BlockWrite(0x2000, 0, content), 0.0)
    server = BlockDownload(first.data, stored.append, said.append, segments)
    exchange(sdo, first, server, said)
    assert sdo.answer() == b""
    assert stored == [content]


@given(st.lists(st.binary(min_size=8, max_size=8), max_size=40))
def test_no_answer_of_a_drive_raises(frames: list[bytes]) -> None:
    sdo = client()
    sdo.start(BlockRead(0x1008), 0.0)
    for data in frames:
        sdo.on_frame(Frame(0x585, data), 0.0)
        sdo.tick(0.0)
