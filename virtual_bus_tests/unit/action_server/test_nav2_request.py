"""What goals of Nav2's behaviours mean on this robot, and which are invalid."""

from __future__ import annotations

import math

import pytest

from canbase_action_server.goal_request import DriveRequest, RotateRequest
from canbase_action_server.nav2_request import BehaviorRequest, Target, back_up, drive_on_heading, spin
from support.action_plant import bench_robot

ROBOT = bench_robot()


@pytest.mark.parametrize(
    ("request_", "meant"),
    [
        (drive_on_heading(ROBOT, Target(0.5), 0.2, 10.0), DriveRequest(0.5, 0.2)),
        (drive_on_heading(ROBOT, Target(-0.5), -0.2, 10.0), DriveRequest(-0.5, 0.2)),
        (drive_on_heading(ROBOT, Target(0.5), 3.0, 10.0), DriveRequest(0.5, ROBOT.action.max_speed_mps)),
        (back_up(ROBOT, Target(0.3), 0.15, 10.0), DriveRequest(-0.3, 0.15)),
        (back_up(ROBOT, Target(-0.3), -0.15, 10.0), DriveRequest(-0.3, 0.15)),
        (back_up(ROBOT, Target(0.3), -0.15, 10.0), DriveRequest(-0.3, 0.15)),
        (spin(ROBOT, 1.57, 10.0), RotateRequest(1.57, 1.0)),
        (spin(ROBOT, -7.0, 10.0), RotateRequest(-7.0, 1.0)),
    ],
)
def test_a_goal_is_a_motion_of_drive_distance_or_rotate_angle(
    request_: BehaviorRequest, meant: DriveRequest | RotateRequest
) -> None:
    assert request_.range_reason(ROBOT) is None
    assert request_.motion_request == meant


@pytest.mark.parametrize(
    ("request_", "word"),
    [
        (drive_on_heading(ROBOT, Target(0.5, 0.1), 0.2, 10.0), "target.y is 0.1"),
        (drive_on_heading(ROBOT, Target(0.5, 0.0, -0.1), 0.2, 10.0), "target.z is -0.1"),
        (back_up(ROBOT, Target(0.5, math.nan), 0.2, 10.0), "target.y is nan"),
        (drive_on_heading(ROBOT, Target(0.5), -0.2, 10.0), "same sign"),
        (drive_on_heading(ROBOT, Target(-0.5), 0.2, 10.0), "same sign"),
        (drive_on_heading(ROBOT, Target(math.nan), 0.2, 10.0), "same sign"),
        (drive_on_heading(ROBOT, Target(math.inf), 0.2, 10.0), "finite"),
        (drive_on_heading(ROBOT, Target(0.5), math.inf, 10.0), "finite"),
        (back_up(ROBOT, Target(0.5), math.nan, 10.0), "finite"),
        (drive_on_heading(ROBOT, Target(0.0), -0.2, 10.0), "outside"),
        (back_up(ROBOT, Target(0.0), 0.2, 10.0), "outside"),
        (back_up(ROBOT, Target(100.0), 0.2, 10.0), "action.max_distance_m"),
        (back_up(ROBOT, Target(0.3), 0.0, 10.0), "action.min_speed_mps"),
        (spin(ROBOT, 0.0, 10.0), "action.min_angle_rad"),
        (spin(ROBOT, math.nan, 10.0), "finite"),
        (spin(ROBOT, 100.0, 10.0), "action.max_angle_rad"),
    ],
)
def test_an_invalid_goal_says_which_number_is_wrong(request_: BehaviorRequest, word: str) -> None:
    assert word in (request_.range_reason(ROBOT) or "it is valid")


@pytest.mark.parametrize(("allowance_s", "limit_s"), [(10.0, 10.0), (0.0, math.inf), (-1.0, math.inf)])
def test_a_time_allowance_of_zero_or_less_is_none(allowance_s: float, limit_s: float) -> None:
    assert spin(ROBOT, 1.0, allowance_s).terms.time_allowance_s == limit_s


def test_a_robot_that_turns_slowly_spins_slowly() -> None:
    action = ROBOT.action.model_copy(update={"max_speed_radps": 0.5})
    slow = ROBOT.model_copy(update={"action": action})
    assert spin(slow, 1.0, 10.0).motion_request == RotateRequest(1.0, 0.5)
