"""What the watchdog writes down, and how it starts with what it finds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from canbase_base.latch_record import Defect, Found, Mark, Record, read, whole
from canbase_watchdog import frames
from canbase_watchdog.trip_cause import FINE, TripCause, Verdict, before_the_start, code_of, has_opened
from canbase_watchdog.watchdog import Answer, State, Watchdog
from support.watchdog_story import ENABLED, FakeDrive, Story
from support.watchdog_story_looks import driving, until_tripped

STATE = 0x1FE


def resumed(past: Found, *drives: FakeDrive) -> Story:
    """A watchdog that starts with this record, among drives that are off."""
    story = Story(*drives)
    story.watchdog = Watchdog(story.config, 0.0, past)
    return story


def mark_of(story: Story) -> Mark:
    return story.watchdog.record.mark


def keep(story: Story) -> None:
    story.watchdog.on_record(story.watchdog.record, "")


@pytest.mark.parametrize(
    ("past", "cause", "detail"),
    [
        (Found(Record(Mark.LIVE)), TripCause.POWER_AT_END, "it ended while a drive had power"),
        (Found(Record(Mark.LATCHED, 0x0206, "", "too fast")), TripCause.OVERSPEED, "since before the start: too fast"),
        (
            Found(Record(Mark.LATCHED, 0x0206, "", "since before the start: too fast")),
            TripCause.OVERSPEED,
            "since before the start: too fast",
        ),
        (Found(Record(Mark.LATCHED, 0x0063, "", "?")), TripCause.RECORD_UNUSABLE, "since before the start: ?"),
        (Found(Record(Mark.LATCHED)), TripCause.RECORD_UNUSABLE, "since before the start: "),
        (
            Found(defect=Defect.GARBAGE, detail="/x"),
            TripCause.RECORD_UNUSABLE,
            "cannot be used: the record of stops is damaged (/x)",
        ),
    ],
)
def test_it_starts_tripped(past: Found, cause: TripCause, detail: str) -> None:
    story = resumed(past)
    status = story.watchdog.status
    assert (status.state, status.verdict.cause) == (State.TRIPPED, cause)
    assert detail in status.verdict.detail
    assert story.watchdog.trips == 0
    assert mark_of(story) is Mark.LATCHED
    story.run(1.0)
    assert story.watchdog.status.state is State.TRIPPED
    assert story.reset(1) == Answer.DONE
    story.run(0.1)
    assert mark_of(story) is Mark.CLEAR


def test_it_starts_watching_with_a_clear_record() -> None:
    story = resumed(Found())
    story.run(0.5)
    assert story.watchdog.status.state is State.WATCHING
    assert mark_of(story) is Mark.CLEAR


# start, tripped ── drives booted and off ── no frame to them
def test_drives_that_are_off_are_left_alone() -> None:
    story = resumed(Found(Record(Mark.LIVE)))
    story.run(2.0)
    assert {frame.cob_id for _, frame in story.sent} <= {0x1FE, 0x2FE, 0x77E}


def test_a_drive_that_has_power_is_stopped() -> None:
    drive = FakeDrive(1)
    story = resumed(Found(Record(Mark.LIVE)), drive, FakeDrive(2))
    story.obedient = False
    story.drive_at(300, 0.3)
    story.word, story.speed = 0x06, 0
    story.run(2.0)
    assert story.since(0.0, 0x501) or story.since(0.0, 0x601)
    assert drive.speed[0] == 0


# 0 s start, tripped, no driver ── a drive turns, on its own ── 0.1 s nothing told ── read, and stopped
def test_a_drive_that_is_operational_and_tells_nothing_is_read_before_its_heartbeat_time() -> None:
    drive = FakeDrive(1)
    story = abandoned(drive)
    story.run(0.095)
    assert not story.since(0.0, 0x601)
    story.run(0.02)
    assert story.since(0.0, 0x601)
    story.run(0.15)
    assert drive.words[0] != ENABLED, "before 0.3 s"
    story.run(1.0)
    assert drive.speed[0] == 0


@pytest.mark.parametrize(
    ("nmt", "beats", "read_from_s"),
    [(0x7F, True, 0.3), (0x04, True, 0.3), (0x05, True, 0.1), (0x7F, False, 0.15), (0x04, False, 0.15)],
)
def test_a_drive_that_a_driver_may_boot_is_read_after_its_heartbeat_time(
    nmt: int, beats: bool, read_from_s: float
) -> None:
    """Without heartbeats of a driver it is read after half of it: drives leave operational when they miss them."""
    story = abandoned(FakeDrive(1, nmt=nmt))
    for _ in range(15):
        if beats:
            story.watchdog.on_frame(0x77F, b"\x05", story.t)
        story.run(0.1)
    times = [at_s for at_s, _ in story.since(0.0, 0x601)]
    assert times[0] == pytest.approx(read_from_s, abs=0.006)


# 0.1 s each 50 ms ── 1.1 s no answer yet ── each 0.5 s: the SDO channel is free for a tool
def test_a_drive_that_answers_no_reading_is_read_seldom_after_a_second() -> None:
    story = abandoned(FakeDrive(1, hears_sdo=False))
    story.run(5.0)
    times = [at_s for at_s, _ in story.since(0.0, 0x601)]
    assert times[0] == pytest.approx(0.1, abs=0.006)
    assert len([at_s for at_s in times if at_s < 1.2]) == 20
    assert len([at_s for at_s in times if at_s >= 1.2]) in (7, 8)


def test_a_patience_for_feedback_beyond_the_heartbeat_time_delays_no_reading() -> None:
    story = abandoned(FakeDrive(1), feedback_timeout_s=0.5)
    for _ in range(10):
        story.watchdog.on_frame(0x77F, b"\x05", story.t)
        story.run(0.1)
    times = [at_s for at_s, _ in story.since(0.0, 0x601)]
    assert times[0] == pytest.approx(0.3, abs=0.006)


# 0 s start ── 0.05 s a client reads its identity, and the drive still reports operational ── 0.35 s read
def test_a_drive_that_is_configured_is_read_after_its_heartbeat_time_although_it_is_operational() -> None:
    story = abandoned(FakeDrive(1))
    story.run(0.05)
    story.watchdog.on_frame(0x601, bytes.fromhex("40 18 10 01 00 00 00 00"), story.t)
    story.run(1.0)
    times = [at_s for at_s, _ in story.since(0.0, 0x601)]
    assert times[0] == pytest.approx(0.35, abs=0.006)


def abandoned(drive: FakeDrive, **changes: Any) -> Story:
    """A watchdog that starts with a latched record beside a drive that has power and turns; driver and filter died.

    `changes`: of its configuration.
    """
    story = resumed(Found(defect=Defect.GARBAGE, detail="/x"), drive, FakeDrive(2, mute=True))
    story.watchdog = Watchdog(replace(story.config, **changes), 0.0, Found(defect=Defect.GARBAGE, detail="/x"))
    story.driver = story.heartbeat = story.sync = story.filter = False
    drive.words[0], drive.target[0], drive.speed[0] = ENABLED, 300, 300.0
    return story


def test_no_reset_before_the_drives_were_seen_to_stand() -> None:
    drive = FakeDrive(1)
    story = resumed(Found(Record(Mark.LIVE)), drive, FakeDrive(2))
    story.sync = False  # heartbeats, and no feedback
    story.run(0.2)
    assert story.reset(1) == Answer.CAUSE_STANDS
    story.sync = True
    story.run(1.0)
    assert story.reset(2) == Answer.DONE


def test_a_reset_needs_no_drive_that_was_never_there() -> None:
    story = resumed(Found(Record(Mark.LIVE)))
    for drive in story.drives:
        drive.mute = True
    story.word = 0x00
    story.run(1.0)
    assert story.reset(1) == Answer.DONE
    story.run(0.1)
    assert mark_of(story) is Mark.CLEAR


# switched on ── LIVE wanted ── on disk ── bit 7 ── enabled
def test_the_bit_is_set_when_live_is_on_disk() -> None:
    story = resumed(Found())
    story.run(0.4)
    for drive in story.drives:
        drive.words[0] = 0x0233
    assert not story.watchdog.sees_power
    story.run(0.1)
    assert mark_of(story) is Mark.LIVE
    assert story.watchdog.sees_power
    assert not story.watchdog.status.armed
    assert story.since(0.0, STATE)[-1][1].data[2] == 0
    story.watchdog.on_record(None, "read-only file system")
    story.run(0.1)
    assert not story.watchdog.status.armed
    keep(story)
    story.run(0.1)
    assert story.watchdog.status.armed
    assert story.since(0.0, STATE)[-1][1].data[2] == frames.ARMED


def test_it_stays_live_until_the_power_was_seen_to_be_off() -> None:
    story = resumed(Found())
    for drive in story.drives:
        drive.words[0] = 0x0233
    story.run(0.4)
    assert mark_of(story) is Mark.LIVE
    story.drives[0].mute = True
    story.word = 0x00
    story.run(0.5)
    assert mark_of(story) is Mark.LIVE
    story.drives[0].mute = False
    story.run(0.5)
    assert story.watchdog.status.state is State.WATCHING
    assert mark_of(story) is Mark.CLEAR


def test_clear_again_when_all_drives_are_off() -> None:
    story = driving()
    story.speed = 0
    story.run(1.0)
    story.word = 0x00
    story.run(0.2)
    assert story.watchdog.status.state is State.WATCHING
    assert mark_of(story) is Mark.CLEAR


def test_a_trip_is_written_with_its_cause_and_cleared_by_the_reset_alone() -> None:
    story = driving()
    story.filter = False
    until_tripped(story)
    record = story.watchdog.record
    assert (record.mark, record.code) == (Mark.LATCHED, TripCause.LEASE_LOST)
    story.run(2.0)
    assert story.watchdog.record == record
    story.filter = True
    story.run(0.3)
    assert story.reset(7) == Answer.DONE
    story.run(0.1)
    assert mark_of(story) is Mark.CLEAR


def test_a_trip_at_the_end_is_written() -> None:
    story = driving()
    story.watchdog.end(story.t)
    assert (story.watchdog.record.mark, story.watchdog.record.code) == (Mark.LATCHED, TripCause.ENDED)


def test_a_readable_clear_record_is_no_cause() -> None:
    assert before_the_start(Found()) is FINE


# 0 s a wheel does not brake ── 0.3 s power off, relay open ── killed ── its next life: the relay stays open
def test_a_relay_that_a_runaway_wheel_has_opened_stays_open_until_the_reset_over_a_restart() -> None:
    drive = FakeDrive(1)
    story = driving(drive)
    drive.brakes = story.filter = story.obedient = False
    until_tripped(story)
    assert not has_opened(story.watchdog.record)
    story.run(0.5)
    assert not story.watchdog.keeps_relay
    owner = b"carl".ljust(32)
    next_life = resumed(read(whole(story.watchdog.record, owner), owner))
    assert not next_life.watchdog.keeps_relay
    next_life.run(2.0)
    assert not next_life.watchdog.keeps_relay
    assert has_opened(next_life.watchdog.record), "a third life must know it too"
    assert next_life.reset(1) == Answer.DONE
    next_life.run(0.1)
    assert next_life.watchdog.keeps_relay
    assert not has_opened(next_life.watchdog.record)


def test_a_trip_that_did_not_open_the_relay_leaves_it_closed_over_a_restart() -> None:
    """A drive may need its supply to report, before a reset, that it has no power."""
    story = driving(FakeDrive(1))
    story.filter = False
    until_tripped(story)
    story.run(2.0)
    assert story.watchdog.keeps_relay
    assert resumed(Found(story.watchdog.record)).watchdog.keeps_relay


# a drive is silent, another one does not brake, and the relay feeds both ── restart ── neither answers ── reset: done
def test_a_drive_that_an_open_relay_leaves_without_supply_keeps_no_reset_away() -> None:
    for opened, answer in ((True, Answer.DONE), (False, Answer.CAUSE_STANDS)):
        code = code_of(Verdict(TripCause.DRIVE_SILENT, 1), opened=opened)
        story = resumed(
            Found(Record(Mark.LATCHED, code, "", "no feedback")), FakeDrive(1, mute=True), FakeDrive(2, mute=True)
        )
        story.run(1.0)
        assert story.reset(1) == answer
