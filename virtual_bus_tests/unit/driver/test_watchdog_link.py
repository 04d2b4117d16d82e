"""The watchdog as the driver sees it: its state frame in bytes, its age, requests whose answers are never mixed up."""

from __future__ import annotations

import math

import pytest

from canbase_driver.cia301.frame import Frame
from canbase_driver.supervision.watchdog_link import CAUSES, WatchdogCounters, WatchdogLink, WatchdogState, parse_state
from canbase_runtime.watchdog_view import WatchdogView

WATCHING = "01 00 00 00 14 00 00 00"
TRIPPED = "02 03 01 02 ff ff 00 00"  # drive silent, quick stop, node 2, no lease


def state(data: str) -> Frame:
    return Frame(0x1FE, bytes.fromhex(data))


def link(data: str = WATCHING, at: float = 10.0) -> WatchdogLink:
    heard = WatchdogLink(timeout_s=0.2)
    assert heard.on_frame(state(data), at)
    return heard


def test_the_state_frame_as_docs_bus_md_has_it() -> None:
    assert parse_state(state("02 03 04 05 2c 01 07 02")) == WatchdogState(2, 3, 4, 5, 300, 7, 2)


@pytest.mark.parametrize(
    "frame",
    [
        Frame(0x1FE, bytes(7)),
        Frame(0x1FE),
        Frame(0x1FD, bytes.fromhex(WATCHING)),
        state("03 00 00 00 00 00 00 00"),
        state("ff 00 00 00 00 00 00 00"),
    ],
)
def test_what_is_no_state_frame_is_dropped_and_does_not_keep_the_watchdog_alive(frame: Frame) -> None:
    heard = link(at=10.0)
    assert not heard.on_frame(frame, 10.15)
    assert heard.view(10.201)[0] is WatchdogView.MISSING


def test_before_the_first_frame_it_is_missing() -> None:
    silent = WatchdogLink(timeout_s=0.2)
    assert silent.view(10.0) == (WatchdogView.MISSING, "no frame of it yet; start it with `canbase serve watchdog`")
    assert math.isnan(silent.age_s(10.0))
    assert silent.cause == "none"
    assert silent.answer() is None


@pytest.mark.parametrize(
    ("data", "now_s", "view", "sentence"),
    [
        (WATCHING, 10.0, WatchdogView.OK, ""),
        (WATCHING, 10.199, WatchdogView.OK, ""),
        (WATCHING, 10.201, WatchdogView.MISSING, "no frame for 0.20 s (timeout 0.20 s)"),
        (TRIPPED, 10.0, WatchdogView.TRIPPED, "drive silent, node 2"),
        (TRIPPED, 10.201, WatchdogView.MISSING, "no frame for 0.20 s (timeout 0.20 s)"),
        ("02 01 00 00 00 00 00 00", 10.0, WatchdogView.TRIPPED, "lease lost"),
        ("02 63 00 00 00 00 00 00", 10.0, WatchdogView.TRIPPED, "cause 99"),
        ("00 00 00 00 ff ff 00 00", 10.0, WatchdogView.MISSING, "still starting"),
    ],
)
def test_whether_it_watches(data: str, now_s: float, view: WatchdogView, sentence: str) -> None:
    heard = link(data)
    assert heard.view(now_s) == (view, sentence)
    assert heard.age_s(now_s) == pytest.approx(now_s - 10.0)


def test_every_cause_of_docs_bus_md_has_a_text() -> None:
    assert sorted(CAUSES) == [*range(19), 20, 21]
    assert link("02 0b 00 00 00 00 00 00").cause == "shut down while a wheel turned"


def test_a_request_in_bytes_and_its_answer() -> None:
    heard = link()
    assert str(heard.request_reset()) == "27Eh [01 52 53 54]"
    assert heard.answer() is None
    heard.on_frame(state("01 00 00 00 14 00 01 04"), 10.05)
    assert heard.answer() == 4


def test_an_answer_to_another_request_is_none() -> None:
    heard = link()
    heard.request_reset()
    heard.on_frame(state("01 00 00 00 14 00 02 01"), 10.05)
    assert heard.answer() is None


def test_before_a_request_an_old_answer_is_none() -> None:
    assert link("01 00 00 00 14 00 00 01").answer() is None


def test_a_number_that_the_watchdog_has_just_answered_is_not_taken() -> None:
    heard = link("01 00 00 00 14 00 01 01")  # answered to the driver that was here before
    assert heard.request_reset().data[0] == 2
    assert heard.answer() is None


def test_the_numbers_go_round_from_255_to_1_and_two_in_a_row_differ() -> None:
    heard = link()
    numbers = [heard.request_reset().data[0] for _ in range(300)]
    assert numbers[:256] == [*range(1, 256), 1]
    assert 0 not in numbers


def test_the_counters_as_docs_bus_md_has_them() -> None:
    heard = link(at=10.0)
    assert heard.counters == WatchdogCounters()
    assert heard.on_counters(Frame(0x2FE, bytes.fromhex("01 02 03 00 ff ff 04 05")), 10.1)
    assert heard.counters == WatchdogCounters(0x201, 3, 0xFFFF, 4, 5)


@pytest.mark.parametrize("frame", [Frame(0x2FE, bytes(7)), Frame(0x2FE), Frame(0x2FD, bytes(8))])
def test_what_are_no_counters_is_dropped(frame: Frame) -> None:
    heard = link()
    assert not heard.on_counters(frame, 10.0)
    assert heard.counters == WatchdogCounters()


def test_counters_alone_do_not_keep_the_watchdog_alive() -> None:
    heard = link(at=10.0)
    heard.on_counters(Frame(0x2FE, bytes(8)), 10.3)
    assert heard.view(10.3)[0] is WatchdogView.MISSING


@pytest.mark.parametrize(("data", "age_s", "rung"), [("01 00 00 00 fe ff 00 00", 65.534, 0), (TRIPPED, math.nan, 1)])
def test_the_age_of_the_lease_and_the_rung(data: str, age_s: float, rung: int) -> None:
    heard = link(data)
    assert heard.lease_age_s == pytest.approx(age_s, nan_ok=True)
    assert heard.rung == rung
    assert math.isnan(WatchdogLink(0.2).lease_age_s)


@pytest.mark.parametrize(("data", "now_s", "hard"), [
    (WATCHING, 10.0, False),
    (WATCHING, 10.2, False),
    (WATCHING, 10.201, True),  # nobody knows
    ("01 00 40 00 14 00 00 00", 10.0, True),
    ("01 00 c0 00 14 00 00 00", 10.0, True),
    ("01 00 80 00 14 00 00 00", 10.0, False),
    ("00 00 40 00 14 00 00 00", 10.0, True),  # still starting
    ("02 03 41 02 ff ff 00 00", 10.0, True),
])  # fmt: skip
def test_whether_to_brake_hard_is_in_its_state_frame_and_unknown_means_hard(
    data: str, now_s: float, hard: bool
) -> None:
    assert link(data).brakes_hard(now_s) is hard
    assert WatchdogLink(timeout_s=0.2).brakes_hard(now_s)


def test_a_frame_that_says_brake_hard_counts_in_its_cycle_whatever_the_next_frame_says() -> None:
    made = WatchdogLink(timeout_s=0.2)
    for at_s, data in ((10.000, "01 00 c0 00 14 00 00 00"), (10.001, "01 00 80 00 14 00 00 00")):
        assert made.on_frame(Frame(0x1FE, bytes.fromhex(data)), at_s)
    assert made.brakes_hard(10.01)
    assert not made.brakes_hard(10.02)
