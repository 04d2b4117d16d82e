"""From the frames of a black box to the speeds of a plot, for drives of every kind."""

from __future__ import annotations

import os
import struct
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from canbase_config.load import load_robot, sample
from canbase_driver.drive_units import AxisUnits
from canbase_web.stop_recording import MOST_POINTS, wheel_speeds
from canbase_web.stops_page import LARGEST_BYTES, _read

BENCH = load_robot(sample("bench")).robot


def test_ordered_and_measured_speeds_of_both_wheels_forward_positive_on_both_sides() -> None:
    left, right = (AxisUnits(drive, BENCH.base) for drive in BENCH.drives)
    frames = [
        (0.01, 0x201, struct.pack("<Hi", 0x0F, left.velocity_raw(0.3))),
        (0.01, 0x202, struct.pack("<Hi", 0x0F, right.velocity_raw(0.3))),
        (0.02, 0x281, struct.pack("<ih", left.velocity_raw(0.25), 0)),
        (0.02, 0x282, struct.pack("<i", right.velocity_raw(0.25))),
    ]
    found = wheel_speeds(BENCH, frames)
    assert [wheel.joint for wheel in found] == ["left_wheel", "right_wheel"]
    for wheel in found:
        assert wheel.ordered[0] == pytest.approx((0.01, 0.3), abs=0.001)
        assert wheel.measured[0] == pytest.approx((0.02, 0.25), abs=0.001)


@pytest.mark.parametrize("data", [b"", b"\x0f\x00", b"\x0f\x00\x01\x02\x03", bytes(8)])
def test_a_frame_that_does_not_fit_is_passed_over(data: bytes) -> None:
    found = wheel_speeds(BENCH, [(0.0, 0x201, data[:5]), (0.0, 0x281, data), (0.0, 0x7FF, data)])
    assert [(wheel.ordered, wheel.measured) for wheel in found] == [([], [])] * 2


@pytest.mark.parametrize(("frames", "points"), [(0, 0), (1000, 1000), (1001, 501), (80_000, 1000)])
def test_a_long_recording_is_thinned(frames: int, points: int) -> None:
    data = struct.pack("<Hi", 0x0F, 100)
    (left, _) = wheel_speeds(BENCH, ((i * 0.01, 0x201, data) for i in range(frames)))
    assert len(left.ordered) == points <= MOST_POINTS


@pytest.mark.parametrize("kind", ["a pipe", "a folder", "none", "too large", "another name"])
def test_what_a_foreign_stop_event_names_is_not_waited_for(tmp_path: Path, kind: str) -> None:
    """Anybody may publish on stop_events: opening a pipe would hold up a thread of the page for ever."""
    file = tmp_path / ("stop.asc" if kind != "another name" else "stop.txt")
    if kind == "a pipe":
        os.mkfifo(file)
    elif kind == "a folder":
        file.mkdir()
    elif kind != "none":
        with file.open("wb") as stream:
            stream.truncate(LARGEST_BYTES + 1 if kind == "too large" else 1)
    pages: Any = SimpleNamespace(loaded=SimpleNamespace(robot=BENCH))
    with pytest.raises(ValueError, match="no recording"):
        _read(pages, file)
