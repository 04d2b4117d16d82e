"""Since when the bus has failed: failed sends, failed reads and SocketCAN's error frames (linux/can/error.h)."""

from __future__ import annotations

import math

import pytest

from canbase_watchdog.bus_health import BusHealth

NONE = bytes(8)
RX_PASSIVE, TX_PASSIVE, ACTIVE = (bytes([0, detail, 0, 0, 0, 0, 0, 0]) for detail in (0x10, 0x20, 0x40))
RX_WARNING, TX_WARNING = (bytes([0, detail, 0, 0, 0, 0, 0, 0]) for detail in (0x04, 0x08))


def told(*frames: tuple[int, bytes]) -> BusHealth:
    health = BusHealth()
    for n, (error_class, data) in enumerate(frames):
        health.on_error_frame(error_class, data, 1.0 + n)
    return health


def test_at_first_it_works() -> None:
    health = BusHealth()
    assert (health.failed_since, health.takes_frames, health.errors) == (math.inf, True, 0)


def test_from_the_first_failed_send_until_one_that_succeeds() -> None:
    health = BusHealth()
    health.on_send_error(1.0)
    health.on_send_error(2.0)
    assert (health.failed_since, health.takes_frames) == (1.0, False)
    health.on_data()
    assert health.failed_since == 1.0
    health.on_sent()
    assert (health.failed_since, health.takes_frames, health.send_errors) == (math.inf, True, 2)


@pytest.mark.parametrize(
    ("error_class", "data", "failed"),
    [
        (0x040, NONE, True),  # bus off
        (0x001, NONE, True),  # transmission timeout
        (0x004, RX_PASSIVE, True),
        (0x004, TX_PASSIVE, True),
        (0x004, RX_WARNING, False),
        (0x004, TX_WARNING, False),
        (0x004, NONE, False),
        (0x004, b"\x00\x01", False),  # an overflow of its buffer
        (0x004, b"", False),
        (0x004, b"\x10", False),  # detail is byte 1
        (0x004, b"\x00\x10", True),
        (0x002, TX_PASSIVE, False),  # lost arbitration: byte 1 is none of its
        (0x008, NONE, False),  # protocol
        (0x020, NONE, False),  # no acknowledgement: counted, the controller says when it is too much
        (0x080, NONE, False),  # bus error
        (0x0C4, TX_PASSIVE, True),  # several at once
    ],
)
def test_what_an_error_frame_says(error_class: int, data: bytes, failed: bool) -> None:
    health = told((error_class, data))
    assert (health.failed_since == 1.0) is failed
    assert (health.error_frames, health.errors) == (1, 1)
    assert health.takes_frames


@pytest.mark.parametrize("over", [(0x100, NONE), (0x004, ACTIVE)])
def test_it_is_over_when_the_controller_says_so(over: tuple[int, bytes]) -> None:
    assert told((0x040, NONE), over).failed_since == math.inf


def test_an_overflow_does_not_end_it() -> None:
    assert told((0x040, NONE), (0x004, b"\x00\x01")).failed_since == 1.0


def test_it_counts_from_the_first_of_several() -> None:
    assert told((0x004, TX_PASSIVE), (0x040, NONE), (0x008, NONE)).failed_since == 1.0


def test_a_frame_of_somebody_else_shows_that_controller_and_cable_work() -> None:
    health = told((0x004, TX_PASSIVE))
    health.on_data()
    assert health.failed_since == math.inf


def test_a_send_that_succeeds_says_nothing_about_a_controller_that_is_off() -> None:
    health = told((0x040, NONE))
    health.on_sent()
    assert health.failed_since == 1.0


def test_reading_that_fails() -> None:
    health = BusHealth()
    health.on_receive_error(1.0)
    health.on_receive_error(2.0)
    assert (health.failed_since, health.receive_errors, health.errors) == (1.0, 2, 2)
    health.on_data()
    assert health.failed_since == math.inf


def test_a_bus_in_trouble_takes_frames_and_does_not_work_until_somebody_else_is_heard() -> None:
    health = BusHealth()
    assert health.works
    health.on_bus_off(1.0)
    health.on_trouble(2.0)
    health.on_sent()
    assert (health.failed_since, health.takes_frames, health.works) == (1.0, True, False)
    health.on_data()
    assert health.works


@pytest.mark.parametrize("over", [(0x100, NONE), (0x004, ACTIVE), None])
def test_only_bus_off_is_off_until_the_controller_or_a_frame_shows_that_it_is_back(
    over: tuple[int, bytes] | None,
) -> None:
    assert not told((0x004, TX_PASSIVE), (0x001, NONE)).is_off
    health = told((0x040, NONE))
    health.on_sent()
    assert (health.is_off, health.works) == (True, False)
    if over is None:
        health.on_data()
    else:
        health.on_error_frame(*over, 2.0)
    assert (health.is_off, health.works) == (False, True)


def test_of_two_troubles_the_older_one_counts_and_both_must_end() -> None:
    health = BusHealth()
    health.on_send_error(1.0)
    health.on_error_frame(0x040, NONE, 2.0)
    assert health.failed_since == 1.0
    health.on_sent()
    assert health.failed_since == 2.0
