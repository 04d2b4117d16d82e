"""A black box as inputs: times, commands, the echoes of sent frames, and bad files."""

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


def test_a_command_that_is_no_number_comes_back_as_none() -> None:
    found = recorded_inputs([], told(command(100.1, WALL_S + 100.1, math.nan)))
    assert math.isnan(found.commands[0].linear_mps)


def test_where_senders_hear_themselves_the_echo_counts_and_elsewhere_every_frame() -> None:
    sent, echo = RecordedFrame(100.0, 0x80, b"", True), RecordedFrame(100.0004, 0x80, b"")
    assert hears_itself(UDP, [sent, echo])
    assert not hears_itself({"interface": "socketcan"}, [sent, echo])  # another master's SYNC, perhaps
    assert not hears_itself(UDP, [sent, RecordedFrame(100.0, 0x1FE, bytes(8))])
    assert hears_itself({"interface": "socketcan", "receive_own_messages": True}, [sent, echo])


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
