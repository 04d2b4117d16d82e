"""Turning in place: signs, more than one turn, and the whole motion in virtual time over many goals and bases."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_action_server.along_track import BasePose
from canbase_action_server.goal_request import RotateRequest
from canbase_action_server.inputs import Odometry
from canbase_action_server.motion_limits import lever_m, turn_limits
from canbase_action_server.outcome import ErrorCode
from canbase_action_server.turn import TurnMotion
from support.action_plant import Plant, Story, bench_robot, rotate
from support.goal_queue_world import GoalQueueWorld, robot_with

ROBOT = bench_robot()  # action.*: 0.02 to 63 rad, 0.1 to 1.5 rad/s; the wheels are 0.25 m from the middle
LEVER_M = 0.25
START = Odometry(0.0, BasePose(0.0, 0.0, 3.0), 0.0, 0.0)
TOLERANCE_M = 0.005


def turning(angle_rad: float, *yaws: float) -> TurnMotion:
    """After these headings, 0.1 s apart."""
    motion = TurnMotion(START, angle_rad, LEVER_M, turn_limits(ROBOT, 1.5))
    for index, yaw_rad in enumerate(yaws):
        assert motion.observe(replace(START, received=0.1 * (index + 1), pose=BasePose(0.0, 0.0, yaw_rad)))
    return motion


def test_the_heading_may_wrap_and_the_angle_does_not() -> None:
    motion = turning(7.0, 3.1, -3.1, -2.9)  # 3.0 → 3.1 → 3.18 → 3.38
    assert motion.traveled_m / LEVER_M == pytest.approx(0.1 + (2 * math.pi - 6.2) + 0.2)
    assert motion.remaining_m / LEVER_M == pytest.approx(7.0 - 0.3 - (2 * math.pi - 6.2))


def test_clockwise_counts_down_and_can_be_overshot() -> None:
    motion = turning(-0.2, 2.9, 2.79, 2.8)
    assert motion.traveled_m / LEVER_M == pytest.approx(-0.2)
    assert motion.overshoot_m / LEVER_M == pytest.approx(0.01)


def test_the_order_turns_and_never_drives() -> None:
    motion = turning(-3.0)
    orders = [motion.order(0.02 * cycle) for cycle in range(100)]
    assert {order.linear_mps for order in orders if order} == {0.0}
    assert min(order.angular_radps for order in orders if order) == pytest.approx(-1.5, abs=0.01)


@pytest.mark.parametrize("pose", [BasePose(0.0, 0.0, 1.0), BasePose(0.3, 0.0, 3.0)])
def test_a_pose_that_jumped_is_not_taken_in(pose: BasePose) -> None:
    motion = turning(3.0)
    assert not motion.observe(replace(START, received=0.02, pose=pose))
    assert motion.traveled_m == 0.0


@pytest.mark.parametrize("angle_rad", [0.02, -0.02, 63.0, -63.0, 6.2832])
def test_angles_within_the_limits_are_good(angle_rad: float) -> None:
    assert RotateRequest(angle_rad, 0.5).range_reason(ROBOT) is None


@pytest.mark.parametrize("angle_rad", [0.0, 0.0199, -0.0199, 63.01, math.nan, math.inf, -math.inf])
def test_an_angle_outside_is_refused(angle_rad: float) -> None:
    assert "|angle_rad|" in str(RotateRequest(angle_rad, 0.5).range_reason(ROBOT))


@pytest.mark.parametrize("speed_radps", [0.0, -0.5, 0.0999, 1.501, math.nan, math.inf])
def test_a_speed_outside_is_refused(speed_radps: float) -> None:
    assert "max_speed_radps" in str(RotateRequest(1.0, speed_radps).range_reason(ROBOT))


@settings(max_examples=30, deadline=None)
@given(
    angle_rad=st.floats(math.log(0.02), math.log(20.0)).map(math.exp),
    sign=st.sampled_from([1.0, -1.0]),
    speed_radps=st.floats(0.2, 1.5),
    dead_time_s=st.floats(0.010, 0.040),
    lag_s=st.floats(0.020, 0.050),
    odometry_hz=st.floats(25.0, 50.0),
    seed=st.integers(0, 1000),
)
def test_every_turn_ends_at_its_angle_whatever_the_base(
    angle_rad: float, sign: float, speed_radps: float, dead_time_s: float, lag_s: float, odometry_hz: float, seed: int
) -> None:
    plant = Plant(dead_time_s=dead_time_s, lag_s=lag_s)
    story = rotate(plant, sign * angle_rad, speed_radps, odometry_hz=odometry_hz, jitter=random.Random(seed))
    began_rad = plant.yaw_rad
    end = story.run()
    assert end.code is ErrorCode.OK, end.message
    assert end.traveled_m == pytest.approx(sign * angle_rad * LEVER_M, abs=TOLERANCE_M)
    assert plant.yaw_rad - began_rad == pytest.approx(sign * angle_rad, abs=TOLERANCE_M / LEVER_M)
    assert end.overshoot_m <= TOLERANCE_M
    assert story.fastest_radps <= speed_radps * 1.01
    assert story.fastest_mps == 0.0
    assert "turned" in end.message


def test_a_base_that_is_stuck_makes_no_progress() -> None:
    assert rotate(Plant(stuck=True), 1.0, 0.5).run().code is ErrorCode.NO_PROGRESS


def test_a_drive_and_a_turn_share_the_one_base() -> None:
    world = GoalQueueWorld(robot_with("reject"))
    world.ask_way(0.3)
    assert world.ask(RotateRequest(1.0, 0.5)) is None
    assert "busy" in world.refusals[0]


def test_the_lever_is_half_the_track() -> None:
    assert lever_m(ROBOT) == LEVER_M


@pytest.mark.parametrize(("angle_rad", "slow"), [(2.0, "left"), (-2.0, "left"), (2.0, "right"), (-2.0, "right")])
def test_a_base_that_swings_about_one_wheel_drifts_away_and_the_wheel_is_named(angle_rad: float, slow: str) -> None:
    motion = TurnMotion(Odometry(0.0, BasePose(1.0, 2.0, 0.7), 0.0, 0.0), angle_rad, 0.2, turn_limits(ROBOT, 1.5))
    side_m = 0.2 if slow == "left" else -0.2  # the wheel that stands, in the frame of the base
    for share in (0.03, 0.06, 0.09, 0.12, 0.15):
        turned = share * angle_rad
        along_m, lateral_m = side_m * math.sin(turned), side_m * (1.0 - math.cos(turned))
        x_m = 1.0 + along_m * math.cos(0.7) - lateral_m * math.sin(0.7)
        y_m = 2.0 + along_m * math.sin(0.7) + lateral_m * math.cos(0.7)
        assert motion.observe(Odometry(10.0 * share, BasePose(x_m, y_m, 0.7 + turned), 0.0, 0.0))
        assert bool(motion.strayed(0.05, 0.2)) is (0.4 * abs(math.sin(turned / 2.0)) > 0.05)
    assert f"does the {slow} wheel turn as ordered?" in motion.strayed(0.05, 0.2)


def test_a_turn_that_drifts_away_ends_at_once_with_drive_fault() -> None:
    def push(story: Story) -> None:
        story.plant.x_m += 0.06

    story = rotate(Plant(), 3.0, 1.0, at={1.0: push})
    end = story.run()
    assert end.code is ErrorCode.DRIVE_FAULT
    assert "0.060 m away from where the turn began" in end.message
    assert story.ended_at < 2.0
