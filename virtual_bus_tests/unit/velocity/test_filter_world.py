"""A base that drives among obstacles never touches one, whatever it is ordered; and it gets where it may go."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from canbase_config.robot import Robot
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.decision import Action
from canbase_velocity.twist import ZERO, Twist
from support.filter_world import FilterWorld, robot_with

ROBOT = robot_with()
"""Footprint 0.3 m to all sides, 0.8 m/s and 2 rad/s at most, stop distance 0.15 m, a ramp of 1 m/s²."""

places_m = st.tuples(st.floats(-2.5, 2.5), st.floats(-2.5, 2.5))
twists = st.builds(Twist, st.floats(-1.2, 1.2), st.floats(-3.0, 3.0)) | st.sampled_from(
    [ZERO, Twist(0.8, 0.0), Twist(-0.8, 0.0), Twist(0.0, 2.0), Twist(0.0, -2.0), Twist(0.8, 2.0), Twist(-0.8, 2.0)]
)
streams = st.lists(st.tuples(twists, st.floats(0.02, 2.0)), min_size=1, max_size=6)


@settings(max_examples=30, deadline=None)
@given(
    places=st.lists(places_m, min_size=1, max_size=25),
    stream=streams,
    scan_period_s=st.sampled_from([0.05, 0.1, 0.2]),
    lag_s=st.sampled_from([0.0, 0.05, 0.08]),
)
def test_whatever_is_ordered_no_obstacle_is_touched(
    places: list[tuple[float, float]], stream: list[tuple[Twist, float]], scan_period_s: float, lag_s: float
) -> None:
    world = FilterWorld(ROBOT, np.array(places), scan_period_s, lag_s)
    assume(world.gap_m > 0.02)
    for command, duration_s in stream:
        assert world.run(command, duration_s) > 0.0
    assert world.run(ZERO, 2.0) > 0.0


def world_with(*places_at_m: tuple[float, float]) -> FilterWorld:
    return FilterWorld(ROBOT, np.array(places_at_m).reshape(-1, 2))


def step_in(world: FilterWorld, before_m: float) -> None:
    """Somebody stands that far before the footprint all of a sudden."""
    x_m = world.pose.x_m + world.box.front_m + before_m
    world.obstacles = np.array([(x_m, 0.0), (x_m, 0.05)])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_base_that_drives_at_a_wall_stands_at_the_stop_distance(sign: float) -> None:
    world = world_with((2.0 * sign, 0.0), (2.0 * sign, 0.05))
    least_m = world.run(Twist(0.8 * sign, 0.0), 8.0)
    assert 0.14 < least_m <= 0.165  # with 0.01 m of padding
    assert world.emergencies == 0
    assert world.decision is not None
    assert (world.decision.action, world.decision.cause) == (Action.STOP, StopCause.OBSTACLE)
    assert world.run(Twist(-0.8 * sign, 0.0), 1.0) == pytest.approx(least_m)  # away from it at once
    assert world.gap_m > 0.3


def test_a_turn_on_the_spot_beside_a_wall_stops_before_the_corner_touches() -> None:
    world = world_with(*((x_m / 20.0, 0.4) for x_m in range(-20, 21)))
    assert 0.0 < world.run(Twist(0.0, 1.0), 6.0) < 0.1
    assert 0.0 < abs(world.pose.yaw_rad) < 0.5
    assert world.run(Twist(0.0, -1.0), 2.0) > 0.0


def test_along_a_wall_beside_it_the_base_drives_at_full_speed() -> None:
    world = world_with(*((x_m / 20.0, 0.34) for x_m in range(-10, 120)))
    assert world.run(Twist(0.8, 0.0), 5.0) == pytest.approx(0.04)
    assert world.path_m > 3.4


def test_who_steps_in_front_of_the_base_makes_it_brake_hard() -> None:
    """At 0.8 m/s the ordinary ramp needs 0.32 m, and until the scan is heard and the wheels follow 0.12 m go by."""
    world = world_with((9.0, 0.0))
    world.run(Twist(0.8, 0.0), 3.0)
    step_in(world, 0.3)
    assert world.run(Twist(0.8, 0.0), 2.0) > 0.0
    assert world.emergencies > 0


def test_without_the_emergency_deceleration_it_would_have_been_touched() -> None:
    limits = ROBOT.limits.model_copy(update={"emergency_deceleration_mps2": 1.0})
    world = FilterWorld(ROBOT.model_copy(update={"limits": limits}), np.array([(9.0, 0.0)]))
    world.run(Twist(0.8, 0.0), 3.0)
    step_in(world, 0.3)
    assert world.run(Twist(0.8, 0.0), 2.0) == 0.0


def test_who_pulls_the_stick_back_as_somebody_steps_in_keeps_the_hard_braking() -> None:
    """Zero, a creep and a slower order are all lower than 0.8 m/s; each needs the emergency deceleration."""
    for creep_mps in (0.0, 0.05, -0.1, 0.3):
        world = world_with((9.0, 0.0))
        world.run(Twist(0.8, 0.0), 3.0)
        step_in(world, 0.3)
        assert world.run(Twist(creep_mps, 0.0), 2.0) > 0.0, creep_mps
        assert world.emergencies > 0, creep_mps


def test_hard_braking_lasts_until_standstill_though_the_scanner_is_silent_then() -> None:
    world = world_with((9.0, 0.0))
    world.run(Twist(0.8, 0.0), 3.0)
    step_in(world, 0.3)
    world.run(Twist(0.8, 0.0), 0.2)
    assert world.decision is not None
    assert world.decision.emergency
    world.scans = False
    assert world.run(Twist(0.8, 0.0), 0.4) > 0.0
    assert world.decision.emergency or world.decision.cause is StopCause.SCAN_STALE
    before_m = world.path_m
    world.run(Twist(0.8, 0.0), 1.0)
    assert world.path_m == pytest.approx(before_m, abs=0.02)


def soft(jerk_mps3: float, **changes: float) -> Robot:
    limits = ROBOT.limits.model_copy(update={"jerk_mps3": jerk_mps3, **changes})
    return ROBOT.model_copy(update={"limits": limits})


@pytest.mark.parametrize(
    ("robot", "emergencies"),
    [(soft(10.0), 0), (soft(1.0), 0), (soft(0.2), 0), (soft(0.2, deceleration_mps2=0.4), 0), (soft(1000.0), 0)],
)
def test_with_any_jerk_limit_of_the_driver_the_wall_is_not_touched(robot: Robot, emergencies: int) -> None:
    """0.8 m/s at a wall 4 m ahead: with 0.2 m/s³ alone the stop takes 4 s and 1.6 m."""
    world = FilterWorld(robot, np.array([(5.0, 0.0), (5.0, 0.05)]))
    least_m = world.run(Twist(0.8, 0.0), 25.0)
    assert 0.1 < least_m < 0.2
    assert world.emergencies == emergencies


@settings(max_examples=15, deadline=None)
@given(
    places=st.lists(places_m, min_size=1, max_size=25),
    stream=streams,
    jerk_mps3=st.sampled_from([0.2, 1.0, 10.0]),
    deceleration_mps2=st.sampled_from([0.4, 1.0]),
)
def test_whatever_is_ordered_and_however_soft_the_ramps_are_no_obstacle_is_touched(
    places: list[tuple[float, float]], stream: list[tuple[Twist, float]], jerk_mps3: float, deceleration_mps2: float
) -> None:
    world = FilterWorld(soft(jerk_mps3, deceleration_mps2=deceleration_mps2), np.array(places))
    assume(world.gap_m > 0.02)
    for command, duration_s in stream:
        assert world.run(command, duration_s) > 0.0
    assert world.run(ZERO, 5.0) > 0.0
