"""The whole watchdog in virtual time: who fails when, what it sends when, and until when the wheels turn.

Everything goes in steps of 1 ms; the watchdog ticks every 5 ms. Wheels brake with 1 m/s².
"""

from __future__ import annotations

import itertools

import pytest

from canbase_watchdog.frames import Frame
from canbase_watchdog.ladder import Step
from canbase_watchdog.policy import Cause
from canbase_watchdog.watchdog import Answer, State
from unit.watchdog_story import ENABLED, FAULT, SOD, FakeDrive, Story, lease

QUICK_STOP = Frame(0x501, bytes.fromhex("02 00"))
HEARTBEAT, STATE, COUNTERS = 0x77E, 0x1FE, 0x2FE


def cause(story: Story) -> Cause:
    return story.watchdog.status.verdict.cause


def state(story: Story) -> State:
    return story.watchdog.status.state


def step(story: Story) -> Step:
    return story.watchdog.status.step


def tripped(story: Story) -> bool:
    return state(story) is State.TRIPPED


def speeds(story: Story) -> list[float]:
    return [speed for drive in story.drives for speed in drive.speed.values()]


def until_tripped(story: Story, limit_s: float = 1.0) -> float:
    """Run until it trips; seconds that it took."""
    begin = story.t
    while not tripped(story):
        assert story.t < begin + limit_s, "it did not trip"
        story.run(0.001)
    return story.t - begin


def until_still(story: Story, limit_s: float = 2.0) -> float:
    begin = story.t
    while any(abs(speed) > 0 for speed in speeds(story)):
        assert story.t < begin + limit_s, "the wheels still turn"
        story.run(0.001)
    return story.t - begin


def driving(*drives: FakeDrive, bits: int = 300) -> Story:
    story = Story(*drives)
    story.drive_at(bits, 1.2)
    assert speeds(story) == [bits] * len(speeds(story))
    return story


# --- ordinary days


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
    assert (cause(story), story.watchdog.status.step) == (Cause.LEASE_LOST, Step.QUICK_STOP)
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
    assert cause(story) is Cause.LEASE_LOST


def test_the_state_frame_tells_the_trip_in_the_tick_of_the_trip() -> None:
    story = driving()
    story.filter = False
    until_tripped(story)
    (at, frame), *_ = story.since(story.t, STATE)
    assert (at, frame.data.hex(" ")) == (story.t, "02 01 01 00 fa 00 00 00")


# --- the driver dies: kill -9 and kill -STOP look the same on the bus
#     last heartbeat ──── 0.3 s ──── quick stop ── standstill, asked for by SDO: no SYNC, no TPDO


@pytest.mark.parametrize("bits", [300, -300, 1000])
def test_the_driver_dies_and_leases_go_on(bits: int) -> None:
    story = driving(bits=bits)
    begin = story.t
    story.driver = False
    assert 0.2 <= until_tripped(story) <= 0.31
    assert cause(story) is Cause.DRIVER_SILENT
    assert until_still(story) <= abs(bits) / 1000 + 0.01
    story.run(0.2)
    status = story.watchdog.status
    assert (status.settled, status.step) == (True, Step.QUICK_STOP)
    assert {frame.data[1:3] for _, frame in story.since(begin, 0x601)} == {b"\x41\x60", b"\x6c\x60"}


def test_after_standstill_it_is_quiet_except_for_heartbeat_state_and_counters() -> None:
    story = driving()
    story.driver = False
    story.run(1.5)
    quiet = story.t
    story.run(1.0)
    assert {frame.cob_id for at, frame in story.sent if at > quiet} == {HEARTBEAT, STATE, COUNTERS}


@pytest.mark.parametrize("lost", ["heartbeat", "sync"])
def test_half_a_driver_is_none(lost: str) -> None:
    story = driving()
    setattr(story, lost, False)
    assert until_tripped(story) <= 0.31
    assert cause(story) is Cause.DRIVER_SILENT


# --- a drive falls silent: last TPDO ── 0.1 s ── trip; it never answers, so its ladder is climbed to the end


def test_a_silent_drive_stops_the_other_one_without_making_it_coast() -> None:
    left, right = FakeDrive(1), FakeDrive(2)
    story = driving(left, right)
    begin = story.t
    left.mute, left.hears_pdo = True, False
    assert until_tripped(story) <= 0.11
    status = story.watchdog.status
    assert (status.verdict.cause, status.verdict.node_id) == (Cause.DRIVE_SILENT, 1)
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
    assert (cause(story), story.watchdog.status.verdict.node_id) == (Cause.DRIVE_SILENT, 2)


# --- the watchdog itself


@pytest.mark.parametrize(("pause_s", "trips"), [(0.09, False), (0.11, True)])
def test_it_trips_when_it_stood_still_itself(pause_s: float, trips: bool) -> None:
    story = driving()
    story.ticking = False
    story.run(pause_s)
    story.ticking = True
    story.run(0.01)
    assert tripped(story) is trips
    assert cause(story) is (Cause.LOOP_LATE if trips else Cause.NONE)


