"""Times and distances of stops from robot.yaml, against the driver's own ramp and by hand."""

from dataclasses import dataclass
from itertools import product

import pytest

from canbase_config.load import load_robot, sample
from canbase_config.robot import Limits, Robot
from canbase_config.stopping import (
    Stop,
    coasting_s,
    jerk_adds_s,
    lag_s,
    longest_quick_stop_s,
    longest_ramp_s,
    quick_stop,
    ramp,
    stop,
)
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.limiter import Limiter, MotionState

DT_S = 0.01
LIMITS = Limits(
    linear_mps=3.0,
    angular_radps=2.0,
    acceleration_mps2=0.8,
    deceleration_mps2=0.9,
    emergency_deceleration_mps2=1.8,
    angular_acceleration_radps2=4.0,
    angular_deceleration_radps2=2.0,
    jerk_mps3=1.0,
)


def robot(**limits: float) -> Robot:
    bench = load_robot(sample("bench")).robot
    return bench.model_copy(update={"limits": bench.limits.model_copy(update=limits)})


@dataclass(frozen=True)
class Driven:
    time_s: float
    distance_m: float
    turn_rad: float


def drive_down(limits: Limits, twist: Twist2D, emergency: bool) -> Driven:
    """The driver's own ramp, cycle by cycle; setpoints between two cycles count as their mean."""
    limiter, motion = Limiter(limits, 0.5), MotionState(twist)
    time_s = distance_m = turn_rad = 0.0
    while motion.twist != Twist2D.ZERO:
        before, motion = motion.twist, limiter.step(motion, Twist2D.ZERO, DT_S, emergency=emergency)
        distance_m += abs(before.linear_mps + motion.twist.linear_mps) / 2.0 * DT_S
        turn_rad += abs(before.angular_radps + motion.twist.angular_radps) / 2.0 * DT_S
        time_s += DT_S
    return Driven(time_s, distance_m, turn_rad)


@pytest.mark.parametrize(
    ("linear", "angular", "jerk", "emergency"),
    [
        *product((0.01, 0.3, -0.9, 3.0), (0.0, -0.4, 2.0), (0.2, 1.0, 10.0, 1000.0), (False, True)),
        *product((0.0,), (0.1, 2.0), (0.2, 1000.0), (False, True)),
    ],
)
def test_the_drivers_ramp_takes_so_long_and_goes_so_far(
    linear: float, angular: float, jerk: float, emergency: bool
) -> None:
    limits = LIMITS.model_copy(update={"jerk_mps3": jerk})
    driven = drive_down(limits, Twist2D(linear, angular), emergency)
    told = ramp(limits, linear, angular, emergency=emergency)
    assert driven.time_s == pytest.approx(told.time_s, abs=2 * DT_S)
    assert driven.distance_m == pytest.approx(told.distance_m, abs=0.002 + 0.002 * told.distance_m)
    assert driven.turn_rad == pytest.approx(told.turn_rad, abs=0.002 + 0.01 * told.turn_rad)


def test_by_hand() -> None:
    assert ramp(LIMITS, 0.9).time_s == pytest.approx(0.9 / 0.9 + 0.9 / 1.0)  # 0.9 m/s² is just reached
    assert ramp(LIMITS, 0.01).time_s == pytest.approx(2 * (0.01 / 1.0) ** 0.5)  # and here it is not
    assert ramp(LIMITS, 0.0, 2.0) == Stop(1.0, 0.0, 1.0)
    assert ramp(LIMITS, 3.0, emergency=True).time_s == pytest.approx(3.0 / 1.8)
    assert ramp(LIMITS, 0.0) == Stop(0.0, 0.0, 0.0)


def test_the_lag_comes_at_full_speed_before_the_ramp() -> None:
    bench = robot(jerk_mps3=1000.0)  # 0.1 s of drive lag, 0.02 s for two cycles
    assert lag_s(bench) == pytest.approx(0.12)
    assert stop(bench, -0.5).time_s == pytest.approx(0.12 + 0.5, abs=2e-3)
    assert stop(bench, -0.5).distance_m == pytest.approx(0.06 + 0.125, abs=1e-3)
    assert stop(bench, 0.0, 1.0).turn_rad == pytest.approx(0.12 + 0.1)
    assert stop(bench, 0.5, emergency=True).time_s == pytest.approx(0.12 + 0.25)


def test_a_quick_stop_is_the_drives_own() -> None:
    fast = robot(linear_mps=3.0, deceleration_mps2=0.9, emergency_deceleration_mps2=0.9)
    assert quick_stop(fast, -3.0).time_s == pytest.approx(0.1 + 3.0 / 0.9)
    assert quick_stop(fast, -3.0).distance_m == pytest.approx(0.3 + 5.0)
    assert longest_quick_stop_s(fast) == pytest.approx(0.1 + 3.6 / 0.9)  # overspeed_factor 1.2


def test_no_twist_within_the_limits_takes_longer_than_the_longest() -> None:
    soft = robot(jerk_mps3=0.2)
    twists = product((0.0, 0.1, 0.4, 0.8), (0.0, 0.5, 2.0))
    assert max(stop(soft, *twist).time_s for twist in twists) == pytest.approx(longest_ramp_s(soft))
    assert longest_ramp_s(soft) == pytest.approx(0.12 + 4.0)


def test_a_wheel_without_power_rolls_until_friction_ends_it() -> None:
    assert coasting_s(-0.8) == pytest.approx(8.0)


@pytest.mark.parametrize("linear_mps", [5e-324, 1e-308, 1e-30])
def test_a_speed_that_is_next_to_nothing_has_a_time(linear_mps: float) -> None:
    """5e-324 m/s divided by 10 is 0 for a float."""
    limits = robot(linear_mps=linear_mps, acceleration_mps2=10.0, deceleration_mps2=10.0, jerk_mps3=10.0).limits
    assert jerk_adds_s(limits) >= 0.0
