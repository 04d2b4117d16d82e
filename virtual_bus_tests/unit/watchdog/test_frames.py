"""The watchdog's frames, byte by byte, against docs/bus.md, CiA 301 and CiA 402."""

from __future__ import annotations

import math

import pytest

from canbase_config.watchdog import WatchedLayout
from canbase_watchdog import frames
from canbase_watchdog.frames import DriveState, Frame


def frame(cob_id: int, data: str) -> Frame:
    return Frame(cob_id, bytes.fromhex(data))


def test_stopping_frames() -> None:
    assert frames.quick_stop(1, 1) == frame(0x501, "02 00")
    assert frames.quick_stop(0x7D, 2) == frame(0x57D, "02 00 02 00")
    assert frames.pre_operational(5) == frame(0x000, "80 05")
    assert frames.write_controlword(5, 0, 0x0002) == frame(0x605, "2b 40 60 00 02 00 00 00")
    assert frames.write_controlword(5, 1, 0x0000) == frame(0x605, "2b 40 68 00 00 00 00 00")
    assert list(frames.read_feedback(5, 0)) == [
        frame(0x605, "40 41 60 00 00 00 00 00"),
        frame(0x605, "40 64 60 00 00 00 00 00"),
        frame(0x605, "40 6c 60 00 00 00 00 00"),
    ]
    assert list(frames.read_feedback(5, 1))[2] == frame(0x605, "40 6c 68 00 00 00 00 00")


def test_own_frames() -> None:
    assert frames.heartbeat() == frame(0x77E, "05")
    assert frames.state(2, 3, 1, 7, 0.2519, (9, 2)) == frame(0x1FE, "02 03 01 07 fb 00 09 02")


@pytest.mark.parametrize(
    ("age_s", "data"),
    [(-0.004, "00 00"), (0.0, "00 00"), (0.0011, "01 00"), (65.5341, "fe ff"), (65.535, "ff ff"), (math.inf, "ff ff")],
)
def test_age_of_the_lease_in_the_state_frame(age_s: float, data: str) -> None:
    assert frames.state(1, 0, 0, 0, age_s, (0, 0)).data[4:6] == bytes.fromhex(data)


# Bits 4, 5 where free, 7, 8 and above vary: they are set in the second word of each pair.
@pytest.mark.parametrize(
    ("words", "state"),
    [
        ((0x0000, 0xFFB0), DriveState.NOT_READY_TO_SWITCH_ON),
        ((0x0040, 0xFFF0), DriveState.SWITCH_ON_DISABLED),
        ((0x0021, 0xFFB1), DriveState.READY_TO_SWITCH_ON),
        ((0x0023, 0xFFB3), DriveState.SWITCHED_ON),
        ((0x0027, 0xFFB7), DriveState.OPERATION_ENABLED),
        ((0x0007, 0xFF97), DriveState.QUICK_STOP_ACTIVE),
        ((0x000F, 0xFFBF), DriveState.FAULT_REACTION_ACTIVE),
        ((0x0008, 0xFFB8), DriveState.FAULT),
        ((0x0041, 0x0005), None),
        ((0x0001, 0x0003), None),
    ],
)
def test_states_of_the_statusword(words: tuple[int, int], state: DriveState | None) -> None:
    assert [frames.decode_state(word) for word in words] == [state, state]


@pytest.mark.parametrize(
    ("word", "asks"),
    [
        (0x0F, True),
        (0x1F, True),
        (0x10F, True),
        (0x07, False),
        (0x06, False),
        (0x02, False),
        (0x0B, False),
        (0x8F, False),
    ],
)
def test_controlwords_that_ask_for_power(word: int, asks: bool) -> None:
    assert frames.asks_for_power(word) is asks


def test_feedback_and_setpoints() -> None:
    assert frames.decode_status(bytes.fromhex("37 02 fe ff ff ff")) == (0x0237, -2)
    assert frames.decode_velocity(bytes.fromhex("0c fe ff ff")) == -500
    assert frames.decode_setpoint(bytes.fromhex("0f 00 0c fe ff ff")) == (0x0F, -500)


