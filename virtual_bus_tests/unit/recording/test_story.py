"""The first cause of a stop: failures of the real cores in virtual time, each explained from what would be recorded."""

from __future__ import annotations

import functools
import math
import struct

import pytest

from canbase_campaign.cruise import Cruise
from canbase_campaign.robots import campaign_robot
from canbase_campaign.twins import Twin
from canbase_driver.runtime import black_box_notes as written
from canbase_recording.cause import ADVICE, Cause, Found
from canbase_recording.entry import Entry, FrameKind, Note, RecordedFrame
from canbase_recording.event import EventKind
from canbase_recording.explanation import Explanation, explain
from canbase_recording.story import RULES, Rule
from canbase_velocity.twist import Twist
from support.recorded_failures import FAILURES, MORE, NO_STOP
from support.recorded_world import WorldRecorder, recorded, twin

ROBOT = campaign_robot()
BOX, WIRE = "black box", "listener"


@functools.cache
def recorder(what: str, how: str) -> WorldRecorder:
    return recorded(twin(what, how))


def explained(what: str, how: str, view: str, *, with_robot: bool = True) -> Explanation:
    found = recorder(what, how)
    return explain(found.box if view == BOX else found.wire, ROBOT if with_robot else None)


@pytest.mark.parametrize(("failure", "box", "wire"), MORE, ids=[f"{row[0].what}: {row[0].how}" for row in MORE])
def test_the_first_cause_of_more_failures(failure: Twin, box: Cause | None, wire: Cause | None) -> None:
    found = recorded(failure)
    for entries, expected in ((found.box, box), (found.wire, wire)):
        causes = [story.cause for story in explain(entries, ROBOT).stories]
        assert causes == ([] if expected is NO_STOP else [expected])


NEEDS_UNITS = (Cause.ENCODER_JUMPS,)


@pytest.mark.parametrize(("what", "how", "box", "wire"), FAILURES, ids=[f"{row[0]}: {row[1]}" for row in FAILURES])
def test_the_first_cause_of_each_failure(what: str, how: str, box: Cause | None, wire: Cause | None) -> None:
    """By the driver's black box, by a listener's frames, and without robot.yaml, in raw numbers."""
    for view, expected in ((BOX, box), (WIRE, wire)):
        told = explained(what, how, view)
        causes = [story.cause for story in told.stories]
        assert causes == ([] if expected is NO_STOP else [expected]), (view, [s.found.text for s in told.stories])
    if box is not NO_STOP and box not in NEEDS_UNITS:
        (story,) = explained(what, how, BOX, with_robot=False).stories
        assert story.cause is box
        assert all(wheel.unit == "increments" for wheel in story.standstill.wheels)


def test_what_needs_units_is_not_guessed_without_them() -> None:
    (jumps,) = explained("encoder", "jumps to and fro", BOX, with_robot=False).stories
    assert jumps.cause is Cause.REPORTED
    assert "the frames of this recording do not show what it saw" in jumps.found.text


@pytest.mark.parametrize("by", ["joystick", "goal"])
def test_ordinary_driving_has_no_stop(by: str) -> None:
    """24 s: speeds up and down, both directions, turns, pauses."""
    cruise = Cruise(by)
    recorder = WorldRecorder(cruise.world)
    for step in range(60):
        if by == "joystick":
            cruise.ordered = Twist(0.5 * (step % 5 - 2) / 2.0, 1.0 * (step % 3 - 1)) if step % 7 else Twist(0.0, 0.0)
        cruise.world.clock.run_until(cruise.world.clock.now_s + 0.4)
    for entries in (recorder.box, recorder.wire):
        assert explain(entries, ROBOT).stories == []


