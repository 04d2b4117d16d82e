"""What the page shows of a stop: lines, bars of states, and pauses in which nothing is known."""

from __future__ import annotations

import struct

import pytest

from canbase_campaign.robots import campaign_robot
from canbase_recording import page_data
from canbase_recording.entry import RecordedFrame
from canbase_recording.explanation import explain
from canbase_recording.trace import MOST_POINTS, thinned
from support.recorded_world import recorded, twin

ROBOT = campaign_robot()


def test_states_of_a_drive_whose_cable_is_cut_end_with_its_last_statusword() -> None:
    (story,) = explain(recorded(twin("cable", "of one drive is cut")).box, ROBOT).stories
    name = next(drive.joint for drive in ROBOT.drives if drive.node_id == story.found.node_id)
    bars = [bar for bar in page_data.bars(story.scene) if bar.lane == name]
    assert [(bar.text, bar.tone) for bar in bars] == [("operation enabled", "good"), ("no statusword", "idle")]
    assert bars[1].since_s == pytest.approx(story.found.at_s, abs=0.02)
    lanes = list(dict.fromkeys(bar.lane for bar in page_data.bars(story.scene)))
    assert lanes == ["mux", "filter", "driver", "watchdog", "left_wheel", "right_wheel"]


def test_speeds_in_metres_per_second_and_the_bounds_of_the_leases_around_them() -> None:
    (story,) = explain(recorded(twin("drive", "in fault")).box, ROBOT).stories
    curves = {curve.name: curve for curve in page_data.speeds(story.scene)}
    assert page_data.speed_unit(story.scene) == "m/s"
    assert max(curves["left_wheel ordered"].values) == pytest.approx(0.4, abs=0.001)
    assert max(curves["right_wheel measured"].values) == pytest.approx(0.4, abs=0.01)
    for joint, bounds in page_data.bounds(story.scene).items():
        for at_s, low, high in bounds:
            measured = [v for t, v in zip(*_line(curves[f"{joint} ordered"]), strict=True) if abs(t - at_s) < 0.005]
            assert all(low - 0.05 <= value <= high + 0.05 for value in measured)


def _line(curve: page_data.Curve) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return curve.times, curve.values


def test_a_pause_of_the_statusword_is_shown_and_what_comes_after_it() -> None:
    """A drive that is enabled, silent for 0.5 s, back, and then in fault."""
    frames = []
    for cycle in range(400):
        at_s = 0.01 * cycle
        frames.append(RecordedFrame(at_s, 0x080, b""))
        if not 100 <= cycle < 150:
            word = 0x0208 if cycle >= 200 else 0x0237
            frames.append(RecordedFrame(at_s + 0.001, 0x181, struct.pack("<Hi", word, 0)))
    (story,) = explain(frames, ROBOT).stories
    texts = [bar.text for bar in page_data.bars(story.scene) if bar.lane == "left_wheel"]
    assert texts == ["operation enabled", "no statusword", "operation enabled", "fault"]


@pytest.mark.parametrize(
    ("points", "left"), [(0, 0), (MOST_POINTS, MOST_POINTS), (MOST_POINTS + 1, MOST_POINTS // 2 + 1)]
)
def test_long_lines_are_thinned(points: int, left: int) -> None:
    assert len(thinned(list(range(points)))) == left
