"""Recordings that begin after an earlier stop, end with the stop itself, or have two stops within three seconds."""

from __future__ import annotations

import functools

import pytest

from canbase_campaign.cruise import Cruise
from canbase_campaign.robots import campaign_robot
from canbase_campaign.twins import JOYSTICK
from canbase_driver.runtime import black_box_notes as written
from canbase_recording.cause import Cause
from canbase_recording.entry import Entry, Note, RecordedFrame
from canbase_recording.explain_text import standstill_sentence
from canbase_recording.explanation import explain
from canbase_recording.story import Story
from canbase_runtime.driver_state import DriverState
from canbase_velocity.twist import ZERO, Twist
from support.recorded_world import WorldRecorder, recorded, twin

ROBOT = campaign_robot()
HANGS_S, BOX_S = 16.0, 10.0
TITLE = written.title("motor_driver", "stop requested", "service motor_driver/stop")


class Robot:
    """Drives by its joystick, and is recorded from now on."""

    def __init__(self) -> None:
        self.cruise = Cruise(JOYSTICK)
        self.world = self.cruise.world
        self.recorder = WorldRecorder(self.world)

    def wait(self, seconds: float) -> None:
        self.world.clock.run_until(self.world.clock.now_s + seconds)

    def reset(self) -> None:
        """Until the drives have power; the joystick was at zero, and is again in the middle."""
        self.cruise.ordered = ZERO
        for _ in range(8):
            self.wait(1.0)
            self.world.driver.reset([])
            if self.world.driver.core.state is DriverState.ENABLED:
                return
        raise AssertionError(self.world.driver.core.state)


@functools.cache
def after_a_hang() -> tuple[Entry, ...]:
    """Drives ── the driver hangs for 16 s ── reset ── at standstill a stop is requested: the 10 s after the hang."""
    robot = Robot()
    robot.wait(1.0)
    robot.world.processes["driver"].hang("a test")
    robot.wait(HANGS_S)
    robot.world.processes["driver"].go_on("a test")
    resumed_s = robot.recorder.now_s
    robot.wait(1.0)
    robot.reset()
    robot.wait(resumed_s + BOX_S - robot.recorder.now_s)
    stopped_s = robot.recorder.now_s
    robot.world.driver.stop()
    robot.wait(1.0)
    return tuple(entry for entry in robot.recorder.box if resumed_s <= entry.at_s <= stopped_s)


def cut(since_s: float, title: str = TITLE) -> list[Entry]:
    """Of it what is written that much after the hang, with its title."""
    entries = [entry for entry in after_a_hang() if entry.at_s >= after_a_hang()[0].at_s + since_s]
    return [Note(entries[0].at_s, title), *entries]


STOPPING_S, LATCHED_S = 0.0, 1.5
"""After the hang: when the driver begins its stop; shortly before it is latched."""


def stories(entries: list[Entry]) -> list[Story]:
    return explain(entries, ROBOT).stories


@pytest.mark.parametrize(("since_s", "before"), [(STOPPING_S, [Cause.REPORTED]), (LATCHED_S, [])])
def test_a_stop_at_standstill_that_ends_the_recording_is_told_and_one_that_was_before_it_is_not(
    since_s: float, before: list[Cause]
) -> None:
    *others, story = stories(cut(since_s))
    assert [each.cause for each in others] == before
    assert story.cause is Cause.STOP_REQUESTED
    assert story.found.text == "motor_driver STOPPING: stop requested (service motor_driver/stop)"
    assert story.found.at_s == after_a_hang()[-1].at_s
    assert standstill_sentence(story) == "the base was stationary"


def test_a_recording_that_was_requested_has_no_stop_at_its_end() -> None:
    nobody = written.title("nobody", "recording requested", "the robot was not stopped")
    assert stories(cut(LATCHED_S, nobody)) == []


def test_the_driver_s_own_note_of_the_stop_is_not_told_twice() -> None:
    ended_s = after_a_hang()[-1].at_s
    note = Note(ended_s, written.driver_note("STOPPING: stop requested (service motor_driver/stop); ends with: reset"))
    assert [story.cause for story in stories([*cut(LATCHED_S), note])] == [Cause.STOP_REQUESTED]


