"""The covariances of odom: simulated bases with the stated errors are found in the ellipses as often as chi² says.

Each base drives the path that its wheels report, with wheels, a track and a floor of its own. Odometry computes with
the values of robot.yaml. The true pose is compared with that of the odometry, in multiples of its covariance.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_config.odometry import OdometrySettings
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.odometry import Odometry
from canbase_driver.motion.pose_error import (
    POSE_FLOOR_M2,
    POSE_FLOOR_RAD2,
    TWIST_FLOOR,
    UNMEASURED,
    Covariance,
    PoseError,
    TwistError,
)

Array = npt.NDArray[np.float64]
Path = list[tuple[float, float]]
"""Steps (left, right) of the rims, as the encoders report them [m]."""

TRACK_M = 0.4
BASES = 4000
STEP_M = 0.005
CHI2_3 = {0.5: 2.366, 0.9: 6.251, 0.95: 7.815, 0.99: 11.345}
"""Chi² of three degrees of freedom below which this share lies."""
DEFAULTS = OdometrySettings()
RANDOM_ALONE = OdometrySettings(radius_error=1e-5, track_error=1e-5, travel_error_m=0.004)
SYSTEMATIC_ALONE = OdometrySettings(radius_error=0.001, track_error=0.003, travel_error_m=1e-5)
BOTH = OdometrySettings(radius_error=0.001, track_error=0.003)
"""As after a calibration. The ellipse is of first order: with the defaults, yaw is known to 8° after a square, and the
true poses lie on a bow."""


def straight(distance_m: float) -> Path:
    """Forward for a positive distance."""
    steps = round(abs(distance_m) / STEP_M)
    return [(math.copysign(STEP_M, distance_m), math.copysign(STEP_M, distance_m))] * steps


def turn(angle_rad: float) -> Path:
    """In place, to the left for a positive angle."""
    steps = round(abs(angle_rad) * TRACK_M / 2.0 / STEP_M)
    step_m = math.copysign(STEP_M, angle_rad)
    return [(-step_m, step_m)] * steps


def arc(distance_m: float, angle_rad: float) -> Path:
    steps = round(abs(distance_m) / STEP_M)
    half_m = angle_rad * TRACK_M / 2.0 / steps
    return [(distance_m / steps - half_m, distance_m / steps + half_m)] * steps


PATHS: dict[str, Path] = {
    "2 m straight": straight(2.0),
    "2 m there and back": straight(2.0) + straight(-2.0),
    "one turn": turn(math.tau),
    "a square of 1 m": (straight(1.0) + turn(math.pi / 2.0)) * 4,
    "an S": arc(1.0, 1.2) + arc(1.0, -1.2),
}


def odometry_of(path: Path, errors: OdometrySettings) -> Odometry:
    odometry = Odometry(TRACK_M, errors)
    left_m = right_m = 0.0
    odometry.update(0.0, 0.0, 0.01)
    for left, right in path:
        left_m, right_m = left_m + left, right_m + right
        odometry.update(left_m, right_m, 0.01)
    return odometry


def true_poses(path: Path, errors: OdometrySettings, seed: int) -> Array:
    """Of BASES bases: x, y, yaw, each after the same report of its wheels."""
    rng = np.random.default_rng(seed)
    sizes = 1.0 + errors.radius_error * rng.standard_normal((2, BASES))
    tracks = TRACK_M * (1.0 + errors.track_error * rng.standard_normal(BASES))
    x, y, yaw = np.zeros((3, BASES))
    for step in path:
        rolled = [
            side * size + errors.travel_error_m * math.sqrt(abs(side)) * rng.standard_normal(BASES)
            for side, size in zip(step, sizes, strict=True)
        ]
        way, bend = (rolled[0] + rolled[1]) / 2.0, (rolled[1] - rolled[0]) / tracks
        x += way * np.cos(yaw + bend / 2.0)
        y += way * np.sin(yaw + bend / 2.0)
        yaw += bend
    return np.stack([x, y, yaw])


def planar_part(matrix: Covariance) -> Array:
    """x, y and yaw of a 6 × 6."""
    return np.array(matrix).reshape(6, 6)[np.ix_((0, 1, 5), (0, 1, 5))]


@pytest.mark.parametrize("errors", [RANDOM_ALONE, SYSTEMATIC_ALONE, BOTH], ids=["random", "systematic", "both"])
@pytest.mark.parametrize("path", PATHS)
def test_the_ellipse_holds_as_many_bases_as_chi2_says(path: str, errors: OdometrySettings) -> None:
    odometry = odometry_of(PATHS[path], errors)
    pose = odometry.pose
    away = true_poses(PATHS[path], errors, seed=3) - np.array([[pose.x_m], [pose.y_m], [pose.yaw_rad]])
    # The floor is no error of the wheels; the bases have none, so it is drawn for them
    floor = np.sqrt([POSE_FLOOR_M2, POSE_FLOOR_M2, POSE_FLOOR_RAD2])[:, None]
    away += floor * np.random.default_rng(4).standard_normal(away.shape)
    squared = np.einsum("ik,ij,jk->k", away, np.linalg.inv(planar_part(odometry.pose_covariance())), away)
    for share, bound in CHI2_3.items():
        assert np.mean(squared < bound) == pytest.approx(share, abs=0.03), f"share within the {share:.0%} ellipse"


def test_what_is_systematic_comes_back_with_the_base_and_what_is_random_does_not() -> None:
    there = odometry_of(straight(2.0), SYSTEMATIC_ALONE).pose_covariance()
    back = odometry_of(straight(2.0) + straight(-2.0), SYSTEMATIC_ALONE).pose_covariance()
    assert there[0] == pytest.approx(2.0 * (0.5 * 2.0 * 0.001) ** 2, rel=0.5)  # two sides, each half of 2 m × 0.1 %
    assert back[0] == pytest.approx(POSE_FLOOR_M2, rel=0.01)
    there = odometry_of(straight(2.0), RANDOM_ALONE).pose_covariance()
    back = odometry_of(straight(2.0) + straight(-2.0), RANDOM_ALONE).pose_covariance()
    assert back[0] - POSE_FLOOR_M2 == pytest.approx(2.0 * (there[0] - POSE_FLOOR_M2), rel=0.01)


def test_at_the_start_the_covariance_is_its_floor_in_the_order_of_ros() -> None:
    matrix = PoseError(DEFAULTS, TRACK_M).covariance()
    assert [matrix[7 * k] for k in range(6)] == [
        *(POSE_FLOOR_M2, POSE_FLOOR_M2),
        *(UNMEASURED, UNMEASURED, UNMEASURED),
        POSE_FLOOR_RAD2,
    ]
    assert [value for place, value in enumerate(matrix) if place % 7] == [0.0] * 30


def test_an_encoder_that_flickers_for_a_day_at_a_stand_adds_nothing() -> None:
    error = PoseError(DEFAULTS, TRACK_M)
    before = error.covariance()
    for _ in range(10_000):
        error.roll(1e-4, 0.0)
        error.roll(-1e-4, 0.0)
    assert error.covariance() == before


def test_a_slip_moves_the_pose_along_as_far_as_it_may_and_the_next_one_is_independent() -> None:
    """Both wheels of one side slip by up to 4 cm, twice; what one slip does in parts is one error."""
    whole, in_parts, twice = (PoseError(RANDOM_ALONE, TRACK_M) for _ in range(3))
    whole.roll(0.0, 0.0, 0.04, 0.0)
    for _ in range(4):
        in_parts.roll(0.0, 0.0, 0.01, 0.0)
    for _ in range(2):
        twice.roll(0.0, 0.0, 0.04, 0.0)
        twice.end_slip()
    assert whole.covariance()[35] == pytest.approx((0.04 / TRACK_M) ** 2, rel=0.01)
    assert in_parts.covariance() == pytest.approx(whole.covariance())
    assert twice.covariance()[35] - POSE_FLOOR_RAD2 == pytest.approx(2 * (whole.covariance()[35] - POSE_FLOOR_RAD2))


def test_travel_that_nothing_has_measured_is_spread_evenly_over_all_that_was_possible() -> None:
    error = PoseError(DEFAULTS, TRACK_M)
    error.lose(0.3)
    rolled = np.random.default_rng(5).uniform(-0.3, 0.3, (2, 200_000))
    matrix = planar_part(error.covariance())
    assert matrix[0, 0] == pytest.approx(np.var((rolled[0] + rolled[1]) / 2.0), rel=0.02)
    assert matrix[2, 2] == pytest.approx(np.var((rolled[1] - rolled[0]) / TRACK_M), rel=0.02)


STEP = st.tuples(*[st.floats(-0.5, 0.5)] * 2, *[st.floats(0.0, 0.1)] * 2, st.sampled_from(("", "end", "lose")))
ROLLS = st.lists(STEP, max_size=40)


@settings(deadline=None)
@given(ROLLS)
def test_whatever_happens_it_is_symmetric_and_positive(rolls: list[tuple[float, float, float, float, str]]) -> None:
    error = PoseError(DEFAULTS, TRACK_M)
    for left_m, right_m, left_slip_m, right_slip_m, then in rolls:
        error.roll(left_m, right_m, left_slip_m, right_slip_m)
        if then == "end":
            error.end_slip()
        elif then == "lose":
            error.lose(0.2)
    whole = np.array(error.covariance()).reshape(6, 6)
    assert (whole == whole.T).all()
    assert (np.diag(whole) > 0.0).all()
    assert np.linalg.eigvalsh(planar_part(error.covariance())).min() >= -1e-9


# Of the velocity


def twist_errors(errors: OdometrySettings = DEFAULTS) -> TwistError:
    return TwistError(errors, TRACK_M, period_s=0.02)


def test_at_a_standstill_the_velocity_has_its_floor() -> None:
    matrix = twist_errors().covariance(Twist2D.ZERO)
    assert [matrix[7 * k] for k in (0, 1, 5)] == [TWIST_FLOOR] * 3
    assert [matrix[7 * k] for k in (2, 3, 4)] == [UNMEASURED] * 3


def test_a_filter_that_sums_the_velocities_up_arrives_at_the_variance_of_the_path() -> None:
    """1 m at 0.5 m/s in messages 20 ms apart, each independent of the others: 100 × variance × 0.02²."""
    velocity = planar_part(twist_errors(RANDOM_ALONE).covariance(Twist2D(0.5, 0.0)))
    path = planar_part(odometry_of(straight(1.0), RANDOM_ALONE).pose_covariance())
    for axis, floor in ((0, POSE_FLOOR_M2), (2, POSE_FLOOR_RAD2)):
        summed = 100 * (velocity[axis, axis] - TWIST_FLOOR) * 0.02**2
        assert summed == pytest.approx(path[axis, axis] - floor, rel=0.01)


def test_a_side_that_slips_makes_the_velocity_uncertain_while_it_slips() -> None:
    gripping = planar_part(twist_errors().covariance(Twist2D(0.5, 0.0)))
    slipping = planar_part(twist_errors().covariance(Twist2D(0.5, 0.0), 0.0, 0.3))
    assert slipping[0, 0] - gripping[0, 0] == pytest.approx(0.3**2 / 4.0)
    assert slipping[2, 2] - gripping[2, 2] == pytest.approx((0.3 / TRACK_M) ** 2)
    assert slipping[0, 2] > 0.0  # the right side: faster and to the left, or slower and to the right


@settings(deadline=None)
@given(st.floats(-2.0, 2.0), st.floats(-6.0, 6.0), st.floats(0.0, 2.0), st.floats(0.0, 2.0))
def test_the_covariance_of_any_velocity_is_symmetric_and_positive(
    linear_mps: float, angular_radps: float, left_mps: float, right_mps: float
) -> None:
    whole = np.array(twist_errors().covariance(Twist2D(linear_mps, angular_radps), left_mps, right_mps)).reshape(6, 6)
    assert (whole == whole.T).all()
    assert np.linalg.eigvalsh(whole).min() > 0.0
