"""A black box as inputs: whose commands are the filter's, what others heard of the driver's frames, and bad files."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import pytest

from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_driver.runtime.black_box import Ring
from canbase_driver.runtime.black_box_about import about
from canbase_driver.runtime.black_box_json import json_lines
from canbase_driver.supervision.stop_history import StopRecord
from canbase_recording.bus_times import heard_times
from canbase_recording.entry import Entry, FrameKind, RecordedFrame
from canbase_recording.recorded_inputs import NoInputsError, hears_itself, recorded_inputs

ROBOT = load_robot(sample("bench")).robot
WALL_S = 1_790_000_000.0
UDP = {"interface": "udp_multicast"}


def told(*events: tuple[float, str, dict[str, Any]]) -> dict[str, Any]:
    ring = Ring(10.0)
    ring.frame(100.0, 0x80, b"", False)
    for event in events:
        ring.event(*event)
    stop = StopRecord("watchdog", "watchdog tripped", "lease lost", True, "", 101.0)
    found = json.loads("".join(json_lines(ring.cut(101.0, WALL_S), stop, "stop.asc", about(ROBOT))))
    assert isinstance(found, dict)
    return found


def command(at_s: float, stamp_s: float, linear_mps: float = 0.3) -> tuple[float, str, dict[str, Any]]:
    return at_s, "cmd_vel", {"linear_mps": linear_mps, "angular_radps": 0.0, "stamp_s": stamp_s}


def test_times_of_both_files_are_on_one_clock() -> None:
    entries: list[Entry] = [RecordedFrame(0.5, 0x1FE, bytes(8))]
    found = recorded_inputs(entries, told(command(100.7, WALL_S + 100.699)))
    assert found.frames[0].at_s == pytest.approx(100.5)
    assert (found.at_s, found.began_s, found.stopped_by) == (101.0, 100.0, "watchdog")
    assert found.commands[0].at_s == 100.7
    assert found.watchdog == watchdog_config(ROBOT)


def test_a_command_was_sent_earlier_by_as_much_as_it_took_longer_than_the_fastest_one() -> None:
    stamps = [(100.1, 0.001), (100.2, 0.001), (100.35, 0.041)]
    found = recorded_inputs([], told(*(command(at_s, WALL_S + at_s - late_s) for at_s, late_s in stamps)))
    sent = [round((each.sent_s or 0.0) - each.at_s, 3) for each in found.commands]
    assert sent == [0.0, 0.0, -0.04]


@pytest.mark.parametrize("offset_s", [0.0, -3600.0, 86400.0])
def test_a_wall_clock_that_is_wrong_changes_nothing(offset_s: float) -> None:
    events = [command(100.0 + k / 50, WALL_S + offset_s + 100.0 + k / 50) for k in range(20)]
    assert all(each.sent_s is not None for each in recorded_inputs([], told(*events)).commands)


def test_a_command_without_a_stamp_of_the_filters_clock_is_somebody_elses() -> None:
    events = [command(100.0 + k / 50, WALL_S + 100.0 + k / 50) for k in range(20)]
    found = recorded_inputs([], told(*events, command(100.5, 0.0), command(100.6, WALL_S + 500.0)))
    assert [each.sent_s for each in found.commands[-2:]] == [None, None]


def test_a_command_that_is_no_number_comes_back_as_none() -> None:
    found = recorded_inputs([], told(command(100.1, WALL_S + 100.1, math.nan)))
    assert not found.commands[0].is_finite


def test_where_senders_hear_themselves_the_echo_counts_and_elsewhere_every_frame() -> None:
    sent, echo = RecordedFrame(100.0, 0x80, b"", True), RecordedFrame(100.0004, 0x80, b"")
    assert hears_itself(UDP, [sent, echo])
    assert not hears_itself({"interface": "socketcan"}, [sent, echo])  # another master's SYNC, perhaps
    assert not hears_itself(UDP, [sent, RecordedFrame(100.0, 0x1FE, bytes(8))])
    assert hears_itself({"interface": "socketcan", "receive_own_messages": True}, [sent, echo])


def test_frames_of_one_moment_are_heard_one_after_the_other() -> None:
    cycle = [RecordedFrame(100.0, cob_id, bytes(6), True) for cob_id in (0x201, 0x202)]
    first, second = heard_times([*cycle], 500_000)
    assert 0.0002 < first.at_s - 100.0 < 0.0003
    assert second.at_s - first.at_s == pytest.approx(first.at_s - 100.0, abs=1e-9)


def test_a_frame_that_was_sent_waits_for_the_one_that_is_on_the_bus() -> None:
    on_the_bus = RecordedFrame(100.0003, 0x181, bytes(8))
    waits = RecordedFrame(100.0001, 0x201, bytes(6), True)
    first, second = heard_times([waits, on_the_bus], 500_000)
    assert first == on_the_bus
    assert second.cob_id == 0x201
    assert second.at_s > on_the_bus.at_s + 0.0002


def test_frames_that_are_none_of_canopen_are_left_out() -> None:
    other = RecordedFrame(0.1, 0x18FF_0000, b"", kind=FrameKind.EXTENDED)
    assert recorded_inputs([other, other._replace(kind=FrameKind.REMOTE)], told()).frames == ()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": 2}, "format '2', expected 1"),
        ({"watchdog_config": {}}, "'drives' is missing"),
        ({"events": [{"what": "cmd_vel"}]}, "'at_s' is missing"),
        ({"events": 7}, "a value is not what it must be"),
        ({"began_s": "soon"}, "a value is not what it must be"),
        ({"robot_yaml": {"bus": {}}}, "'bitrate' is missing"),
    ],
)
def test_what_is_no_second_file_of_a_black_box_is_refused_with_the_reason(change: dict[str, Any], said: str) -> None:
    with pytest.raises(NoInputsError, match=said):
        recorded_inputs([], told() | change)


def test_the_end_is_that_of_the_last_frame() -> None:
    entries: list[Entry] = [RecordedFrame(0.5, 0x1FE, bytes(8)), RecordedFrame(0.9, 0x1FE, bytes(8))]
    found = recorded_inputs(entries, told())
    assert found.ends_s == pytest.approx(100.9)
    assert replace(found, frames=()).ends_s == 100.0
