"""The straight motion: signs of the way, and the steering back to the start line."""

import math
from dataclasses import replace

import pytest

from canbase_action_server.along_track import BasePose
from canbase_action_server.inputs import Odometry
from canbase_action_server.motion_limits import profile_limits
from canbase_action_server.straight import STEERING_RADPM, StraightMotion
from support.action_plant import Plant, bench_robot

LIMITS = profile_limits(bench_robot(), 0.4)
START = Odometry(0.0, BasePose(0.0, 0.0, 0.0), 0.0, 0.0)


def steering(distance_m: float, at: BasePose) -> tuple[float, float]:
    """Orders when the base is at `at` a second after the start, up to speed: linear [m/s], angular [rad/s]."""
    motion = StraightMotion(START, distance_m, LIMITS)
    for cycle in range(51):
        now_s = cycle * 0.02
        motion.observe(replace(START, received=now_s, pose=at))
        twist = motion.order(now_s)
    assert twist is not None
    return twist.linear_mps, twist.angular_radps


@pytest.mark.parametrize(
    ("distance_m", "at", "linear_mps", "angular_radps"),
    [
        (3.0, BasePose(0.0, 0.0, 0.0), 0.4, 0.0),
        (-3.0, BasePose(0.0, 0.0, 0.0), -0.4, 0.0),
        (3.0, BasePose(0.0, 0.0, 0.1), 0.4, -0.15),  # 1.5 /s × 0.1 rad, the same way in both directions
        (-3.0, BasePose(0.0, 0.0, 0.1), -0.4, -0.15),
        (3.0, BasePose(0.0, 0.05, 0.0), 0.4, -0.08),  # 4 /m × 0.4 m/s × 0.05 m
        (-3.0, BasePose(0.0, 0.05, 0.0), -0.4, 0.08),  # driving backward, turning left leads right
        (3.0, BasePose(0.0, 0.0, 1.0), 0.4, -STEERING_RADPM * 0.4),  # bounded by the curvature
        (3.0, BasePose(0.0, 0.0, -1.0), 0.4, STEERING_RADPM * 0.4),
    ],
)
def test_it_steers_back_to_the_line(distance_m: float, at: BasePose, linear_mps: float, angular_radps: float) -> None:
    seen = steering(distance_m, at)
    assert seen == pytest.approx((linear_mps, angular_radps), abs=0.002)


def test_a_backward_way_counts_down_and_can_be_overshot() -> None:
    motion = StraightMotion(START, -0.5, LIMITS)
    assert motion.observe(replace(START, received=1.0, pose=BasePose(-0.2, 0.01, 0.0)))
    assert (motion.traveled_m, motion.lateral_m) == (-0.2, 0.01)
    assert motion.remaining_m == pytest.approx(0.3)
    assert motion.observe(replace(START, received=2.0, pose=BasePose(-0.503, 0.0, 0.0)))
    assert motion.remaining_m == pytest.approx(-0.003)
    assert motion.observe(replace(START, received=3.0, pose=BasePose(-0.5, 0.0, 0.0)))
    assert motion.overshoot_m == pytest.approx(0.003)


def test_a_pose_that_jumped_is_not_taken_in() -> None:
    # 0.1 s at 0.4 m/s: twice that, plus 0.1 m, is 0.18 m.
    motion = StraightMotion(START, 3.0, LIMITS)
    assert motion.observe(replace(START, received=0.1, pose=BasePose(0.17, 0.0, 0.0)))
    assert not motion.observe(replace(START, received=0.2, pose=BasePose(0.17 + 0.19, 0.0, 0.0)))
    assert motion.traveled_m == 0.17


@pytest.mark.parametrize("distance_m", [0.0, math.nan, math.inf])
def test_a_way_of_no_length_is_refused(distance_m: float) -> None:
    with pytest.raises(ValueError, match="not 0"):
        StraightMotion(START, distance_m, LIMITS)


def test_where_it_starts_does_not_matter() -> None:
    plant = Plant(x_m=7.0, y_m=-3.0, yaw_rad=2.0)
    motion = StraightMotion(plant.odometry(0.0), 1.0, LIMITS)
    assert motion.remaining_m == 1.0
