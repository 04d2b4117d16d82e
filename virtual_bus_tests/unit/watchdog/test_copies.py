"""Frames that are sent again, by a gateway or a second interface: what a person checks first. Times in s."""

from __future__ import annotations

import pytest

from canbase_watchdog.copies import COPY_S, WITHIN_S, Copies, SentAgain

A, B = b"\x0f\x00\x10\x00\x00\x00", b"\x0f\x00\x20\x00\x00\x00"


def syncs(sent: SentAgain, frames: int, copies: int, at: float = 0.0) -> None:
    """So many SYNCs, 10 ms apart, the first one at `at`; so many of them come again 1 ms later, the first ones."""
    for n in range(frames):
        sent.on_sync(at + 0.01 * n)
        if n < copies:
            sent.on_sync(at + 0.01 * n + 0.001)


def setpoints(sent: SentAgain, frames: int, copies: int = 0) -> None:
    for n in range(frames):
        sent.on_setpoint(0x201, A, 1.0 + 0.01 * n)
        if n < copies:
            sent.on_setpoint(0x201, A, 1.0 + 0.01 * n + 0.001)


# One identifier


@pytest.mark.parametrize(("after_s", "copy"), [(0.0, True), (0.001, True), (COPY_S, True), (0.0021, False)])
def test_a_copy_follows_its_frame_within_2_ms(after_s: float, copy: bool) -> None:
    frames = Copies()
    assert not frames.note_frame(A, 0.0)
    assert frames.note_frame(A, after_s) is copy
    assert frames.at == (after_s if copy else float("-inf"))


def test_other_data_is_no_copy() -> None:
    frames = Copies()
    assert not frames.note_frame(A, 0.0)
    assert not frames.note_frame(B, 0.001)


def test_a_third_frame_is_no_copy_of_a_copy() -> None:
    frames = Copies()
    assert [frames.note_frame(A, at) for at in (0.0, 0.0005, 0.001, 0.0015)] == [False, True, False, True]


# Whether a stop is more likely due to copies than to another master


def test_without_copies_of_syncs_it_is_not_likely() -> None:
    sent = SentAgain(loopback=False)
    syncs(sent, 10, 0)
    assert not sent.is_likely(0.1)


def test_the_first_copy_of_a_sync_is_enough_while_nothing_else_was_sent() -> None:
    sent = SentAgain(loopback=False)
    sent.on_sync(0.0)
    sent.on_sync(0.001)
    assert sent.is_likely(0.001)


@pytest.mark.parametrize(("later_s", "likely"), [(9.5, True), (WITHIN_S, True), (10.5, False)])
def test_a_copy_counts_for_10_s(later_s: float, likely: bool) -> None:
    sent = SentAgain(loopback=False)
    sent.on_sync(-0.001)
    sent.on_sync(0.0)
    assert sent.is_likely(later_s) is likely


# share of SYNCs with copies × other frames: copies that were to come
@pytest.mark.parametrize(
    ("frames", "copies", "others", "likely"),
    [(1, 1, 2, True), (1, 1, 3, False), (2, 1, 5, True), (2, 1, 6, False), (4, 1, 8, True), (4, 1, 12, False)],
)
def test_three_setpoints_that_lack_their_copies_are_no_chance(
    frames: int, copies: int, others: int, likely: bool
) -> None:
    sent = SentAgain(loopback=False)
    syncs(sent, frames, copies)
    setpoints(sent, others)
    assert sent.is_likely(1.0) is likely


def test_one_copy_of_a_setpoint_is_enough() -> None:
    sent = SentAgain(loopback=False)
    syncs(sent, 20, 20)
    setpoints(sent, 20, copies=1)
    assert sent.is_likely(1.0)


def test_setpoints_of_two_axes_are_no_copies_of_each_other() -> None:
    sent = SentAgain(loopback=False)
    syncs(sent, 3, 3)
    for n in range(3):
        sent.on_setpoint(0x201, A, 1.0 + 0.01 * n)
        sent.on_setpoint(0x202, A, 1.001 + 0.01 * n)
    assert not sent.is_likely(1.0)


@pytest.mark.parametrize(("echo", "likely"), [(True, False), (False, True)])
def test_heartbeats_of_the_watchdog_lack_copies_only_where_they_come_back(echo: bool, likely: bool) -> None:
    sent = SentAgain(loopback=echo)
    syncs(sent, 10, 10)
    for n in range(3):
        sent.on_own(0.2 + 0.1 * n)
    assert sent.is_likely(0.5) is likely


def test_copies_of_the_own_heartbeats_are_likely_copies() -> None:
    sent = SentAgain(loopback=True)
    syncs(sent, 10, 10)
    for n in range(3):
        sent.on_own(0.2 + 0.1 * n)
        sent.on_own(0.2005 + 0.1 * n)
    assert sent.is_likely(0.5)


# When a count begins


def test_what_was_sent_before_the_first_copy_does_not_count() -> None:
    sent = SentAgain(loopback=False)
    setpoints(sent, 4)
    sent.on_sync(2.0)
    sent.on_sync(2.001)
    assert sent.is_likely(2.1)


@pytest.mark.parametrize(("second_s", "likely"), [(WITHIN_S, False), (10.5, True)])
def test_copies_more_than_10_s_apart_begin_a_new_count(second_s: float, likely: bool) -> None:
    sent = SentAgain(loopback=False)
    sent.on_sync(-0.001)
    sent.on_sync(0.0)
    setpoints(sent, 20)
    sent.on_sync(second_s - 0.001)
    sent.on_sync(second_s)
    assert sent.is_likely(second_s) is likely