def test_who_caught_it_how_late_and_how_far_the_wheels_went() -> None:
    """The drive fails at 1.03 s; it brakes by itself, the other wheel is stopped by driver and watchdog."""
    (story,) = explained("drive", "in fault", BOX).stories
    assert story.caught_by == "the drive itself"
    assert story.found.at_s == pytest.approx(1.03, abs=0.02)
    assert "7305h encoder" in story.found.text
    assert story.standstill.stood_s == pytest.approx(0.21, abs=0.05)
    assert story.standstill.distance_m == pytest.approx(0.047, abs=0.01)
    whats = [f"{event.who}: {event.text}" for event in story.chain]
    fault = next(i for i, text in enumerate(whats) if "fault reaction active" in text)
    stopping = next(i for i, text in enumerate(whats) if text.startswith("motor_driver: STOPPING: drive fault"))
    assert fault < stopping


def test_a_wheel_whose_encoder_died_proves_no_standstill() -> None:
    (story,) = explained("encoder", "lost: nothing counts, no speed", BOX).stories
    dead = next(wheel for wheel in story.standstill.wheels if wheel.stood_s is None)
    assert dead.why_not.startswith("6064h ends at")
    assert story.standstill.stood_s is None
    assert "a dead encoder, a blocked wheel and a motor without current look the same here" in story.found.text


def test_a_consequence_is_not_the_cause() -> None:
    """After the driver has died the drives report lost heartbeats and go to fault: that comes later."""
    (story,) = explained("motor_driver", "SIGKILL", WIRE).stories
    assert story.cause is Cause.DRIVER_SILENT
    assert any("EMCY 8130h" in event.text for event in story.chain)
    assert story.found.at_s < min(event.at_s for event in story.chain if "EMCY" in event.text)


def test_a_part_acts_when_it_acts_and_not_when_a_missing_message_is_noticed() -> None:
    """SYNC is missed after some of its periods; the watchdog that stops the drives for it acts later."""
    (story,) = explained("motor_driver", "SIGSTOP", WIRE).stories
    acted_s = next(event.at_s for event in story.chain if event.kind is EventKind.WATCHDOG)
    assert story.caught_by == "watchdog"
    assert story.caught_s == acted_s > story.scene.reaction_s
    assert f", {1000.0 * (acted_s - story.found.at_s):.0f} ms later: " in story.caught


def test_the_time_of_the_cause_is_that_of_the_last_frame_not_of_the_alarm() -> None:
    (story,) = explained("cable", "of one drive is cut", BOX).stories
    last_s = max(
        entry.at_s
        for entry in recorder("cable", "of one drive is cut").box
        if isinstance(entry, RecordedFrame) and entry.cob_id == 0x180 + story.found.node_id
    )
    assert story.found.at_s == pytest.approx(last_s, abs=0.002)
    assert story.scene.reaction_s == pytest.approx(story.found.at_s + ROBOT.timeouts.feedback_s, abs=0.03)


@pytest.mark.parametrize(("part", "own", "cause"), [
    ("motor_driver", 0x080, Cause.DRIVER_SILENT), ("watchdog", 0x1FE, Cause.WATCHDOG_SILENT),
])  # fmt: skip
def test_a_part_that_was_killed_is_named_when_its_stop_process_acts_before_it_is_missed(
    part: str, own: int, cause: Cause
) -> None:
    """Its last frame, 30 ms later quick stop thrice on the watchdog's PDO, and pre-operational: not missed yet."""
    wire = recorder(part, "SIGKILL").wire
    last_s = max(entry.at_s for entry in wire if isinstance(entry, RecordedFrame) and entry.cob_id == own)
    stops = [
        RecordedFrame(last_s + 0.03 + 0.01 * turn, 0x500 + drive.node_id, b"\x02\x00")
        for turn in range(3) for drive in ROBOT.drives
    ]  # fmt: skip
    ends = [RecordedFrame(last_s + 0.06, 0x000, bytes((0x80, drive.node_id))) for drive in ROBOT.drives]
    story = explain(sorted((*wire, *stops, *ends), key=lambda entry: entry.at_s), ROBOT).stories[0]
    assert story.cause is cause
    assert story.found.at_s == pytest.approx(last_s)
    assert story.found.text.endswith("and its stop process acts: it was killed, or it crashed")
    assert story.caught_by == f"the {part.removeprefix('motor_')}'s stop process"


