"""The pose of the base: arcs against their closed form, refused input. Covariance: test_pose_error.py."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_config.odometry import OdometrySettings
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.odometry import Odometry, Pose2D, wrap_angle

property_of_all = settings(deadline=None)
TRACK_M = 0.4
DT_S = 0.01
SETTINGS = OdometrySettings()


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(0.0, 0.0), (3.0, 3.0), (3.5, 3.5 - math.tau), (-3.5, math.tau - 3.5), (7.0 * math.tau + 0.25, 0.25)],
)
def test_an_angle_is_wrapped_into_one_turn(angle: float, wrapped: float) -> None:
    assert wrap_angle(angle) == pytest.approx(wrapped)


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
    assert_pose(run(Odometry(TRACK_M, SETTINGS), left_m, right_m, steps), x_m, y_m, yaw_rad)


@pytest.mark.parametrize("turn_rad", [0.0, 1e-300, -1e-12, 1.9e-4, -1.9e-4, 2.1e-4, 5e-4])
def test_next_to_straight_the_arc_loses_no_digit(turn_rad: float) -> None:
    pose = run(Odometry(TRACK_M, SETTINGS), 1.0 - turn_rad * 0.2, 1.0 + turn_rad * 0.2, 1)
    # 1 m of arc: x = sin(a)/a, y = (1 − cos a)/a, by their series
    assert_pose(pose, 1.0 - turn_rad**2 / 6.0, turn_rad / 2.0 - turn_rad**3 / 24.0, turn_rad, within=3e-15)


def test_a_spiral_agrees_with_a_fine_integration() -> None:
    """0.5 m/s for 4 s, turning faster and faster: yaw = t² / 4. Arcs of 10 ms against the midpoint rule at 20 µs."""
    fine_s = 20e-6
    middles_s = [(k + 0.5) * fine_s for k in range(200_000)]
    x_m = math.fsum(0.5 * math.cos(t * t / 4.0) * fine_s for t in middles_s)
    y_m = math.fsum(0.5 * math.sin(t * t / 4.0) * fine_s for t in middles_s)

    odometry = Odometry(TRACK_M, SETTINGS)
    for k in range(401):
        t = k * DT_S
        odometry.update(0.5 * t - 0.2 * t * t / 4.0, 0.5 * t + 0.2 * t * t / 4.0, DT_S)

    assert_pose(odometry.pose, x_m, y_m, 4.0, within=5e-6)


def test_yaw_counts_the_turns() -> None:
    pose = run(Odometry(TRACK_M, SETTINGS), -2.0 * math.pi, 2.0 * math.pi, 500)  # 4π / 0.4 rad: five turns
    assert pose.yaw_rad == pytest.approx(5.0 * math.tau)


def test_the_first_travel_is_the_reference_and_no_motion() -> None:
    odometry = Odometry(TRACK_M, SETTINGS)
    assert odometry.update(12.0, -3.0, DT_S) == Twist2D.ZERO
    assert odometry.pose == Pose2D()
    odometry.update(12.1, -2.9, DT_S)
    assert_pose(odometry.pose, 0.1, 0.0, 0.0)


def test_the_twist_is_the_mean_since_the_update_before_at_irregular_times() -> None:
    odometry = Odometry(TRACK_M, SETTINGS)
    odometry.update(0.0, 0.0, 0.01)
    first = odometry.update(0.004, 0.006, 0.01)
    assert (first.linear_mps, first.angular_radps) == pytest.approx((0.5, 0.5))  # 5 mm and 2 mm / 0.4 m in 10 ms
    second = odometry.update(0.008, 0.012, 0.02)
    assert (second.linear_mps, second.angular_radps) == pytest.approx((0.25, 0.25))
    assert odometry.twist == second
    third = odometry.update(0.008 + 4e-7, 0.012 + 6e-7, 1e-6)
    assert third.linear_mps == pytest.approx(0.5)


def test_a_reset_moves_the_base_and_not_the_wheels() -> None:
    odometry = Odometry(TRACK_M, SETTINGS)
    run(odometry, 1.0, 1.0, 10)
    odometry.reset(Pose2D(5.0, 6.0, math.pi / 2.0))
    assert odometry.twist == Twist2D.ZERO
    odometry.update(1.5, 1.5, DT_S)
    assert_pose(odometry.pose, 5.0, 6.5, math.pi / 2.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_refused_and_changes_nothing(bad: float) -> None:
    odometry = Odometry(TRACK_M, SETTINGS)
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
    odometry = Odometry(TRACK_M, SETTINGS)
    for left_m, right_m in travels + travels[::-1]:
        odometry.update(left_m, right_m, DT_S)
    assert_pose(odometry.pose, 0.0, 0.0, 0.0, within=1e-12)


def test_a_reset_or_lost_travel_changes_the_covariance_and_a_slip_ends_with_the_first_step_without() -> None:
    odometry = Odometry(TRACK_M, SETTINGS)
    start = odometry.pose_covariance()
    run(odometry, 1.0, 1.0, 100)
    driven = odometry.pose_covariance()
    odometry.update(1.1, 1.1, DT_S, 0.05, 0.0)
    odometry.update(1.2, 1.2, DT_S)
    slipped = odometry.pose_covariance()
    odometry.lose_reference(0.5)
    lost = odometry.pose_covariance()
    assert [slipped[35] - driven[35] > 0.015, lost[35] - slipped[35] > 1.0] == [True, True]  # (0.05 / 0.4)², 2/12/0.16
    odometry.reset(Pose2D())
    assert odometry.pose_covariance() == start