@pytest.mark.parametrize("powered", [False, True])
def test_a_driver_that_is_first_seen_latched_has_stopped_before_unless_a_drive_has_power(powered: bool) -> None:
    word = b"\x37\x12" if powered else b"\x50\x12"
    frames = [RecordedFrame(0.01 * turn, 0x181, word + bytes(4)) for turn in range(100)]
    latched = Note(0.495, written.driver_note("LATCHED: watchdog tripped (watchdog: driver silent)"))
    told = explain([*frames[:50], latched, *frames[50:]], ROBOT)
    assert len(told.stories) == powered
    assert [event.text.endswith("(since before the recording)") for event in told.events if event.at_s == 0.495] == [
        not powered
    ]


def test_two_stops_within_three_seconds_are_two_stories_each_with_its_own_standstill() -> None:
    """At standstill ── reset ── 0.3 m/s ── the second stop: its wheels stand 0.4 s later, 2 s after the reset."""
    robot = Robot()
    robot.cruise.ordered = ZERO
    robot.wait(2.0)
    robot.world.driver.stop()
    robot.reset()
    enabled_s = robot.recorder.now_s
    robot.cruise.ordered = Twist(0.3, 0.0)
    robot.wait(1.5)
    stopped_s = robot.recorder.now_s
    robot.world.driver.stop()
    robot.wait(2.0)
    assert stopped_s - enabled_s < 3.0
    first, second = stories(robot.recorder.box)
    assert (first.cause, second.cause) == (Cause.STOP_REQUESTED, Cause.STOP_REQUESTED)
    assert first.scene.ended_s < enabled_s + 0.2
    assert standstill_sentence(first) == "the base was stationary"
    assert second.found.at_s == pytest.approx(stopped_s, abs=0.03)
    assert second.standstill.stood_s == pytest.approx(0.4, abs=0.15)


def test_a_wheel_without_position_at_the_cause_proves_no_standstill() -> None:
    """The recording begins in a stop, and 6064h of a wheel comes later."""
    wire = recorded(twin("drive", "in fault")).wire
    begins_s = 1.8
    cut = [entry for entry in wire if not (isinstance(entry, RecordedFrame) and entry.cob_id == 0x181
                                           and entry.at_s < begins_s)]  # fmt: skip
    (story,) = stories(cut)
    left = next(wheel for wheel in story.standstill.wheels if wheel.name == "left_wheel")
    assert (left.stood_s, left.why_not[:15]) == (None, "6064h begins at")


@pytest.mark.parametrize("hangs_s", [3.0, 12.0])
def test_a_pause_of_the_driver_is_seen_in_its_black_box_however_long_it_was(hangs_s: float) -> None:
    robot = Robot()
    robot.wait(1.0)
    robot.world.processes["driver"].hang("a test")
    robot.wait(hangs_s)
    robot.world.processes["driver"].go_on("a test")
    robot.wait(1.0)
    (story,) = stories(robot.recorder.box)
    assert story.cause is Cause.RECORDER_PAUSED
    assert story.found.at_s == pytest.approx(1.0, abs=0.03)


def test_a_short_pause_of_the_driver_before_it_hangs_is_not_the_stop() -> None:
    """1.00 s ── SYNC away for 0.06 s ── 1.06 s ── 1.50 s ── the driver hangs."""
    robot = Robot()
    driver = robot.world.processes["driver"]
    for until_s, act in ((1.0, driver.hang), (1.06, driver.go_on), (1.5, driver.hang), (4.0, driver.go_on)):
        robot.wait(until_s - robot.recorder.now_s)
        act("a test")
    (story,) = stories(robot.recorder.wire)
    assert story.cause is Cause.DRIVER_SILENT
    assert story.found.at_s == pytest.approx(1.5, abs=0.03)