def test_asked_to_end_while_driving_it_stops_first() -> None:
    story = driving()
    story.watchdog.end(story.t)
    story.run(0.005)
    assert cause(story) is Cause.ENDED
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
    assert cause(story) is Cause.LEASE_LOST


def test_quick_stops_for_the_way_out_need_no_state() -> None:
    story = Story(FakeDrive(1), FakeDrive(5, axes=(0, 1)))
    frames = story.watchdog.quick_stops()
    assert frames == [QUICK_STOP, Frame(0x505, bytes.fromhex("02 00 02 00"))]


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


# --- against a driver that goes on commanding


def mad(*drives: FakeDrive) -> Story:
    """Driving, then leases end; the driver does not care and commands on."""
    story = driving(*drives)
    story.obedient = False
    story.filter = False
    until_tripped(story)
    return story


def test_a_drive_that_leaves_quick_stop_by_itself_stays_off() -> None:
    drive = FakeDrive(1)
    story = mad(drive)
    until_still(story)
    assert until_still(story) == 0


def test_a_drive_that_is_enabled_again_and_again_is_taken_out_of_operational() -> None:
    """605Ah = 6: each 0Fh of the driver enables it again, so the quick stop alone never wins.

    trip ── quick stop each 10 ms against 0Fh each 10 ms ── 0.15 s ── NMT pre-operational, quick stop by SDO ── stands
    """
    story = mad(FakeDrive(1, option=6))
    trip = story.t
    story.run(0.14)
    assert story.since(trip, 0x000) == []
    story.run(0.02)
    at, frame = story.since(trip, 0x000)[0]
    assert at == pytest.approx(trip + 0.15, abs=0.006)
    assert frame == Frame(0x000, b"\x80\x01")
    assert Frame(0x601, bytes.fromhex("2b 40 60 00 02 00 00 00")) in [f for _, f in story.since(at, 0x601)]
    until_still(story)
    story.run(3.0)
    assert speeds(story) == [0]
    assert step(story) is Step.PRE_OPERATIONAL


def test_a_driver_that_starts_the_drives_again_is_answered_by_the_next_rung() -> None:
    story = mad(FakeDrive(1, option=6))
    until_still(story)
    story.run(0.5)
    story.put(Frame(0x000, b"\x01\x01"))
    story.run(0.1)
    assert step(story) is Step.DISABLE_VOLTAGE
    story.run(1.0)
    assert speeds(story) == [0]
    assert story.drives[0].words[0] == SOD


def test_a_drive_that_ignores_the_quick_stop_has_its_voltage_disabled() -> None:
    story = mad(FakeDrive(1, hears_quick_stop=False))
    trip = story.t
    story.run(0.45)
    assert Frame(0x601, bytes.fromhex("2b 40 60 00 00 00 00 00")) in [f for _, f in story.since(trip, 0x601)]
    assert story.drives[0].words[0] == SOD
    story.run(0.5)
    status = story.watchdog.status
    assert (status.settled, status.step, speeds(story)) == (True, Step.DISABLE_VOLTAGE, [0])


def test_a_drive_that_says_quick_stop_and_does_not_brake_climbs_after_its_braking_time() -> None:
    drive = FakeDrive(1)
    story = driving(drive)
    drive.brakes = story.filter = story.obedient = False
    until_tripped(story)
    story.run(0.59)
    assert step(story) is Step.QUICK_STOP
    story.run(0.03)
    assert step(story) is Step.PRE_OPERATIONAL


def test_a_drive_that_hears_nothing_at_all_loses_the_heartbeat_until_the_reset() -> None:
    drive = FakeDrive(1)
    story = driving(drive)
    drive.hears_pdo = drive.hears_sdo = drive.hears_nmt = False
    story.filter = False
    until_tripped(story)
    story.run(0.5)
    assert step(story) is Step.HEARTBEAT_WITHHELD
    withheld = story.t
    story.run(1.0)
    assert story.since(withheld, HEARTBEAT) == []
    assert story.since(withheld, STATE)[-1][1].data[:3] == b"\x02\x01\x04"
    drive.hears_sdo = story.filter = True
    story.run(1.0)
    assert story.since(withheld, HEARTBEAT) == []
    assert story.reset(1) == Answer.DONE
    story.run(0.02)
    assert story.since(withheld, HEARTBEAT) != []


def test_targets_against_a_stopped_drive_are_answered_by_quick_stops() -> None:
    story = mad(FakeDrive(1))
    until_still(story)
    story.word = 0x06
    story.run(0.5)
    story.obedient = True
    story.run(0.5)
    quiet = story.t
    assert story.since(quiet - 0.1, 0x501) == []
    story.obedient, story.speed = False, 100
    story.run(0.1)
    assert len(story.since(quiet, 0x501)) >= 8


