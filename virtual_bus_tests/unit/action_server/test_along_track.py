"""Displacement from a start pose against hand-worked numbers, and what does not depend on where one starts."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_action_server.along_track import BasePose, displacement, yaw_of_quaternion

ANGLE = st.floats(-math.pi, math.pi)
LENGTH = st.floats(-10, 10)


@pytest.mark.parametrize(
    ("yaw_rad", "along_m", "lateral_m"),
    [(0.0, 1.0, 2.0), (math.pi / 2, 2.0, -1.0), (math.pi, -1.0, -2.0), (-math.pi / 2, -2.0, 1.0)],
)
def test_one_forward_and_two_left_of_the_frame_seen_along_each_heading(
    yaw_rad: float, along_m: float, lateral_m: float
) -> None:
    seen = displacement(BasePose(5.0, -3.0, yaw_rad), BasePose(6.0, -1.0, yaw_rad))
    assert seen.along_m == pytest.approx(along_m)
    assert seen.lateral_m == pytest.approx(lateral_m)
    assert seen.heading_rad == 0.0


def test_backward_is_negative() -> None:
    assert displacement(BasePose(0, 0, 0), BasePose(-0.3, 0, 0)).along_m == -0.3


def test_a_heading_across_pi_is_a_small_turn() -> None:
    assert displacement(BasePose(0, 0, math.pi - 0.1), BasePose(0, 0, -math.pi + 0.1)).heading_rad == pytest.approx(0.2)


@given(LENGTH, LENGTH, ANGLE, LENGTH, LENGTH)
def test_the_length_of_the_way_is_kept(x_m: float, y_m: float, yaw_rad: float, dx_m: float, dy_m: float) -> None:
    seen = displacement(BasePose(x_m, y_m, yaw_rad), BasePose(x_m + dx_m, y_m + dy_m, yaw_rad))
    assert math.hypot(seen.along_m, seen.lateral_m) == pytest.approx(math.hypot(dx_m, dy_m), abs=1e-9)


@given(ANGLE)
def test_a_quaternion_about_z_gives_its_angle(yaw_rad: float) -> None:
    read = yaw_of_quaternion(0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2))
    assert math.remainder(read - yaw_rad, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
