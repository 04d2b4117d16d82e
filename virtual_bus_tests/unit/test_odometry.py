"""Odometry: unwrapping, what counts as travel and what does not, arcs against their closed form, covariance."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_driver.kinematics import Twist2D
from canbase_driver.odometry import (
    POSE_FLOOR_M2,
    POSE_FLOOR_RAD2,
    TWIST_FLOOR,
    UNMEASURED,
    Odometry,
    Pose2D,
    WheelTravel,
    unwrap,
    wrap_angle,
)

property_of_all = settings(deadline=None)
I32_MIN, I32_MAX = -(2**31), 2**31 - 1
TRACK_M = 0.4
DT_S = 0.01
MM = 0.001
"""One count is one millimetre of rim in these tests, and 20 counts a cycle are possible."""


def wheel(*raw: int) -> WheelTravel:
    """A wheel that has seen these samples, one a cycle."""
    travel = WheelTravel(MM, 20)
    for sample in raw:
        travel.update(sample)
    return travel


# Unwrapping


@pytest.mark.parametrize(
    ("previous", "raw", "difference"),
    [
        (0, 0, 0),
        (0, 1, 1),
        (0, -1, -1),
        (I32_MAX, I32_MIN, 1),
        (I32_MIN, I32_MAX, -1),
        (I32_MAX - 2, I32_MIN + 2, 5),
        (I32_MIN + 2, I32_MAX - 2, -5),
        (0xFFFF_FFFF, 0, 1),  # the same bits given as u32
        (0, 0xFFFF_FFFF, -1),
        (-1, 0xFFFF_FFFF, 0),
        (0, I32_MAX, I32_MAX),
        (0, I32_MIN, I32_MIN),
        (I32_MAX, -1, I32_MIN),
    ],
)
def test_the_difference_is_the_shorter_way_round(previous: int, raw: int, difference: int) -> None:
    assert unwrap(previous, raw) == difference


@property_of_all
@given(st.integers(I32_MIN, I32_MAX), st.integers(I32_MIN, I32_MAX))
def test_a_step_of_half_the_range_or_less_is_found_again(start: int, step: int) -> None:
    wrapped = (start + step - I32_MIN) % 2**32 + I32_MIN
    assert unwrap(start, wrapped) == step


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(0.0, 0.0), (3.0, 3.0), (3.5, 3.5 - math.tau), (-3.5, math.tau - 3.5), (7.0 * math.tau + 0.25, 0.25)],
)
def test_an_angle_is_wrapped_into_one_turn(angle: float, wrapped: float) -> None:
    assert wrap_angle(angle) == pytest.approx(wrapped)


# Travel of one wheel


def test_before_the_first_sample_there_is_no_reference_and_no_travel() -> None:
    assert not wheel().referenced
    assert wheel().travel_m == 0.0


@pytest.mark.parametrize("first", [0, 1, -1, 123_456, I32_MAX, I32_MIN])
def test_the_first_sample_is_an_offset_wherever_it_is(first: int) -> None:
    travel = WheelTravel(MM, 20)
    assert travel.update(first) == 0.0
    assert travel.referenced
    assert travel.update(first + 20) == pytest.approx(0.020)
    assert travel.jumps == 0


@pytest.mark.parametrize("direction", [1, -1])
def test_a_wheel_rolls_over_the_end_of_the_counter_and_back(direction: int) -> None:
    near_the_end = I32_MAX - 25
    there = [(near_the_end + direction * 10 * k - I32_MIN) % 2**32 + I32_MIN for k in range(8)]
    assert wheel(*there).travel_m == pytest.approx(direction * 0.070)
    assert wheel(*there, *reversed(there)).travel_m == 0.0
    assert wheel(*there, *reversed(there)).jumps == 0


def test_a_mirrored_axis_counts_down_while_the_wheel_rolls_forward() -> None:
    travel = WheelTravel(-MM, 20)
    travel.update(0)
    assert travel.update(-10) == pytest.approx(0.010)


def test_after_a_power_cycle_the_travel_goes_on_from_where_it_was() -> None:
    travel = wheel(5_000, 5_010, 5_020)
    travel.reset_reference()
    assert not travel.referenced
    assert travel.update(0) == pytest.approx(0.020)  # the drive counts from 0 again
    assert travel.update(-5) == pytest.approx(0.015)
    assert (travel.jumps, travel.losses) == (0, 0)


@pytest.mark.parametrize(("step", "taken"), [(20, True), (21, False), (-20, True), (-21, False), (2**31 - 1, False)])
def test_a_step_beyond_what_the_wheel_can_do_is_dropped_and_counted(step: int, taken: bool) -> None:
    travel = wheel(100, 100 + step)
    assert travel.referenced is taken
    assert travel.travel_m == pytest.approx({True: step * MM, False: 0.0}[taken])
    assert travel.jumps == int(not taken)


def test_missed_cycles_allow_a_longer_step() -> None:
    travel = wheel(0)
    assert travel.update(60, cycles=3) == pytest.approx(0.060)
    assert travel.update(121, cycles=3) == pytest.approx(0.060)
    assert travel.jumps == 1


def test_one_wild_sample_costs_nothing_when_the_next_one_comes_back() -> None:
    travel = wheel(0, 10, 70_000, 30, 40)
    assert travel.travel_m == pytest.approx(0.040)
    assert (travel.jumps, travel.losses) == (1, 0)
    assert travel.referenced


@pytest.mark.parametrize("jump", [21, 41, 50, 61, -61, 1_000_000, 2**31 - 1])
def test_a_counter_that_has_moved_for_good_becomes_the_new_reference_at_the_third_sample(jump: int) -> None:
    travel = wheel(0, 10, 10 + jump)
    assert travel.update(10 + jump) == pytest.approx(0.010)
    assert not travel.referenced
    assert travel.update(10 + jump + 5) == pytest.approx(0.010)
    assert travel.referenced
    assert (travel.jumps, travel.losses) == (3, 1)
    assert travel.update(10 + jump + 10) == pytest.approx(0.015)


def test_samples_that_are_all_over_the_place_never_become_a_reference() -> None:
    travel = wheel(0, *(sign * k * 1_000_000 for k in range(1, 40) for sign in (1, -1)))
    assert travel.travel_m == 0.0
    assert not travel.referenced
    assert (travel.jumps, travel.losses) == (78, 0)


@property_of_all
@given(st.lists(st.integers(I32_MIN, I32_MAX), max_size=30))
def test_whatever_the_bus_says_no_cycle_adds_more_travel_than_the_wheel_can_do(samples: list[int]) -> None:
    travel, cycles_since_taken = WheelTravel(MM, 20), 0
    travel.update(0)
    for sample in samples:
        before, jumps = travel.travel_m, travel.jumps
        cycles_since_taken += 1
        travel.update(sample)
        assert abs(travel.travel_m - before) <= 20 * MM * cycles_since_taken + 1e-12
        cycles_since_taken *= travel.jumps - jumps


@pytest.mark.parametrize("max_step", [0, -1, 2**31, math.nan])
def test_a_greatest_step_that_cannot_tell_a_jump_from_a_wrap_is_refused(max_step: float) -> None:
    with pytest.raises(ValueError, match="max_step_counts"):
        WheelTravel(MM, max_step)


@pytest.mark.parametrize("scale", [0.0, math.nan, math.inf])
def test_a_count_that_is_no_length_is_refused(scale: float) -> None:
    with pytest.raises(ValueError, match="metres_per_count"):
        WheelTravel(scale, 20)


def test_two_samples_of_one_cycle_are_a_mistake_of_the_caller() -> None:
    with pytest.raises(ValueError, match="at least one cycle"):
        wheel(0).update(1, cycles=0)


# Pose


def run(odometry: Odometry, left_m: float, right_m: float, steps: int) -> Pose2D:
    """Both sides roll evenly from 0 to these travels."""
    for step in range(steps + 1):
        odometry.update(left_m * step / steps, right_m * step / steps, DT_S)
    return odometry.pose


def assert_pose(pose: Pose2D, x_m: float, y_m: float, yaw_rad: float, within: float = 1e-9) -> None:
    assert (pose.x_m, pose.y_m, pose.yaw_rad) == pytest.approx((x_m, y_m, yaw_rad), abs=within)


@pytest.mark.parametrize("steps", [1, 7, 1000])
@pytest.mark.parametrize(
    ("left_m", "right_m", "x_m", "y_m", "yaw_rad"),
    [
        (1.0, 1.0, 1.0, 0.0, 0.0),
        (-1.0, -1.0, -1.0, 0.0, 0.0),
        # A quarter of a circle of 1 m: π/2 × 0.8 m and × 1.2 m; ends 1 m ahead and 1 m to the left
        (0.4 * math.pi, 0.6 * math.pi, 1.0, 1.0, math.pi / 2.0),
        (0.6 * math.pi, 0.4 * math.pi, 1.0, -1.0, -math.pi / 2.0),
        (-0.4 * math.pi, -0.6 * math.pi, -1.0, 1.0, -math.pi / 2.0),
        # In place: half a turn is π × 0.2 m on each side
        (-0.2 * math.pi, 0.2 * math.pi, 0.0, 0.0, math.pi),
        (0.2 * math.pi, -0.2 * math.pi, 0.0, 0.0, -math.pi),
        # About the left wheel, half a turn: the base ends 0.4 m to the left
        (0.0, 0.4 * math.pi, 0.0, 0.4, math.pi),
        # Full circles, small and wide
        (1.6 * math.pi, 2.4 * math.pi, 0.0, 0.0, math.tau),
        (2.4 * math.pi, 1.6 * math.pi, 0.0, 0.0, -math.tau),
        (199.6 * math.pi, 200.4 * math.pi, 0.0, 0.0, math.tau),
        # Nothing at all
        (0.0, 0.0, 0.0, 0.0, 0.0),
    ],
)
def test_an_even_run_ends_where_geometry_says_in_any_number_of_steps(
    left_m: float, right_m: float, x_m: float, y_m: float, yaw_rad: float, steps: int
) -> None:
    assert_pose(run(Odometry(TRACK_M), left_m, right_m, steps), x_m, y_m, yaw_rad)


@pytest.mark.parametrize("turn_rad", [0.0, 1e-300, -1e-12, 1.9e-4, -1.9e-4, 2.1e-4, 5e-4])
def test_next_to_straight_the_arc_loses_no_digit(turn_rad: float) -> None:
    pose = run(Odometry(TRACK_M), 1.0 - turn_rad * 0.2, 1.0 + turn_rad * 0.2, 1)
    # 1 m of arc: x = sin(a)/a, y = (1 − cos a)/a, by their series
    assert_pose(pose, 1.0 - turn_rad**2 / 6.0, turn_rad / 2.0 - turn_rad**3 / 24.0, turn_rad, within=3e-15)


def test_a_spiral_agrees_with_a_fine_integration() -> None:
    """0.5 m/s for 4 s, turning faster and faster: yaw = t² / 4. Arcs of 10 ms against the midpoint rule at 20 µs."""
    fine_s = 20e-6
    middles_s = [(k + 0.5) * fine_s for k in range(200_000)]
    x_m = math.fsum(0.5 * math.cos(t * t / 4.0) * fine_s for t in middles_s)
    y_m = math.fsum(0.5 * math.sin(t * t / 4.0) * fine_s for t in middles_s)

    odometry = Odometry(TRACK_M)
    for k in range(401):
        t = k * DT_S
        odometry.update(0.5 * t - 0.2 * t * t / 4.0, 0.5 * t + 0.2 * t * t / 4.0, DT_S)

    assert_pose(odometry.pose, x_m, y_m, 4.0, within=5e-6)


def test_yaw_counts_the_turns() -> None:
    pose = run(Odometry(TRACK_M), -2.0 * math.pi, 2.0 * math.pi, 500)  # 4π / 0.4 rad: five turns
    assert pose.yaw_rad == pytest.approx(5.0 * math.tau)


def test_the_first_travel_is_the_reference_and_no_motion() -> None:
    odometry = Odometry(TRACK_M)
    assert odometry.update(12.0, -3.0, DT_S) == Twist2D.ZERO
    assert odometry.pose == Pose2D()
    odometry.update(12.1, -2.9, DT_S)
    assert_pose(odometry.pose, 0.1, 0.0, 0.0)


def test_the_twist_is_the_mean_since_the_update_before_at_irregular_times() -> None:
    odometry = Odometry(TRACK_M)
    odometry.update(0.0, 0.0, 0.01)
    first = odometry.update(0.004, 0.006, 0.01)
    assert (first.linear_mps, first.angular_radps) == pytest.approx((0.5, 0.5))  # 5 mm and 2 mm / 0.4 m in 10 ms
    second = odometry.update(0.008, 0.012, 0.02)
    assert (second.linear_mps, second.angular_radps) == pytest.approx((0.25, 0.25))
    assert odometry.twist == second
    third = odometry.update(0.008 + 4e-7, 0.012 + 6e-7, 1e-6)
    assert third.linear_mps == pytest.approx(0.5)


def test_a_reset_moves_the_base_and_not_the_wheels() -> None:
    odometry = Odometry(TRACK_M)
    run(odometry, 1.0, 1.0, 10)
    odometry.reset(Pose2D(5.0, 6.0, math.pi / 2.0))
    assert odometry.twist == Twist2D.ZERO
    odometry.update(1.5, 1.5, DT_S)
    assert_pose(odometry.pose, 5.0, 6.5, math.pi / 2.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_refused_and_changes_nothing(bad: float) -> None:
    odometry = Odometry(TRACK_M)
    run(odometry, 0.9, 1.1, 10)
    pose, twist = odometry.pose, odometry.twist
    refused = ((bad, 1.0, DT_S), (1.0, bad, DT_S), (1.0, 1.0, bad), (1.0, 1.0, 0.0), (1.0, 1.0, -1.0))
    for left_m, right_m, dt_s in refused:
        with pytest.raises(ValueError, match="must be"):
            odometry.update(left_m, right_m, dt_s)
    assert (odometry.pose, odometry.twist) == (pose, twist)
    odometry.update(0.9, 1.1, DT_S)
    assert odometry.pose == pose


STEPS = st.lists(st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)), max_size=30)


@property_of_all
@given(STEPS)
def test_the_way_back_ends_at_the_start(steps: list[tuple[float, float]]) -> None:
    travels = [(0.0, 0.0)]
    for left_m, right_m in steps:
        travels.append((travels[-1][0] + left_m, travels[-1][1] + right_m))
    odometry = Odometry(TRACK_M)
    for left_m, right_m in travels + travels[::-1]:
        odometry.update(left_m, right_m, DT_S)
    assert_pose(odometry.pose, 0.0, 0.0, 0.0, within=1e-12)


# Covariance


def test_at_the_start_the_covariance_is_its_floor_in_the_order_of_ros() -> None:
    floor = [POSE_FLOOR_M2, POSE_FLOOR_M2, UNMEASURED, UNMEASURED, UNMEASURED, POSE_FLOOR_RAD2]
    matrix = Odometry(TRACK_M).pose_covariance()
    assert len(matrix) == 36
    assert [matrix[7 * k] for k in range(6)] == floor
    assert [value for place, value in enumerate(matrix) if place % 7] == [0.0] * 30


def test_the_covariance_grows_with_every_metre_forward_or_back_and_with_every_turn() -> None:
    odometry = Odometry(TRACK_M)
    grown = [odometry.pose_covariance()]
    for left_m, right_m in ((0.0, 0.0), (1.0, 1.0), (0.0, 0.0), (-0.2, 0.2), (0.0, 0.0)):
        odometry.update(left_m, right_m, DT_S)
        grown.append(odometry.pose_covariance())
    start, reference, ahead, back, turned, turned_back = grown
    assert reference == start
    assert ahead[0] == pytest.approx(1e-4, rel=0.02)  # 1 cm after 1 m
    for before, after in pairwise((reference, ahead, back)):
        assert [after[place] > before[place] for place in (0, 7, 35)] == [True] * 3
    assert turned_back[0] == back[0]
    assert turned_back[35] > turned[35] > back[35]
    odometry.reset(Pose2D())
    assert odometry.pose_covariance() == start


def test_the_covariance_of_the_velocity_grows_with_the_velocity_and_falls_with_it() -> None:
    odometry = Odometry(TRACK_M)
    odometry.update(0.0, 0.0, DT_S)
    standing = odometry.twist_covariance()
    assert [standing[7 * k] for k in (0, 1, 5)] == [TWIST_FLOOR] * 3
    odometry.update(0.009, 0.011, DT_S)
    moving = odometry.twist_covariance()
    assert (moving[0], moving[7], moving[35]) == pytest.approx((0.0004, 1e-6, 0.0001), rel=0.02)
    odometry.update(0.009, 0.011, DT_S)
    assert odometry.twist_covariance() == standing
