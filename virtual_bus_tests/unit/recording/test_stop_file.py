"""The .json file of a stop: what is read of it, its robot, and bad files."""

from __future__ import annotations

import json
from typing import Any

import pytest

from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_driver.runtime.black_box import Ring
from canbase_driver.runtime.black_box_about import about
from canbase_driver.runtime.black_box_json import json_lines
from canbase_driver.supervision.stop_history import StopRecord
from canbase_recording.input_lines import NoInputsError
from canbase_recording.stop_file import stop_of

ROBOT = load_robot(sample("bench")).robot
WALL_S = 1_790_000_000.0


def told() -> dict[str, Any]:
    ring = Ring(10.0)
    ring.frame(100.0, 0x80, b"", False)
    stop = StopRecord("watchdog", "watchdog tripped", "lease lost", True, "", 101.0)
    found = json.loads("".join(json_lines(ring.cut(101.0, WALL_S), stop, "stop.asc", about(ROBOT))))
    assert isinstance(found, dict)
    return found


def test_what_the_driver_writes_is_read() -> None:
    found = stop_of(told())
    assert (found.at_s, found.began_s, found.wall_offset_s) == (101.0, 100.0, WALL_S)
    assert (found.stopped_by, found.cause, found.detail) == ("watchdog", "watchdog tripped", "lease lost")
    assert found.watchdog == watchdog_config(ROBOT)
    assert found.robot == ROBOT


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"format": 2}, "format: Input should be 1"),
        ({"watchdog_config": {}}, "watchdog_config: 'drives'"),
        ({"began_s": "soon"}, "began_s: Input should be a valid number"),
        ({"at_s": float("nan")}, "at_s: Input should be a finite number"),
        ({"profiles": []}, "profiles: Input should be a valid dictionary"),
    ],
)
def test_what_is_no_second_file_of_a_black_box_is_refused_with_the_reason(change: dict[str, Any], said: str) -> None:
    with pytest.raises(NoInputsError, match=said):
        stop_of(told() | change)


@pytest.mark.parametrize("drives", [[], [1], [{}], 7])
def test_a_robot_that_is_none_is_refused(drives: Any) -> None:
    values = told()
    values["robot_yaml"]["drives"] = drives
    with pytest.raises(NoInputsError, match="refuses the recorded"):
        _ = stop_of(values | {"profiles": {"own.yaml": ""}}).robot
