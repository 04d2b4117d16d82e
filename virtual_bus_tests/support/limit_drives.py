"""Drives through the limiter in steps of 10 ms, shared by the tests of the limits."""

from itertools import pairwise

from hypothesis import settings

from canbase_config.robot import Limits
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.limiter import Limiter, MotionState

property_of_all = settings(deadline=None, max_examples=100)
DT_S = 0.01
TRACK_M = 0.4
LIMITS = Limits(
    linear_mps=1.0,
    angular_radps=2.0,
    acceleration_mps2=0.5,
    deceleration_mps2=1.0,
    emergency_deceleration_mps2=2.0,
    angular_acceleration_radps2=2.0,
    angular_deceleration_radps2=4.0,
    jerk_mps3=10.0,
)
LIMITER = Limiter(LIMITS, TRACK_M)
NO_JERK = Limiter(LIMITS.model_copy(update={"jerk_mps3": 1e9}), TRACK_M)
"""The plain ramp, to be counted by hand: its jerk limit is over within a nanosecond."""


def drive(
    limiter: Limiter, start: MotionState, target: Twist2D, duration_s: float, *, emergency: bool = False
) -> list[MotionState]:
    """The start and every 10 ms after it."""
    states = [start]
    for _ in range(round(duration_s / DT_S)):
        states.append(limiter.step(states[-1], target, DT_S, emergency=emergency))
    return states


def steps_until(limiter: Limiter, start: MotionState, target: Twist2D, most: int, *, emergency: bool = False) -> int:
    """Number of 10 ms steps until the limited target is ordered exactly and held; `most` when it never is."""
    state, arrived = start, MotionState(limiter.limit(target))
    for step in range(most):
        if state == arrived:
            return step
        state = limiter.step(state, target, DT_S, emergency=emergency)
    return most


def linear(states: list[MotionState]) -> list[float]:
    return [state.twist.linear_mps for state in states]


def way(states: list[MotionState]) -> float:
    return sum(abs(a + b) / 2.0 * DT_S for a, b in pairwise(linear(states)))
