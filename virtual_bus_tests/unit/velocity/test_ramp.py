"""The driver's ramps as the safety filter expects them: compared with the driver's own limiter, jerk limit and all."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_config.robot import Limits
from canbase_config.stopping import ramp
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.limiter import Limiter, MotionState
from canbase_velocity.ramp import AT_REST, Moving, follow, stop_way_s
from canbase_velocity.twist import ZERO, Twist
from support.filter_inputs import LIMITS

DT_S = 0.01
TRACK_M = 0.4

limits_of_all = st.builds(
    Limits,
    linear_mps=st.floats(0.2, 3.0),
    angular_radps=st.floats(0.5, 4.0),
    acceleration_mps2=st.floats(0.1, 3.0),
    deceleration_mps2=st.floats(0.1, 3.0),
    emergency_deceleration_mps2=st.just(5.0),
    angular_acceleration_radps2=st.floats(0.5, 10.0),
    angular_deceleration_radps2=st.floats(0.5, 10.0),
    jerk_mps3=st.sampled_from([0.1, 0.2, 1.0, 10.0, 1000.0]),
)
shares = st.floats(-1.0, 1.0) | st.sampled_from([0.0, 1.0, -1.0])
orders = st.lists(st.tuples(shares, shares, st.integers(1, 60)), min_size=1, max_size=6)


def both(limits: Limits, stream: list[tuple[float, float, int]]) -> list[tuple[MotionState, Moving]]:
    """What the driver orders and what the filter expects, every 10 ms."""
    limiter = Limiter(limits, TRACK_M)
    states = [(MotionState.AT_REST, AT_REST)]
    for linear, angular, steps in stream:
        target = limiter.limit(Twist2D(linear * limits.linear_mps, angular * limits.angular_radps))
        order = Twist(target.linear_mps, target.angular_radps)
        for _ in range(steps):
            driver, expected = states[-1]
            states.append((limiter.step(driver, target, DT_S), follow(expected, order, limits, DT_S)))
    return states


@settings(max_examples=150, deadline=None)
@given(limits=limits_of_all, stream=orders)
def test_the_filter_expects_what_the_driver_does(limits: Limits, stream: list[tuple[float, float, int]]) -> None:
    for driver, expected in both(limits, stream):
        twist = expected.twist
        assert twist.linear_mps == pytest.approx(driver.twist.linear_mps, abs=1e-6)
        assert twist.angular_radps == pytest.approx(driver.twist.angular_radps, abs=1e-6)
        assert expected.acceleration_mps2 == pytest.approx(driver.acceleration_mps2, abs=1e-4)


@settings(max_examples=100, deadline=None)
@given(limits=limits_of_all, stream=orders)
def test_the_way_to_standstill_is_that_of_the_driver(limits: Limits, stream: list[tuple[float, float, int]]) -> None:
    driver, expected = both(limits, stream)[-1]
    expected_s = stop_way_s(expected, limits)
    limiter, states = Limiter(limits, TRACK_M), [driver]
    while states[-1] != MotionState.AT_REST and len(states) < 10_000:
        states.append(limiter.step(states[-1], Twist2D.ZERO, DT_S))
    linear_m = sum(abs(a.twist.linear_mps + b.twist.linear_mps) / 2.0 * DT_S for a, b in pairwise(states))
    angular_rad = sum(abs(a.twist.angular_radps + b.twist.angular_radps) / 2.0 * DT_S for a, b in pairwise(states))
    speed_mps, turn_radps = abs(expected.twist.linear_mps), abs(expected.twist.angular_radps)
    assert linear_m <= expected_s * speed_mps + speed_mps * DT_S + 1e-3
    assert linear_m >= expected_s * speed_mps - speed_mps * DT_S - 1e-3
    assert angular_rad <= expected_s * turn_radps + turn_radps * DT_S + 1e-3


def test_ramps_by_hand() -> None:
    assert follow(AT_REST, Twist(1.0, 0.0), LIMITS, 0.1).twist.linear_mps == pytest.approx(0.1)
    assert follow(Moving(Twist(1.0, 0.0)), ZERO, LIMITS, 0.1).twist.linear_mps == pytest.approx(0.8)
    braking = follow(Moving(Twist(1.0, 0.5)), ZERO, LIMITS, 0.1).twist
    assert braking.angular_radps / braking.linear_mps == pytest.approx(0.5)
    turning = follow(Moving(Twist(1.0, 0.0)), Twist(0.0, 2.0), LIMITS, 0.1).twist
    assert turning.linear_mps == pytest.approx(0.8)  # braking does not wait for the turn
    assert 0.0 < turning.angular_radps <= 0.4
    assert follow(Moving(Twist(0.2, 0.0)), Twist(0.3, 0.0), LIMITS, 5.0) == Moving(Twist(0.3, 0.0))
    assert follow(Moving(Twist(0.2, 0.0)), Twist(-1.0, 0.0), LIMITS, 5.0) == AT_REST  # a reversal, and on from there


@pytest.mark.parametrize("jerk_mps3", [0.2, 1.0, 10.0, 1e9])
def test_from_a_steady_velocity_it_is_half_of_the_time_of_the_ramp(jerk_mps3: float) -> None:
    limits = LIMITS.model_copy(update={"jerk_mps3": jerk_mps3})
    for linear_mps, angular_radps in ((1.0, 0.0), (-0.3, 0.0), (0.1, -2.0), (0.0, 2.0), (0.0, 0.0)):
        time_s = ramp(limits, linear_mps, angular_radps).time_s
        assert stop_way_s(Moving(Twist(linear_mps, angular_radps)), limits) == pytest.approx(time_s / 2.0)
    assert math.isfinite(stop_way_s(Moving(Twist(5e-324, 5e-324)), limits))
