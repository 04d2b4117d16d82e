"""Base velocity ↔ rim speeds: the arithmetic by hand, the signs of REP 103, and that the two are inverses."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_driver.motion.kinematics import Twist2D, base_twist, wheel_speeds

property_of_all = settings(deadline=None)
SPEEDS = st.floats(-20.0, 20.0)
TRACKS = st.floats(0.02, 5.0)


@pytest.mark.parametrize(
    ("twist", "left_mps", "right_mps"),
    [
        (Twist2D(0.5, 0.0), 0.5, 0.5),
        (Twist2D(-0.5, 0.0), -0.5, -0.5),
        (Twist2D(0.0, 2.0), -0.4, 0.4),  # 2.0 rad/s × 0.4 m / 2; counter-clockwise: the right wheel goes forward
        (Twist2D(0.0, -2.0), 0.4, -0.4),
        (Twist2D(1.0, 5.0), 0.0, 2.0),  # turns about its left wheel
        (Twist2D.ZERO, 0.0, 0.0),
    ],
)
def test_a_base_with_a_track_of_40_cm(twist: Twist2D, left_mps: float, right_mps: float) -> None:
    assert wheel_speeds(twist, 0.4) == pytest.approx((left_mps, right_mps))
    assert base_twist(left_mps, right_mps, 0.4) == twist


@property_of_all
@given(SPEEDS, SPEEDS, TRACKS)
def test_the_wheels_give_the_twist_back(linear_mps: float, angular_radps: float, track_m: float) -> None:
    twist = base_twist(*wheel_speeds(Twist2D(linear_mps, angular_radps), track_m), track_m)
    assert twist.linear_mps == pytest.approx(linear_mps, abs=1e-12)
    assert twist.angular_radps == pytest.approx(angular_radps, abs=1e-12 / track_m)


@property_of_all
@given(SPEEDS, SPEEDS, TRACKS)
def test_the_twist_gives_the_wheels_back(left_mps: float, right_mps: float, track_m: float) -> None:
    assert wheel_speeds(base_twist(left_mps, right_mps, track_m), track_m) == pytest.approx(
        (left_mps, right_mps), abs=1e-12
    )


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_one_component_that_is_not_finite_spoils_the_twist(bad: float) -> None:
    assert not Twist2D(bad, 0.0).is_finite
    assert not Twist2D(0.0, bad).is_finite
    assert Twist2D(1e308, -1e308).is_finite
