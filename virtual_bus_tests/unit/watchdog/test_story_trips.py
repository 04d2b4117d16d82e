"""The whole watchdog in virtual time: ordinary days, who fails when, and until when the wheels turn.

Everything goes in steps of 1 ms; the watchdog ticks every 5 ms. Wheels brake with 1 m/s².
"""

from __future__ import annotations

import itertools

import pytest

from canbase_watchdog.frames import Frame
from canbase_watchdog.ladder import Step
from canbase_watchdog.lease import Refusal
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import State
from support.watchdog_story import FakeDrive, Story, lease
from support.watchdog_story_looks import cause, driving, state, step, tripped, until_still, until_tripped

QUICK_STOP = Frame(0x501, bytes.fromhex("02 00"))
HEARTBEAT, STATE, COUNTERS = 0x77E, 0x1FE, 0x2FE


def test_a_minute_of_driving_to_and_fro_does_not_trip() -> None:
    story = Story()
    for bits in itertools.islice(itertools.cycle((300, 0, -300, 150)), 24):
        story.drive_at(bits, 2.5)
    story.word, story.speed = 0x00, 0
    story.run(0.5)
    story.driver = story.filter = False
    story.run(2.0)
    assert state(story) is State.WATCHING


def test_it_is_starting_until_it_has_listened_for_a_heartbeats_time() -> None:
    story = Story()
    story.run(0.299)
    assert state(story) is State.STARTING
    story.run(0.001)
    assert state(story) is State.WATCHING


def test_heartbeat_every_100_ms_and_state_every_50_ms() -> None:
    story = driving()
    for cob_id, period_s in ((HEARTBEAT, 0.1), (STATE, 0.05)):
        times = [at for at, _ in story.since(0.5, cob_id)]
        gaps = [later - earlier for earlier, later in itertools.pairwise(times)]
        assert gaps == pytest.approx([period_s] * len(gaps), abs=0.006)
        assert len(gaps) >= 4


def test_a_wheel_without_power_may_be_pushed() -> None:
    story = Story()
    story.filter = False
    story.run(1.0)
    story.drives[0].speed[0] = 300
    story.drives[0].brakes = False
    story.run(1.0)
    assert state(story) is State.WATCHING


# --- the filter dies:   last lease ──── 0.25 s ──── quick stop ── 0.3 s of braking ── standstill


def test_leases_end_while_the_driver_goes_on() -> None:
    story = driving()
    begin = story.t
    story.filter = False
    assert until_tripped(story) == pytest.approx(0.25, abs=0.025)
    first = story.since(begin, 0x501)[0]
    assert first == (story.t, QUICK_STOP)
    assert story.since(begin, 0x502)[0][0] == story.t
    assert (cause(story), story.watchdog.status.step) == (TripCause.LEASE_LOST, Step.QUICK_STOP)
    assert until_still(story) == pytest.approx(0.3, abs=0.01)


def test_a_lease_a_tick_before_the_end_keeps_it_driving() -> None:
    story = driving()
    last = story.t
    story.filter = False
    story.run(0.24)
    story.watchdog.on_lease(lease(9999, story.t, 0.3), None, story.t)
    story.run(0.24)
    assert story.t > last + 0.4
    assert not tripped(story)


def test_leases_of_somebody_else_do_not_keep_it_driving() -> None:
    story = Story(uid=1001)
    story.drive_at(300, 0.2)
    story.run(0.3)
    assert cause(story) is TripCause.LEASE_LOST


def test_the_state_frame_tells_the_trip_in_the_tick_of_the_trip() -> None:
    story = driving()
    story.filter = False
    until_tripped(story)
    (at, frame), *_ = story.since(story.t, STATE)
    assert (at, frame.data.hex(" ")) == (story.t, "02 01 01 00 fa 00 00 00")


#     last heartbeat ──── 0.3 s ──── quick stop ── standstill, asked for by SDO: no SYNC, no TPDO


# --- the driver dies: kill -9 and kill -STOP look the same on the bus


@pytest.mark.parametrize("bits", [300, -300, 1000])
def test_the_driver_dies_and_leases_go_on(bits: int) -> None:
    story = driving(bits=bits)
    begin = story.t
    story.driver = False
    assert 0.2 <= until_tripped(story) <= 0.31
    assert cause(story) is TripCause.DRIVER_SILENT
    assert until_still(story) <= abs(bits) / 1000 + 0.01
    story.run(0.2)
    status = story.watchdog.status
    assert (status.settled, status.step) == (True, Step.QUICK_STOP)
    assert {frame.data[1:3] for _, frame in story.since(begin, 0x601)} == {b"\x41\x60", b"\x64\x60", b"\x6c\x60"}


