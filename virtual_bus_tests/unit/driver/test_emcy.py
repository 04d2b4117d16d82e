"""Emergency messages, as the standard wants them and as drives send them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_driver.cia301.emcy import Emcy, emcy_text, parse_emcy
from canbase_driver.cia301.frame import Frame


def test_a_whole_message() -> None:
    #                                      code  1001h  vendor
    frame = Frame(0x081, bytes.fromhex("30 81 11 01 02 03 04 05"))
    emcy = parse_emcy(frame)
    assert emcy == Emcy(1, 0x8130, 0x11, bytes.fromhex("01 02 03 04 05"))
    assert emcy.text == "8130h heartbeat or life guarding lost, bytes 01 02 03 04 05"
    assert not emcy.is_reset


def test_the_makers_own_words_go_first() -> None:
    emcy = Emcy(1, 0xFF00, 0x80, bytes(5))
    assert emcy.text == "FF00h device specific"
    assert emcy.text_with({0xFF00: "motor not tuned"}) == "FF00h motor not tuned"


def test_an_error_that_has_gone() -> None:
    emcy = parse_emcy(Frame(0x0FD, bytes(8)))
    assert emcy == Emcy(125, 0, 0, bytes(5))
    assert emcy.is_reset


@pytest.mark.parametrize(
    ("data", "register", "vendor"),
    [("10 23", 0, b""), ("10 23 03", 3, b""), ("10 23 03 AA", 3, b"\xaa")],
)
def test_short_messages_of_real_drives_are_read(data: str, register: int, vendor: bytes) -> None:
    assert parse_emcy(Frame(0x085, bytes.fromhex(data))) == Emcy(5, 0x2310, register, vendor)


@pytest.mark.parametrize(
    "frame",
    [
        Frame(0x080),  # SYNC
        Frame(0x080, bytes(8)),
        Frame(0x081),
        Frame(0x081, b"\x10"),  # half a code
        Frame(0x100, bytes(8)),  # TIME
        Frame(0x07F, bytes(8)),
    ],
)
def test_everything_else_is_no_emergency_message(frame: Frame) -> None:
    assert parse_emcy(frame) is None


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (0x0000, "error reset or no error"),
        (0x1000, "generic error"),
        (0x2000, "current"),
        (0x2400, "current"),
        (0x2310, "over-current"),
        (0x2340, "current, output side"),
        (0x3210, "over-voltage of the DC link"),
        (0x3220, "under-voltage of the DC link"),
        (0x3230, "voltage inside the device"),
        (0x4210, "device too hot"),
        (0x4310, "temperature"),
        (0x7121, "motor blocked"),
        (0x7305, "encoder"),
        (0x7306, "additional modules"),
        (0x8250, "RPDO timeout"),
        (0x8251, "protocol error"),
        (0x8611, "following error"),
        (0x8612, "monitoring"),
        (0xF001, "additional functions"),
        (0xFF00, "device specific"),
        (0x9100, "unknown error"),
        (0xFFFF, "device specific"),
    ],
)
def test_the_most_specific_meaning_wins(code: int, text: str) -> None:
    assert emcy_text(code) == text


@given(st.integers(0, 0x7FF), st.binary(max_size=8))
def test_no_frame_raises(cob_id: int, data: bytes) -> None:
    emcy = parse_emcy(Frame(cob_id, data))
    assert emcy is None or emcy.text.startswith(f"{emcy.code:04X}h ")
