"""NMT, SYNC and heartbeat, byte by byte."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import SYNC, NmtCommand, NmtState, heartbeat, nmt, parse_heartbeat


@pytest.mark.parametrize(
    ("command", "data"),
    [
        (NmtCommand.START, "01 05"),
        (NmtCommand.STOP, "02 05"),
        (NmtCommand.ENTER_PRE_OPERATIONAL, "80 05"),
        (NmtCommand.RESET_NODE, "81 05"),
        (NmtCommand.RESET_COMMUNICATION, "82 05"),
    ],
)
def test_nmt_commands(command: NmtCommand, data: str) -> None:
    assert nmt(command, 5) == Frame(0x000, bytes.fromhex(data))


def test_nmt_to_every_node_is_node_0() -> None:
    assert nmt(NmtCommand.START, 0).data == bytes.fromhex("01 00")


@pytest.mark.parametrize("node_id", [-1, 128, 255])
def test_nmt_to_an_impossible_node_raises(node_id: int) -> None:
    with pytest.raises(ValueError, match="outside 0…127"):
        nmt(NmtCommand.START, node_id)


def test_sync_has_no_data() -> None:
    assert (SYNC.cob_id, SYNC.data) == (0x080, b"")


def test_the_driver_s_own_heartbeat() -> None:
    assert heartbeat(127, NmtState.OPERATIONAL) == Frame(0x77F, b"\x05")


@pytest.mark.parametrize("node_id", [-1, 0, 128])
def test_a_heartbeat_without_a_node_raises(node_id: int) -> None:
    with pytest.raises(ValueError, match="outside 1…127"):
        heartbeat(node_id, NmtState.OPERATIONAL)


@pytest.mark.parametrize(
    ("byte", "state", "text"),
    [
        (0, NmtState.INITIALISING, "initialising"),
        (4, NmtState.STOPPED, "stopped"),
        (5, NmtState.OPERATIONAL, "operational"),
        (127, NmtState.PRE_OPERATIONAL, "pre-operational"),
    ],
)
def test_heartbeats_are_read(byte: int, state: NmtState, text: str) -> None:
    assert parse_heartbeat(Frame(0x701, bytes((byte,)))) == (1, state)
    assert state.text == text


def test_a_state_that_the_standard_does_not_know_is_none() -> None:
    assert parse_heartbeat(Frame(0x77D, b"\x55")) == (125, None)


@pytest.mark.parametrize(
    "frame",
    [
        Frame(0x701),  # no state
        Frame(0x701, b"\x05\x00"),  # one byte too many
        Frame(0x700, b"\x05"),  # node 0 is no node
        Frame(0x780, b"\x05"),  # beyond node 127
        Frame(0x6FF, b"\x05"),
    ],
)
def test_everything_else_is_no_heartbeat(frame: Frame) -> None:
    assert parse_heartbeat(frame) is None


@given(st.integers(0, 0x7FF), st.binary(max_size=8))
def test_no_frame_raises(cob_id: int, data: bytes) -> None:
    parse_heartbeat(Frame(cob_id, data))