# the driver dies ── 0.3 s: stopped ── each 0.5 s one look at drives that nobody asks by SYNC
def test_after_standstill_it_sends_heartbeat_state_and_counters_and_looks_now_and_then() -> None:
    story = driving()
    story.driver = False
    story.run(1.5)
    quiet = story.t
    story.run(1.0)
    sent = [frame for at, frame in story.sent if at > quiet]
    assert {frame.cob_id for frame in sent} == {HEARTBEAT, STATE, COUNTERS, 0x601, 0x602}
    reads = [frame.data[:3].hex() for frame in sent if frame.cob_id == 0x601]
    assert 3 <= len(reads) <= 6
    assert set(reads) == {"404160", "406460", "406c60"}


@pytest.mark.parametrize("lost", ["heartbeat", "sync"])
def test_half_a_driver_is_none(lost: str) -> None:
    story = driving()
    setattr(story, lost, False)
    assert until_tripped(story) <= 0.31
    assert cause(story) is TripCause.DRIVER_SILENT


# --- a drive falls silent: last TPDO ── 0.1 s ── trip; it never answers, so its ladder is climbed to the end


def test_a_silent_drive_stops_the_other_one_without_making_it_coast() -> None:
    left, right = FakeDrive(1), FakeDrive(2)
    story = driving(left, right)
    begin = story.t
    left.mute, left.hears_pdo = True, False
    assert until_tripped(story) <= 0.11
    status = story.watchdog.status
    assert (status.verdict.cause, status.verdict.node_id) == (TripCause.DRIVE_SILENT, 1)
    story.run(0.6)
    assert step(story) is Step.HEARTBEAT_WITHHELD
    assert right.speed[0] == 0
    nmt = {frame.data for _, frame in story.since(begin, 0x000)}
    assert nmt == {b"\x80\x01"}
    assert [frame for _, frame in story.since(begin, 0x602) if frame.data[0] == 0x2B] == []


def test_a_drive_without_heartbeat_is_silent_too() -> None:
    story = driving()
    story.drives[1].beat_at = 1e9
    assert until_tripped(story) <= 0.31
    assert (cause(story), story.watchdog.status.verdict.node_id) == (TripCause.DRIVE_SILENT, 2)


# --- the watchdog itself


@pytest.mark.parametrize(("pause_s", "trips"), [(0.09, False), (0.11, True)])
def test_it_trips_when_it_stood_still_itself(pause_s: float, trips: bool) -> None:
    story = driving()
    story.ticking = False
    story.run(pause_s)
    story.ticking = True
    story.run(0.01)
    assert tripped(story) is trips
    assert cause(story) is (TripCause.LOOP_LATE if trips else TripCause.NONE)


def test_asked_to_end_while_driving_it_stops_first() -> None:
    story = driving()
    story.watchdog.end(story.t)
    story.run(0.005)
    assert cause(story) is TripCause.ENDED
    assert story.since(story.t - 0.004, 0x501)[0][1] == QUICK_STOP
    until_still(story)
    story.run(0.15)
    assert story.watchdog.status.settled


def test_asked_to_end_at_rest_it_does_nothing() -> None:
    story = Story()
    story.run(1.0)
    story.watchdog.end(story.t)
    assert not tripped(story)


def test_asked_to_end_after_a_trip_it_keeps_the_cause() -> None:
    story = driving()
    story.filter = False
    until_tripped(story)
    story.watchdog.end(story.t)
    assert cause(story) is TripCause.LEASE_LOST


def test_quick_stops_for_the_way_out_need_no_state() -> None:
    story = Story(FakeDrive(1), FakeDrive(5, axes=(0, 1)))
    frames = story.watchdog.quick_stops()
    assert frames == [QUICK_STOP, Frame(0x505, bytes.fromhex("02 00 02 00"))]


def test_datagrams_that_are_no_lease_are_counted_by_reason() -> None:
    story = driving()
    for datagram in (b"", b"noise", bytes(44)):
        story.watchdog.on_lease(datagram, None, story.t)
    refused = story.watchdog.refused_leases
    assert {why: count for why, count in refused.items() if count} == {Refusal.LENGTH: 2, Refusal.MAGIC: 1}


def test_its_own_frames_that_come_back_change_nothing() -> None:
    story = driving()
    story.filter = False
    until_tripped(story)
    story.run(0.5)
    before = story.watchdog.status
    for frame in {frame for _, frame in story.sent}:
        story.watchdog.on_frame(frame.cob_id, frame.data, story.t)
    assert story.watchdog.status == before
    assert story.watchdog.dropped_frames == 0


# driving ── the computer is suspended for an hour, and no clock of the watchdog shows it ── quick stop in the next turn
def test_a_computer_that_was_suspended_at_speed_stops_as_soon_as_it_wakes_up() -> None:
    story = driving()
    story.watchdog.on_suspend(3600.0)
    begin = story.t
    story.run(0.006)
    assert [frame for _, frame in story.since(0.006, 0x501)] == [QUICK_STOP]
    assert cause(story) is TripCause.LOOP_LATE
    assert story.t - begin < 0.01


def test_a_suspend_without_power_trips_nothing() -> None:
    story = Story()
    story.run(0.5)
    story.watchdog.on_suspend(3600.0)
    story.run(0.5)
    assert state(story) is State.WATCHING
