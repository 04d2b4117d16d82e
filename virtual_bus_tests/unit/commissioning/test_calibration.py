"""What three counts of revolutions, a tape and an angle mean for robot.yaml."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_commissioning.calibration import CalibrationError, Turned, radius, scale, stop_time_s, track
from canbase_config.drive import Drive
from support.sim_rig import robot

LEFT = robot().drives[0]
"""Gear 10, 4096 increments, 0.1 rpm."""


def of_unit(unit: str) -> Drive:
    return robot({"joint": "left", "node_id": 1, "side": "left", "velocity_unit": unit}, {
        "joint": "right", "node_id": 2, "side": "right"}).drives[0]  # fmt: skip


def found(position: float, velocity: float, seen: float, drive: Drive = LEFT) -> tuple[float, int, str | None]:
    result = scale(drive, Turned(position, velocity, seen))
    return round(result.gear_ratio, 3), result.counts_per_motor_rev, result.velocity_unit


@pytest.mark.parametrize("seen", [2.92, 3.0, 3.08])
def test_within_three_per_cent_all_is_right(seen: float) -> None:
    assert found(3.0, 3.0, seen) == (10.0, 4096, "0.1rpm")
    assert scale(LEFT, Turned(3.0, 3.0, seen)).why == ""


@pytest.mark.parametrize("seen", [2.9, 3.1])
def test_beyond_it_something_is_wrong(seen: float) -> None:
    assert scale(LEFT, Turned(3.0, 3.0, seen)).why != ""


def test_encoder_and_velocity_agree_and_the_wheel_turns_half_as_far_the_gear_is_twice_as_large() -> None:
    assert found(3.0, 3.0, 1.5) == (20.0, 4096, "0.1rpm")


def test_only_the_encoder_is_off_lines_were_given_for_increments() -> None:
    """4096 where 16384 would be right: the encoder shows four times the revolutions."""
    assert found(12.0, 3.0, 3.0) == (10.0, 16384, "0.1rpm")


def test_only_the_velocity_is_off_the_unit_is_another() -> None:
    assert found(3.0, 0.3, 3.0) == (10.0, 4096, "rpm")
    assert found(3.0, 30.0, 3.0, of_unit("rpm")) == (10.0, 4096, "0.1rpm")


def test_where_the_unit_counts_increments_a_factor_of_four_is_the_encoders() -> None:
    assert found(12.0, 12.0, 3.0, of_unit("counts/s")) == (10.0, 16384, "counts/s")
    assert found(6.0, 6.0, 3.0, of_unit("counts/s")) == (20.0, 4096, "counts/s")


def test_a_factor_that_no_unit_explains_is_told() -> None:
    with pytest.raises(CalibrationError, match="60A9h"):
        found(3.0, 3.0 / 7.7, 3.0)


def test_three_different_counts_are_more_than_one_mistake() -> None:
    with pytest.raises(CalibrationError, match="more than one of gear_ratio, counts_per_motor_rev and velocity_unit"):
        found(12.0, 3.0, 1.5)


def test_nothing_counted_is_told() -> None:
    with pytest.raises(CalibrationError, match="a count is zero"):
        found(0.0, 3.0, 3.0)


@given(st.floats(0.6, 1.6), st.floats(0.6, 1.6))
def test_radius_and_track_come_back_from_what_odometry_would_say_of_wrong_ones(r: float, t: float) -> None:
    """Odometry with radius 0.1 and track 0.5 of a base that really has r × 0.1 and t × 0.5."""
    new_radius_m = radius(0.1, 2.0, 2.0 * r)
    assert new_radius_m == pytest.approx(0.1 * r)
    rims_m = 4.0  # right minus left, as odometry has it
    true_rad = rims_m * r / (0.5 * t)
    assert track(0.5, rims_m / 0.5, true_rad, r) == pytest.approx(0.5 * t)


@pytest.mark.parametrize("measured_m", [0.9, 4.1])
def test_a_radius_of_less_than_half_or_more_than_twice_is_no_result(measured_m: float) -> None:
    with pytest.raises(CalibrationError, match="measure again"):
        radius(0.1, 2.0, measured_m)


def test_a_wheel_that_rolled_32_mm_from_a_tenth_of_a_metre_a_second_stood_after_0_345_s() -> None:
    """0.295 s at 0.1 m/s, then 0.05 s down 2 m/s²."""
    assert stop_time_s(0.0295 + 0.0025, 0.1, 2.0) == pytest.approx(0.345)
    assert math.isfinite(stop_time_s(0.0, 0.1, 2.0))
