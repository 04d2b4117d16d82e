"""Slip that the wheels of one side show: stories of rim speeds in cycles of 10 ms."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from canbase_driver.motion.slip import TOLERANCE_MPS, SideSlip

DT_S = 0.01
GRIP_MPS2 = 4.0


def slipped_m(speeds_mps: Iterable[float], side: SideSlip | None = None) -> float:
    """How far a side with one wheel may have slipped in all."""
    side = side or SideSlip(GRIP_MPS2)
    return sum(side.update([speed_mps], DT_S) for speed_mps in speeds_mps)


def ramp(from_mps: float, to_mps: float, slope_mps2: float) -> list[float]:
    steps = round(abs(to_mps - from_mps) / slope_mps2 / DT_S)
    return [from_mps + (to_mps - from_mps) * step / steps for step in range(steps + 1)]


@pytest.mark.parametrize("slope_mps2", [0.5, 2.0, 3.9])
def test_a_wheel_that_the_floor_can_follow_does_not_slip(slope_mps2: float) -> None:
    assert slipped_m(ramp(0.0, 1.0, slope_mps2) + [1.0] * 50 + ramp(1.0, -1.0, slope_mps2)) == 0.0


def test_a_wheel_that_spins_up_at_once_slips_as_far_as_it_is_ahead_of_the_floor() -> None:
    """0 to 1 m/s at once, and held: the floor needs 0.25 s; the area between both is 1 × 0.25 / 2 m."""
    assert slipped_m([0.0] + [1.0] * 50) == pytest.approx(1.0 * 0.25 / 2.0, abs=0.01)


def test_a_wheel_that_locks_slips_until_the_base_can_have_stopped() -> None:
    """The rim stops within 0.1 s from 1 m/s; 4 m/s² need 0.25 s: 1² / (2 × 4) − 1² / (2 × 10) m."""
    side = SideSlip(GRIP_MPS2)
    assert slipped_m(ramp(1.0, 0.0, 10.0) + [0.0] * 50, side) == pytest.approx(0.125 - 0.05, abs=0.01)
    assert side.speed_mps == 0.0


def test_noise_of_a_measured_speed_is_no_slip() -> None:
    assert slipped_m([0.5 + 0.02 * (-1) ** step for step in range(200)]) == 0.0


def test_wheels_of_one_side_that_disagree_slip_by_half_of_their_difference() -> None:
    side = SideSlip(GRIP_MPS2)
    for step in range(51):
        speed_mps = 0.5 * step / 50.0
        assert side.update([speed_mps, speed_mps * 0.95], DT_S) == 0.0  # unequal tyres
    for _ in range(10):
        side.update([0.5, 0.2], DT_S)
    assert side.speed_mps == pytest.approx(0.15)
    assert side.speed_mps > TOLERANCE_MPS


def test_after_a_gap_the_first_speed_is_that_of_the_floor() -> None:
    side = SideSlip(GRIP_MPS2)
    side.update([0.0], DT_S)
    side.forget()
    assert side.update([1.0], DT_S) == 0.0
