"""What holds on every drive, over limits as robot.yaml allows them, targets and irregular cycles."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_config.robot import Limits
from canbase_driver.motion.kinematics import Twist2D, wheel_speeds
from canbase_driver.motion.limiter import Limiter, MotionState
from support.limit_drives import DT_S, drive, linear, property_of_all, steps_until, way


@st.composite
def limiters(draw: st.DrawFn) -> Limiter:
    deceleration = draw(st.floats(0.2, 5.0))
    limits = Limits(
        linear_mps=draw(st.floats(0.1, 5.0)),
        angular_radps=draw(st.floats(0.1, 10.0)),
        acceleration_mps2=draw(st.floats(0.2, 5.0)),
        deceleration_mps2=deceleration,
        emergency_deceleration_mps2=deceleration * draw(st.floats(1.0, 4.0)),
        angular_acceleration_radps2=draw(st.floats(0.5, 20.0)),
        angular_deceleration_radps2=draw(st.floats(0.5, 20.0)),
        jerk_mps3=draw(st.floats(2.0, 1000.0)),
    )
    return Limiter(limits, draw(st.floats(0.1, 1.5)))


TWISTS = st.builds(Twist2D, st.floats(-6.0, 6.0), st.floats(-12.0, 12.0))


@st.composite
def drives(draw: st.DrawFn) -> tuple[Limiter, list[MotionState], list[float]]:
    """A drive through changing targets with irregular cycles, stops and reversals in it."""
    limiter = draw(limiters())
    states, steps_s = [MotionState(limiter.limit(draw(TWISTS)))], [0.0]
    for target in draw(st.lists(st.one_of(TWISTS, st.just(Twist2D.ZERO)), min_size=1, max_size=4)):
        for step_s in draw(st.lists(st.floats(1e-4, 0.1), min_size=1, max_size=12)):
            states.append(limiter.step(states[-1], target, step_s))
            steps_s.append(step_s)
    return limiter, states, steps_s


@property_of_all
@given(drives())
def test_on_every_drive_speed_and_acceleration_stay_within_their_limits(
    driven: tuple[Limiter, list[MotionState], list[float]],
) -> None:
    limiter, states, steps_s = driven
    limits = limiter.limits
    slack = 1.0 + 1e-9
    for (before, after), step_s in zip(pairwise(states), steps_s[1:], strict=True):
        old, new = before.twist, after.twist
        assert abs(new.linear_mps) <= limits.linear_mps * slack
        assert abs(new.angular_radps) <= limits.angular_radps * slack
        assert max(map(abs, wheel_speeds(new, limiter.track_m))) <= limiter.wheel_mps * slack
        most_mps2 = limits.acceleration_mps2
        if abs(new.linear_mps) < abs(old.linear_mps):
            most_mps2 = limits.deceleration_mps2
        assert abs(new.linear_mps - old.linear_mps) <= most_mps2 * step_s * slack + 1e-9
        most_radps2 = limits.angular_acceleration_radps2
        if abs(new.angular_radps) < abs(old.angular_radps):
            most_radps2 = limits.angular_deceleration_radps2
        assert abs(new.angular_radps - old.angular_radps) <= most_radps2 * step_s * slack + 1e-9
        assert old.linear_mps * new.linear_mps >= 0.0  # never through zero within one step


def ramp_s(limits: Limits, start: Twist2D, target: Twist2D) -> float:
    """A bound by hand: each axis with its smaller limit, one after the other; twice the jerk's share; rounding."""
    linear_mps2 = min(limits.acceleration_mps2, limits.deceleration_mps2)
    angular_radps2 = min(limits.angular_acceleration_radps2, limits.angular_deceleration_radps2)
    return (
        abs(target.linear_mps - start.linear_mps) / linear_mps2
        + abs(target.angular_radps - start.angular_radps) / angular_radps2
        + 2.0 * max(limits.acceleration_mps2, limits.deceleration_mps2) / limits.jerk_mps3
        + 5 * DT_S
    )


@property_of_all
@given(limiters(), TWISTS, TWISTS)
def test_every_target_is_reached_exactly_in_the_time_that_the_limits_allow(
    limiter: Limiter, start: Twist2D, wanted: Twist2D
) -> None:
    begin, target = MotionState(limiter.limit(start)), limiter.limit(wanted)
    most = math.ceil(ramp_s(limiter.limits, begin.twist, target) / DT_S)
    assert steps_until(limiter, begin, wanted, most + 1) <= most


@property_of_all
@given(limiters(), TWISTS, st.floats(-5.0, 5.0))
def test_a_stop_keeps_its_circle_its_time_and_its_distance(limiter: Limiter, start: Twist2D, slope: float) -> None:
    limits, twist = limiter.limits, limiter.limit(start)
    plain_s = max(
        abs(twist.linear_mps) / limits.deceleration_mps2, abs(twist.angular_radps) / limits.angular_deceleration_radps2
    )
    jerk_s = limits.deceleration_mps2 / limits.jerk_mps3
    states = drive(limiter, MotionState(twist, slope), Twist2D.ZERO, plain_s + jerk_s + 2 * DT_S)
    assert states[-1] == MotionState.AT_REST
    assert way(states) <= abs(twist.linear_mps) * (plain_s + jerk_s + DT_S) / 2.0 + 1e-9
    for state in states:
        assert state.twist.linear_mps * twist.angular_radps == pytest.approx(
            state.twist.angular_radps * twist.linear_mps, rel=1e-9, abs=1e-12
        )
    speeds = [abs(speed) for speed in linear(states)]
    assert speeds == sorted(speeds, reverse=True)


@property_of_all
@given(limiters(), TWISTS, st.floats(-5.0, 5.0))
def test_an_emergency_stop_is_never_longer_than_an_ordinary_one(limiter: Limiter, start: Twist2D, slope: float) -> None:
    begin = MotionState(limiter.limit(start), slope)
    ordinary = steps_until(limiter, begin, Twist2D.ZERO, 10_000)
    assert steps_until(limiter, begin, Twist2D.ZERO, 10_000, emergency=True) <= ordinary


@property_of_all
@given(limiters(), TWISTS, TWISTS)
def test_neither_axis_passes_its_target_or_turns_back(limiter: Limiter, start: Twist2D, wanted: Twist2D) -> None:
    states = drive(limiter, MotionState(limiter.limit(start)), wanted, 1.0)
    for axis in (linear(states), [state.twist.angular_radps for state in states]):
        changes = [later - earlier for earlier, later in pairwise(axis)]
        assert min(max(changes), -min(changes)) <= 1e-12  # all of one sign