@pytest.mark.parametrize(("lost_s", "cause"), [(0.999, Cause.SOURCE_LOST), (1.004, Cause.STOP_REQUESTED)])
def test_a_source_that_ends_after_the_stop_is_not_its_cause(lost_s: float, cause: Cause) -> None:
    """At 1 s somebody requests a stop, and 4 ms later the goal has ended by it."""
    notes = [
        Note(0.0, "motor_driver ENABLED"),
        Note(0.1, written.mux_note("action", "")),
        Note(0.9, written.command_note(0.3, 0.0)),
        Note(lost_s, written.mux_note("", "action: its goal has ended")),
        Note(1.0, written.driver_note("STOPPING: stop requested")),
    ]
    (story,) = explain(sorted(notes, key=lambda note: note.at_s), ROBOT).stories
    assert story.cause is cause


def test_what_has_no_time_in_the_recording_is_no_evidence(monkeypatch: pytest.MonkeyPatch) -> None:
    """The recording begins after the last SYNC: nobody knows when it ended."""
    ended = Rule(Cause.DRIVER_SILENT, lambda scene: Found(-math.inf, "SYNC ends at -inf s"))
    monkeypatch.setattr("canbase_recording.story.RULES", (ended, *RULES))
    assert explain(recorder("drive", "in fault").wire, ROBOT).stories[0].cause is Cause.DRIVE_FAULT


def test_the_end_of_a_recording_in_motion_is_said() -> None:
    told = explained("motor_driver", "SIGKILL", BOX)
    assert told.stories == []
    assert any(axis.is_enabled and axis.moves for node in told.network.nodes.values() for axis in node.axes.values())


def test_every_cause_has_its_advice_and_every_rule_another_cause() -> None:
    assert set(ADVICE) == set(Cause)
    causes = [rule.cause for rule in RULES]
    assert len(set(causes)) == len(causes)
    assert set(causes) == set(Cause) - {Cause.UNKNOWN}


def test_an_unknown_end_is_said_to_be_unknown() -> None:
    """The driver says that it stops, and not why; the recording has no frame before."""
    entries = [Note(0.0, "motor_driver ENABLED"), Note(1.0, "motor_driver LATCHED")]
    (story,) = explain(entries, ROBOT).stories
    assert story.cause is Cause.UNKNOWN
    assert "nothing before it shows why" in story.found.text


def test_errors_of_the_controller_and_a_master_that_switches_off_in_motion() -> None:
    """Beside frames alone: five error frames; then, in another recording, disable voltage at full speed."""
    frames: list[Entry] = []
    for cycle in range(200):
        at_s = 0.01 * cycle
        word = 0x0000 if cycle >= 150 else 0x000F
        frames += [
            RecordedFrame(at_s, 0x203, struct.pack("<Hi", word, 1000)),
            RecordedFrame(at_s + 0.001, 0x080, b""),
            RecordedFrame(at_s + 0.002, 0x183, struct.pack("<Hi", 0x0250 if cycle >= 151 else 0x0237, 100 * cycle)),
            RecordedFrame(at_s + 0.003, 0x283, struct.pack("<ih", 990, 0)),
        ]
    state = RecordedFrame(0.0, 0x1FE, struct.pack("<BBBBHBB", 1, 0, 0, 0, 5, 0, 0))
    (story,) = explain([state, *frames]).stories
    assert story.cause is Cause.ORDERED_OFF
    assert story.found.text.startswith("node 3 is ordered: disable voltage in motion")
    errors = [RecordedFrame(1.3 + 0.01 * i, 0x20, bytes(8), kind=FrameKind.ERROR) for i in range(5)]
    entries = sorted([state, *frames, *errors], key=lambda entry: entry.at_s)
    (story,) = explain(entries).stories
    assert story.cause is Cause.BUS_ERRORS
    assert story.found.at_s == pytest.approx(1.3)