@pytest.mark.parametrize("length", [0, 1, 5, 7, 8])
def test_other_lengths_are_none_of_them(length: int) -> None:
    data = bytes(length)
    assert frames.decode_status(data) is None
    assert frames.decode_velocity(data) is None
    assert frames.decode_setpoint(data) is None


@pytest.mark.parametrize(
    ("data", "answer"),
    [
        ("4b 41 60 00 37 02 00 00", ((0x6041, 0), 0x0237)),
        ("43 6c 60 00 0c fe ff ff", ((0x606C, 0), -500)),
        ("42 6c 68 00 0c fe ff ff", ((0x686C, 0), -500)),  # size not shown: four bytes
        ("4f 61 60 00 ff 00 00 00", ((0x6061, 0), -1)),
        ("43 6c 60 02 0c fe ff ff", ((0x606C, 2), -500)),
        ("80 41 60 00 00 00 02 06", None),  # abort
        ("60 40 60 00 00 00 00 00", None),  # answer to a write
        ("41 08 10 00 10 00 00 00", None),  # begin of a segmented upload
        ("4b 41 60 00 37 02 00", None),
    ],
)
def test_sdo_answers(data: str, answer: tuple[tuple[int, int], int] | None) -> None:
    assert frames.decode_sdo(bytes.fromhex(data)) == answer


@pytest.mark.parametrize(
    ("data", "number"),
    [("01 52 53 54", 1), ("ff 52 53 54", 255), ("00 52 53 54", None), ("01 52 53 55", None), ("01 52 53", None)],
)
def test_reset_requests(data: str, number: int | None) -> None:
    assert frames.decode_reset_request(bytes.fromhex(data)) == number


@pytest.mark.parametrize(
    ("data", "index"),
    [
        ("2b 40 60 00 0f 00 00 00", 0x6040),
        ("23 ff 68 00 01 00 00 00", 0x68FF),
        ("21 40 60 00 02 00 00 00", 0x6040),  # segmented
        ("3f 40 60 00 00 00 00 00", 0x6040),
        ("c0 40 60 00 00 00 00 00", 0x6040),  # block
        ("c6 16 10 01 04 00 00 00", 0x1016),  # block, with size and checksum
        ("c1 16 10 01 04 00 00 00", None),  # the end of a block
        ("a0 16 10 01 04 00 00 00", None),  # begins to read a block
        ("40 40 60 00 00 00 00 00", None),
        ("1f 40 60 00 00 00 00 00", None),
        ("60 40 60 00 00 00 00 00", None),
        ("2b 40 60 00 0f 00 00", None),
    ],
)
def test_sdo_requests_that_write(data: str, index: int | None) -> None:
    assert frames.decode_sdo_download(bytes.fromhex(data)) == index


@pytest.mark.parametrize(
    ("data", "command"),
    [("01 00", (1, 0)), ("02 05", (2, 5)), ("80 01", (128, 1)), ("81 7f", (129, 127)), ("82 01", (130, 1))],
)
def test_nmt_commands(data: str, command: tuple[int, int]) -> None:
    assert frames.decode_nmt(bytes.fromhex(data)) == command


@pytest.mark.parametrize("data", ["03 01", "00 01", "01", "01 01 00"])
def test_no_nmt_commands(data: str) -> None:
    assert frames.decode_nmt(bytes.fromhex(data)) is None


def test_the_counters() -> None:
    frame = frames.counters(refused=1, dropped=0x203, bus_errors=0x405, trips=6, gap_s=0.0071)
    assert (frame.cob_id, frame.data.hex(" ")) == (0x2FE, "01 00 03 02 05 04 06 07")


def test_counters_stay_at_their_greatest_number() -> None:
    greatest = frames.counters(refused=65535, dropped=65535, bus_errors=65535, trips=255, gap_s=0.255)
    assert greatest.data == bytes([0xFF] * 8)
    assert frames.counters(65536, 10**9, 65536, 256, 0.2551).data == greatest.data


