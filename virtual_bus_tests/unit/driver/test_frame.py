"""A frame that cannot be built raises; nothing falls back to another identifier."""

import pytest

from canbase_driver.cia301.frame import Frame


@pytest.mark.parametrize("cob_id", [-1, 0x800, 0x1FFF_FFFF])
def test_an_identifier_that_is_not_11_bits_wide_is_refused(cob_id: int) -> None:
    with pytest.raises(ValueError, match="outside 0…7FFh"):
        Frame(cob_id)


@pytest.mark.parametrize("cob_id", [0, 1, 0x7FE, 0x7FF])
def test_every_11_bit_identifier_is_taken(cob_id: int) -> None:
    assert Frame(cob_id, b"\x01").cob_id == cob_id


def test_nine_bytes_are_refused_and_eight_are_taken() -> None:
    assert len(Frame(0x201, bytes(8)).data) == 8
    with pytest.raises(ValueError, match="9 data bytes in frame 201h"):
        Frame(0x201, bytes(9))


def test_a_frame_reads_like_a_line_of_a_bus_log() -> None:
    assert str(Frame(0x601, bytes.fromhex("40 41 60 00"))) == "601h [40 41 60 00]"
