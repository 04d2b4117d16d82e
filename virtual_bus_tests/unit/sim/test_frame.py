"""The bench's CAN frame refuses what cannot be on a bus."""

from __future__ import annotations

from contextlib import nullcontext

import pytest

from canbase_sim.frame import Frame


@pytest.mark.parametrize("cob_id", [-1, 0x800, 0x12345])
def test_an_identifier_outside_of_eleven_bits_is_refused(cob_id: int) -> None:
    with pytest.raises(ValueError, match=r"0\.\.7FFh"):
        Frame(cob_id)


@pytest.mark.parametrize("cob_id", [0, 0x7FF])
@pytest.mark.parametrize("length", [0, 8])
def test_the_limits_themselves_are_frames(cob_id: int, length: int) -> None:
    assert len(Frame(cob_id, bytes(length)).data) == length


@pytest.mark.parametrize(("cob_id", "fits"), [(0x800, True), (0x1FFF_FFFF, True), (0x2000_0000, False)])
def test_an_identifier_of_29_bits_needs_its_mark(cob_id: int, fits: bool) -> None:
    with pytest.raises(ValueError, match=r"outside 0\.\.7FFh"):
        Frame(cob_id)
    with nullcontext() if fits else pytest.raises(ValueError, match=r"outside 0\.\.1FFFFFFFh"):
        assert Frame(cob_id, extended=True).cob_id == cob_id


def test_nine_bytes_are_refused() -> None:
    with pytest.raises(ValueError, match="at most 8"):
        Frame(0x123, bytes(9))


def test_a_frame_reads_like_a_bus_log() -> None:
    assert str(Frame(0x81, bytes.fromhex("3081 11"))) == "081 [3] 30 81 11"
