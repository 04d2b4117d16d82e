"""The reason of a rejection finds its goal by the goal's numbers."""

from __future__ import annotations

import math
import struct

import pytest

from canbase_action_server.goal_request import DriveRequest, RotateRequest
from canbase_action_server.rejection import Reasons, as_texts
from canbase_config.load import load_robot, sample

ROBOT = load_robot(sample("bench")).robot


def drive(distance_m: float, speed_mps: float) -> dict[str, float]:
    return {"distance_m": distance_m, "max_speed_mps": speed_mps}


def published(goal: dict[str, float]) -> list[tuple[str, str]]:
    """What the server publishes of a goal that it received as float32."""
    return as_texts({name: struct.unpack("<f", struct.pack("<f", value))[0] for name, value in goal.items()})


ONE_METRE = drive(1.0, 0.2)


@pytest.mark.parametrize("goal", [drive(100.0, 0.2), drive(0.1, 0.3), drive(math.nan, 0.2), drive(-math.inf, 1e-40)])
def test_the_reason_of_the_same_numbers_is_the_goals(goal: dict[str, float]) -> None:
    reasons = Reasons()
    reasons.expect(goal)
    assert reasons.found is None
    reasons.take_rejection(published(goal), "too far")
    assert reasons.found == "too far"


@pytest.mark.parametrize(
    "other",
    [
        drive(1.0, 0.3),
        drive(-1.0, 0.2),
        drive(1.000001, 0.2),
        {"distance_m": 1.0},
        {"angle_rad": 1.0, "max_speed_radps": 0.2},
        {},
    ],
)
def test_the_reason_of_other_numbers_is_not(other: dict[str, float]) -> None:
    reasons = Reasons()
    reasons.expect(ONE_METRE)
    reasons.take_rejection(published(other), "of another client")
    assert reasons.found is None


@pytest.mark.parametrize(("sent", "received"), [(1e39, "inf"), (-1e39, "-inf")])
def test_a_number_too_large_for_the_interface_arrives_as_infinite(sent: float, received: str) -> None:
    reasons = Reasons()
    reasons.expect(drive(sent, 0.2))
    reasons.take_rejection([("distance_m", received), ("max_speed_mps", "0.2")], "not finite")
    assert reasons.found == "not finite"


@pytest.mark.parametrize("text", ["", "one", "1,0"])
def test_what_cannot_be_read_is_dropped(text: str) -> None:
    reasons = Reasons()
    reasons.expect(ONE_METRE)
    reasons.take_rejection([("distance_m", text), ("max_speed_mps", "0.2")], "from elsewhere")
    assert reasons.found is None


def test_what_came_before_the_goal_was_sent_is_about_another() -> None:
    reasons = Reasons()
    reasons.take_rejection(published(ONE_METRE), "before any goal")
    reasons.expect(ONE_METRE)
    assert reasons.found is None
    reasons.take_rejection(published(ONE_METRE), "busy")
    reasons.expect(ONE_METRE)
    assert reasons.found is None


def test_the_first_reason_counts_and_an_empty_one_is_none() -> None:
    reasons = Reasons()
    reasons.expect(ONE_METRE)
    reasons.take_rejection(published(ONE_METRE), "")
    assert reasons.found is None
    reasons.take_rejection(published(ONE_METRE), "busy")
    reasons.take_rejection(published(ONE_METRE), "emergency stop")
    assert reasons.found == "busy"


@pytest.mark.parametrize(
    ("request_", "key"),
    [
        (DriveRequest(100.0, 0.2), "action.max_distance_m"),
        (DriveRequest(-100.0, 0.2), "action.max_distance_m"),
        (DriveRequest(1e-6, 0.2), "action.min_distance_m"),
        (DriveRequest(1.0, 9.0), "action.max_speed_mps"),
        (DriveRequest(1.0, 0.0), "action.min_speed_mps"),
        (RotateRequest(1e4, 0.2), "action.max_angle_rad"),
        (RotateRequest(0.0, 0.2), "action.min_angle_rad"),
        (RotateRequest(1.0, 99.0), "action.max_speed_radps"),
        (RotateRequest(1.0, -1.0), "action.min_speed_radps"),
    ],
)
def test_a_number_out_of_range_names_the_limit_and_its_key(request_: DriveRequest | RotateRequest, key: str) -> None:
    reason = request_.range_reason(ROBOT)
    assert reason is not None
    assert key in reason
    assert f"{getattr(ROBOT.action, key.removeprefix('action.')):g}" in reason