def test_what_a_driver_takes_in_after_its_hang_is_no_source_that_was_lost() -> None:
    notes = [
        Note(0.1, written.mux_note("action", "")),
        Note(3.01, written.mux_note("", "action: no message for 1.02 s (timeout 0.30 s)")),
        Note(3.02, written.driver_note("STOPPING: watchdog tripped (watchdog: driver silent)")),
    ]
    frames = [RecordedFrame(at_s / 100.0, 0x080, b"") for at_s in (*range(200), *range(300, 320))]
    entries: list[Entry] = sorted([*notes, *frames], key=lambda entry: entry.at_s)
    (story,) = stories([Note(0.0, "motor_driver ENABLED"), *entries])
    assert story.cause is Cause.RECORDER_PAUSED
    assert story.found.at_s == pytest.approx(1.99)


def test_a_source_that_ended_long_ago_is_not_lost_at_the_stop() -> None:
    """The mux reports each 0.1 s that nobody drives."""
    notes = [
        Note(0.1, written.mux_note("action", "")),
        *(Note(0.1 * turn, written.mux_note("", f"action: no message for {turn / 10} s")) for turn in range(3, 21)),
        Note(2.01, written.driver_note("STOPPING: stop requested (service motor_driver/stop)")),
    ]
    (story,) = stories([Note(0.0, "motor_driver ENABLED"), *notes])
    assert story.cause is Cause.STOP_REQUESTED


def test_a_filter_that_stops_and_lets_creep_in_turn_stopped_for_the_obstacle() -> None:
    notes = [
        Note(0.9, written.command_note(0.02, 0.0)),
        Note(0.95, written.filter_note("obstacle_near", "0.15 m free ahead", 0.02, 0.0, 1)),
        Note(1.0, written.filter_note("obstacle", "0.15 m free ahead", 0.0, 0.0, 2)),
        Note(1.015, written.filter_note("obstacle_near", "0.15 m free ahead", 0.02, 0.0, 3)),
    ]
    (story,) = stories([Note(0.0, "motor_driver ENABLED"), *notes])
    assert story.cause is Cause.OBSTACLE


@pytest.mark.parametrize(("age_s", "is_told"), [(0.06, False), (0.01, True)])
def test_a_drive_that_is_not_in_the_recording_any_more_is_not_known_to_have_power(age_s: float, is_told: bool) -> None:
    """Its last frame ── a reset, as the driver's boot sends it."""
    lost_s = 0.5
    wire = [
        entry for entry in recorded(twin("drive", "in fault")).wire
        if isinstance(entry, RecordedFrame) and (entry.at_s < lost_s or (entry.at_s < 1.0 and entry.cob_id & 0x7F != 2))
    ]  # fmt: skip
    reset = RecordedFrame(lost_s + age_s, 0x000, bytes((0x82, 2)))
    told = stories([*(e for e in wire if e.at_s < reset.at_s), reset, *(e for e in wire if e.at_s >= reset.at_s)])
    assert (Cause.SECOND_MASTER in [story.cause for story in told]) == is_told


def test_a_boot_up_long_after_the_reset_of_the_boot_is_a_restart() -> None:
    """Reset ── its boot-up ── power ── a boot-up that nobody ordered, in the network of another master."""
    frames = [RecordedFrame(0.01 * turn, 0x080, b"") for turn in range(260)]
    frames += [RecordedFrame(0.01 * turn + 0.001, 0x181, b"\x37\x12" + bytes(4)) for turn in range(50, 200)]
    frames += [RecordedFrame(0.1, 0x000, bytes((0x82, 1)))]
    frames += [RecordedFrame(at_s, 0x701, b"\0") for at_s in (0.11, 1.995)]
    (story,) = stories(sorted(frames, key=lambda frame: frame.at_s))
    assert story.cause is Cause.NODE_RESTARTED


def test_the_watchdog_s_nmt_command_just_before_it_reports_its_trip_is_no_other_master_s() -> None:
    """The recording has lost its quick stops."""
    box = recorded(twin("encoder", "frozen: nothing counts, the last speed")).box
    trip = next(e for e in box if isinstance(e, RecordedFrame) and e.cob_id == 0x1FE and e.data[0] == 2)
    cut = [e for e in box if not (isinstance(e, RecordedFrame) and e.cob_id & 0x780 == 0x500 and e.at_s < trip.at_s)]
    (story,) = stories(cut)
    assert story.cause is Cause.POSITION_STUCK
