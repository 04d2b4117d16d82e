"""The whole watchdog in virtual time against drives and drivers that do not obey it: rung by rung.

Everything goes in steps of 1 ms; the watchdog ticks every 5 ms. Wheels brake with 1 m/s².
"""

from __future__ import annotations

import pytest

from canbase_watchdog.frames import Frame
from canbase_watchdog.ladder import Step
from canbase_watchdog.watchdog import Answer
from support.watchdog_story import ENABLED, SOD, FakeDrive, Story
from support.watchdog_story_looks import driving, speeds, step, until_still, until_tripped

HEARTBEAT, STATE = 0x77E, 0x1FE
POWER_OFF, PRE_OP = Frame(0x501, b"\x00\x00"), Frame(0x000, b"\x80\x01")
SDO_OFF = Frame(0x601, bytes.fromhex("2b 40 60 00 00 00 00 00"))


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

    trip ── quick stop each 10 ms against 0Fh each 10 ms ── 0.15 s ── pre-operational, quick stop by SDO ── stands, off
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
    assert (speeds(story), step(story)) == ([0], Step.PRE_OPERATIONAL)
    story.run(3.0)  # it goes on holding the wheel: its power goes too
    assert (speeds(story), step(story)) == ([0], Step.DISABLE_VOLTAGE)
    assert story.drives[0].words[0] == SOD


def test_a_driver_that_starts_the_drives_again_is_answered_by_the_next_rung() -> None:
    story = mad(FakeDrive(1, option=6))
    until_still(story)
    story.run(0.1)
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


def test_a_drive_that_says_quick_stop_and_does_not_brake_has_its_power_taken_when_it_should_be_slower() -> None:
    """trip at 0.3 m/s ── 0.1 s of lag ── 0.5 m/s² from 0.38 m/s on: below 0.3 m/s after 0.26 s ── three samples."""
    drive = FakeDrive(1)
    story = driving(drive)
    drive.brakes = story.filter = story.obedient = False
    until_tripped(story)
    story.run(0.26)
    assert step(story) is Step.QUICK_STOP
    story.run(0.04)
    assert step(story) is Step.DISABLE_VOLTAGE
    assert not story.watchdog.keeps_relay


def test_a_wheel_that_gets_faster_has_its_power_taken_within_five_samples_whatever_the_driver_sends() -> None:
    """Power by PDO first, then pre-operational, which makes the node deaf to PDOs, then by SDO: all in one cycle."""
    drive = FakeDrive(1)
    story = driving(drive)
    drive.runs_away_mps2, story.filter, story.obedient = 4.0, False, False
    until_tripped(story)
    trip = story.t
    story.run(0.07)
    assert (step(story), drive.words[0]) == (Step.DISABLE_VOLTAGE, SOD)
    off = [frame for at, frame in story.sent if at > trip and frame in (POWER_OFF, PRE_OP, SDO_OFF)]
    assert off[:3] == [POWER_OFF, PRE_OP, SDO_OFF]
    assert not story.watchdog.keeps_relay
    assert max(speeds(story)) < 600
    assert story.since(story.t - 0.1, HEARTBEAT) != []  # only the last rung withholds it


def test_a_sensor_that_lies_costs_the_power_with_the_trip_and_a_stand_is_assumed_after_rolling_out() -> None:
    """606Ch and 6064h part ── trip and power off in one cycle ── 2 s without power: it has rolled out."""
    drive = FakeDrive(1)
    story = driving(drive)
    drive.shows = 0
    until_tripped(story)
    trip = story.t
    assert step(story) is Step.DISABLE_VOLTAGE
    story.run(0.01)
    assert drive.words[0] == SOD
    story.run(1.9)
    assert not story.watchdog.status.settled
    assert story.reset(1) == Answer.CAUSE_STANDS
    story.run(0.3)
    assert story.watchdog.status.settled
    assert story.watchdog.status.assumed
    assert story.t - trip < 2.3
    assert story.reset(2) == Answer.DONE
    assert not story.watchdog.status.assumed


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
    assert story.since(withheld, STATE)[-1][1].data[:3] == b"\x02\x01\x05"
    drive.hears_sdo = story.filter = True
    story.run(1.0)
    assert story.since(withheld, HEARTBEAT) == []
    assert story.reset(1) == Answer.DONE
    story.run(0.02)
    assert story.since(withheld, HEARTBEAT) != []


RESET = Frame(0x000, b"\x81\x01")


def keeps_power(drive: FakeDrive) -> Story:
    """Driving, then its leases end: it hears its masters, and takes no controlword (as in a fault reaction)."""
    story = driving(drive)
    drive.hears_pdo = drive.hears_quick_stop = False
    drive.control = lambda axis, word: None  # type: ignore[method-assign]
    drive.brakes = story.filter = story.obedient = False
    until_tripped(story)
    return story


def test_a_drive_that_takes_no_controlword_is_reset_and_has_no_power() -> None:
    """trip ── 0.3 s ── power off ── 0.1 s ── heartbeat withheld, relay open ── 0.1 s ── NMT reset node."""
    drive = FakeDrive(1)
    story = keeps_power(drive)
    trip = story.t
    story.run(0.45)
    assert story.since(trip, 0x000) != []
    assert RESET not in [frame for _, frame in story.since(trip, 0x000)]
    assert step(story) is Step.HEARTBEAT_WITHHELD
    story.run(0.15)
    assert drive.words[0] == SOD
    assert step(story) is Step.RESET_NODE
    drive.brakes = True
    until_still(story)
    story.run(2.0)
    resets = [at for at, frame in story.since(trip, 0x000) if frame == RESET]
    assert len(resets) == 1
    assert resets[0] - trip == pytest.approx(0.5, abs=0.02)
    assert drive.words[0] == SOD  # and nothing switches it on again
    assert story.since(story.t - 1.0, HEARTBEAT) == []
    assert story.watchdog.status.settled
    story.filter, story.obedient = True, True
    story.run(0.3)
    assert story.reset(1) == Answer.DONE


def test_a_drive_that_keeps_its_power_through_a_reset_is_reset_once_a_second() -> None:
    drive = FakeDrive(1)
    story = keeps_power(drive)
    trip = story.t
    words = drive.words

    def hold() -> None:
        drive.words = {0: ENABLED}

    story.on_step = hold
    story.run(3.2)
    resets = [at for at, frame in story.since(trip, 0x000) if frame == RESET]
    assert [round(at - resets[0], 1) for at in resets] == [0.0, 1.0, 2.0]
    assert words is not drive.words


def test_a_drive_that_is_not_heard_any_more_is_not_reset() -> None:
    """It may have obeyed long ago, and its own watch over its masters is what is left."""
    drive = FakeDrive(1)
    story = keeps_power(drive)
    drive.mute = True
    trip = story.t
    story.run(3.0)
    assert step(story) is Step.HEARTBEAT_WITHHELD
    assert RESET not in [frame for _, frame in story.since(trip, 0x000)]


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
    assert asked == {"4160", "6460", "6c60", "4168", "6468", "6c68"}


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