def test_two_axes_of_one_node_are_stopped_together() -> None:
    drive = FakeDrive(5, axes=(0, 1))
    story = driving(drive)
    begin = story.t
    story.driver = False
    until_tripped(story)
    assert story.since(begin, 0x505)[0][1] == Frame(0x505, bytes.fromhex("02 00 02 00"))
    until_still(story)
    story.run(0.3)
    assert story.watchdog.status.settled
    asked = {frame.data[1:3].hex() for _, frame in story.since(begin, 0x605)}
    assert asked == {"4160", "6c60", "4168", "6c68"}


def test_a_target_for_one_of_two_axes_is_enough_to_stop_their_node() -> None:
    story = Story(FakeDrive(5, axes=(0, 1)))
    story.drive_at(300)
    story.filter = False
    until_tripped(story)
    story.run(1.5)
    quiet, story.driver = story.t, False
    story.put(Frame(0x305, bytes.fromhex("06 00 01 00 00 00")))
    story.run(0.1)
    assert len(story.since(quiet, 0x505)) >= 8


def test_a_configured_drive_that_was_never_there_does_not_hold_up_the_rest() -> None:
    story = Story(FakeDrive(1), FakeDrive(9, mute=True))
    story.run(0.5)
    story.drives[0].words[0] = ENABLED
    story.drives[0].speed[0] = 300
    story.driver = False
    story.put(Frame(0x080, b""))
    until_tripped(story)
    story.run(1.0)
    assert story.watchdog.status.settled


# --- reset


def stopped() -> Story:
    """Tripped by a lost lease, standing, the filter back with zeros and the driver obedient."""
    story = driving()
    story.filter = False
    until_tripped(story)
    story.run(1.0)
    story.filter = True
    story.run(0.3)
    return story


def test_a_trip_is_latched_until_a_reset() -> None:
    story = stopped()
    story.run(2.0)
    assert tripped(story)
    assert story.reset(7) == Answer.DONE
    story.run(0.005)
    assert story.since(story.t, STATE)[0][1].data[:4].hex(" ") == "01 00 00 00"
    assert story.since(story.t, STATE)[0][1].data[6:].hex(" ") == "07 01"
    story.drive_at(200)
    assert not tripped(story)


def test_a_reset_without_a_trip_says_so() -> None:
    story = Story()
    story.run(0.5)
    assert story.reset(1) == Answer.NOT_TRIPPED


def test_no_reset_while_the_cause_stands() -> None:
    story = stopped()
    story.filter = False
    story.run(0.3)
    assert story.reset(1) == Answer.CAUSE_STANDS
    assert tripped(story)


def test_no_reset_while_a_wheel_still_turns() -> None:
    story = driving()
    story.filter = False
    until_tripped(story)
    story.filter = True
    story.run(0.1)
    assert story.reset(1) == Answer.CAUSE_STANDS


def test_no_reset_while_the_filter_or_the_driver_orders_motion() -> None:
    story = stopped()
    story.ordered_mps = 0.1
    story.run(0.1)
    assert story.reset(1) == Answer.VELOCITY_ORDERED
    story.ordered_mps = None
    story.run(0.1)
    story.obedient, story.word, story.speed, story.ordered_mps = False, 0x06, 1, 0.0
    story.run(0.1)
    assert story.reset(2) == Answer.VELOCITY_ORDERED
    story.speed = 0
    story.run(0.05)
    assert story.reset(3) == Answer.DONE


def test_copies_of_a_request_are_not_answered_again() -> None:
    story = stopped()
    assert story.reset(1) == Answer.DONE
    story.run(0.5)
    assert story.reset(1) == Answer.DONE
    story.run(0.6)
    assert story.reset(1) == Answer.NOT_TRIPPED  # too late for a copy


@pytest.mark.parametrize("data", ["", "01", "01 52 53 55", "00 52 53 54", "01 52 53 54 00"])
def test_what_is_no_request_resets_nothing(data: str) -> None:
    story = stopped()
    story.put(Frame(0x27E, bytes.fromhex(data)))
    assert tripped(story)
    assert story.watchdog.dropped_frames == 1


def test_after_the_driver_died_a_new_one_can_reset() -> None:
    story = driving()
    story.driver = False
    story.run(1.5)
    assert story.reset(1) == Answer.CAUSE_STANDS
    story.driver = True
    story.run(0.3)
    assert story.reset(2) == Answer.DONE


def test_after_a_drive_was_silent_its_heartbeat_is_enough_to_reset() -> None:
    left, right = FakeDrive(1), FakeDrive(2)
    story = driving(left, right)
    left.mute = True
    story.run(1.5)
    assert story.reset(1) == Answer.CAUSE_STANDS
    left.mute, left.words[0], left.speed[0] = False, SOD, 0
    story.run(0.5)
    assert left.nmt == 0x7F  # the driver has not started it again yet
    assert story.reset(2) == Answer.DONE


def test_a_drive_in_fault_is_stopped_when_it_stands() -> None:
    story = driving()
    story.drives[0].words[0] = FAULT
    story.filter = False
    story.run(2.0)
    assert story.watchdog.status.settled