HUB_MOTORS = WatchedLayout(sub_index=True, shared_controlword=True, packed_statusword=True)
"""Two motors on one node: sub-index 1 and 2, one controlword, both statuswords in one object."""


def test_both_statuswords_in_one_object() -> None:
    data = bytes.fromhex("37 02 40 02 fe ff ff ff")
    assert frames.decode_status(data, HUB_MOTORS, 0) == (0x0237, -2)
    assert frames.decode_status(data, HUB_MOTORS, 1) == (0x0240, -2)
    assert frames.decode_status(data[:6], HUB_MOTORS, 0) is None
    assert frames.own_statusword(-0x10000 + 0x37, HUB_MOTORS, 1) == 0xFFFF  # as an SDO answer reads it


def test_the_words_that_stop_hub_motors() -> None:
    assert frames.quick_stop(5, 2, HUB_MOTORS) == frame(0x505, "02 00")
    assert frames.write_controlword(5, 1, 0x0000, HUB_MOTORS) == frame(0x605, "2b 40 60 00 00 00 00 00")
    assert list(frames.read_feedback(5, 1, HUB_MOTORS)) == [
        frame(0x605, "40 41 60 00 00 00 00 00"),
        frame(0x605, "40 64 60 02 00 00 00 00"),
        frame(0x605, "40 6c 60 02 00 00 00 00"),
    ]


def test_a_controlword_for_each_motor_by_sub_index() -> None:
    apart = WatchedLayout(sub_index=True)
    assert frames.write_controlword(5, 1, 0x0002, apart) == frame(0x605, "2b 40 60 02 02 00 00 00")
    assert frames.quick_stop(5, 2, apart) == frame(0x505, "02 00 02 00")


def test_velocities_of_16_bits() -> None:
    narrow = WatchedLayout(target_bits=16, velocity_bits=16)
    assert frames.decode_velocity(bytes.fromhex("0c fe"), narrow) == -500
    assert frames.decode_velocity(bytes.fromhex("0c fe ff ff"), narrow) == -500
    assert frames.decode_velocity(bytes.fromhex("0c fe ff"), narrow) is None
    assert frames.decode_torque(bytes.fromhex("0c fe"), narrow) is None
    assert frames.decode_torque(bytes.fromhex("00 00 0c fe"), narrow) == -0.5
    assert frames.decode_torque(bytes.fromhex("00 00 00 00 e8 03")) == 1.0
    assert frames.decode_torque(bytes.fromhex("00 00 00 00")) is None
    assert frames.decode_setpoint(bytes.fromhex("0f 00 0c fe"), narrow) == (0x0F, -500)
    assert frames.decode_setpoint(bytes.fromhex("0f 00 0c fe ff ff"), narrow) is None


def test_a_velocity_of_16_bits_behind_the_position() -> None:
    joined, narrow = bytes.fromhex("37 02 fe ff ff ff 0c fe"), WatchedLayout(target_bits=16, velocity_bits=16)
    assert frames.decode_status(joined, narrow) == (0x0237, -2)
    assert frames.decode_joined_velocity(joined, narrow) == -500
    for length in range(10):
        data = (joined + joined)[:length]
        assert (frames.decode_joined_velocity(data, narrow) is not None) == (length == 8)
        assert (frames.decode_status(data, narrow) is not None) == (length in (6, 8))


@pytest.mark.parametrize(
    "layout", [WatchedLayout(), WatchedLayout(packed_statusword=True, sub_index=True, velocity_bits=16)]
)
def test_no_velocity_is_read_out_of_a_status_that_has_no_room_for_it(layout: WatchedLayout) -> None:
    """A wide one has a TPDO of its own; the status of two motors has eight bytes itself."""
    assert frames.decode_joined_velocity(bytes.fromhex("37 02 fe ff ff ff 0c fe"), layout) is None
