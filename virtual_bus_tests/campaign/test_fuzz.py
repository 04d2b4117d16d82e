"""Random and malformed frames; `make campaign` runs a million of each kind."""

from __future__ import annotations

from random import Random

import pytest

from campaign.fuzz import (
    FuzzError,
    fuzz_driver,
    fuzz_drives,
    fuzz_drives_with_orders,
    fuzz_watchdog,
    is_stop,
    orders,
    random_frame,
)

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(300)]
FRAMES = 20_000


def test_whatever_is_on_the_bus_the_driver_orders_no_motion_without_a_command() -> None:
    assert fuzz_driver(FRAMES) > FRAMES / 40


def test_whatever_is_on_the_bus_and_at_the_socket_the_watchdog_trips_and_sends_stops_alone() -> None:
    assert fuzz_watchdog(FRAMES) > 100


@pytest.mark.parametrize(
    ("cob_id", "data"),
    [(0x501, "06 00"), (0x000, "01 00"), (0x601, "2b 40 60 00 0f 00 00 00"), (0x201, "0f 00 10 00 00 00")],
)
def test_a_watchdog_that_sent_anything_else_would_be_told(cob_id: int, data: str) -> None:
    with pytest.raises(FuzzError):
        is_stop(cob_id, bytes.fromhex(data))


def test_whatever_orders_nothing_turns_no_wheel() -> None:
    assert fuzz_drives(FRAMES) == 0.0


def test_orders_from_anybody_raise_nothing_in_the_drives() -> None:
    fuzz_drives_with_orders(FRAMES, seed=1)


def test_the_frames_reach_every_listener_in_every_length() -> None:
    random = Random(3)
    frames = [random_frame(random) for _ in range(20_000)]
    for cob_id in (0x000, 0x080, 0x181, 0x201, 0x281, 0x581, 0x601, 0x701, 0x1FE, 0x77E):
        lengths = {len(data) for at, data in frames if at == cob_id}
        assert {0, 1, 2, 4, 6, 7, 8} <= lengths, f"{cob_id:03X}"


def test_what_counts_as_an_order() -> None:
    assert orders(0x201, bytes.fromhex("0f 00 10 00 00 00"))
    assert orders(0x601, bytes.fromhex("2b 40 60 00 0f 00 00 00"))
    assert not orders(0x201, bytes.fromhex("0f 00 10 00 00"))
    assert not orders(0x601, bytes.fromhex("40 41 60 00 00 00 00 00"))
    assert not orders(0x000, bytes.fromhex("01 00"))
