"""The driver's own limiter as a judge of the envelope: with commands that come late it never leaves what is allowed."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from random import Random

import pytest

from canbase_config.robot import Limits
from canbase_driver.motion.kinematics import Twist2D, wheel_speeds
from canbase_driver.motion.limiter import Limiter, MotionState
from canbase_watchdog.envelope import Bounds, Envelope
from support.watchdog_story import config

CONFIG = config()
BEFORE_S = 10.0
LATENCY_S, CYCLE_S = 0.25, 0.01


def some_limits(random: Random) -> Limits:
    return Limits(
        linear_mps=random.choice((0.3, 0.8, 2.0)),
        angular_radps=random.choice((0.5, 2.0, 6.0)),
        acceleration_mps2=random.choice((0.3, 0.8, 2.0)),
        deceleration_mps2=random.choice((0.4, 1.0, 2.0)),
        emergency_deceleration_mps2=4.0,
        angular_acceleration_radps2=random.choice((0.5, 1.5, 4.0)),
        angular_deceleration_radps2=random.choice((0.5, 2.0, 5.0)),
        jerk_mps3=random.choice((2.0, 10.0, 1000.0)),
    )


def some_order(random: Random, limits: Limits, last: Twist2D) -> tuple[Twist2D, float]:
    """What comes next, and for how long."""
    linear, angular = random.uniform(-1, 1) * limits.linear_mps, random.uniform(-1, 1) * limits.angular_radps
    orders = (
        Twist2D.ZERO,
        Twist2D(linear, angular),
        Twist2D(math.copysign(limits.linear_mps, linear), math.copysign(limits.angular_radps, angular)),
        Twist2D(0.0, angular),
        Twist2D(0.9 * last.linear_mps, 0.9 * last.angular_radps),
        Twist2D(-last.linear_mps, last.angular_radps),
    )
    return random.choice(orders), random.choice((0.02, 0.02, 0.1, 0.5, 2.0))


@pytest.mark.parametrize("seed", range(40))
def test_the_drivers_limiter_stays_inside(seed: int) -> None:
    """A minute of random orders, each up to LATENCY_S under way. Rims may go 5 mm/s beyond: two cycles of rounding."""
    random = Random(seed)
    limits, track_m = some_limits(random), random.choice((0.2, 0.5, 1.0))
    jerk_s = max(limits.acceleration_mps2, limits.deceleration_mps2) / limits.jerk_mps3
    told = limits.model_dump(exclude={"emergency_deceleration_mps2", "jerk_mps3"}) | {"track_m": track_m}
    told["max_wheel_mps"] = Limiter(limits, track_m).wheel_mps
    envelope = Envelope(replace(CONFIG, **told, order_hold_s=LATENCY_S + 2 * CYCLE_S + jerk_s), -BEFORE_S)
    limiter, motion, command, order = Limiter(limits, track_m), MotionState.AT_REST, Twist2D.ZERO, Twist2D.ZERO
    under_way: deque[tuple[float, Twist2D]] = deque()
    left_s, worst = 0.0, 0.0
    for cycle in range(6000):
        t, left_s = cycle * CYCLE_S, left_s - CYCLE_S
        if left_s <= 0.0:
            order, left_s = some_order(random, limits, order)
        if cycle % 2 == 0:
            envelope.order(order.linear_mps, order.angular_radps, t)
            arrival = t + random.choice((0.0, 0.01, LATENCY_S - 0.02))
            under_way.append((max(arrival, under_way[-1][0]) if under_way else arrival, order))
        while under_way and under_way[0][0] <= t:
            command = under_way.popleft()[1]
        motion, bounds = limiter.step(motion, command, CYCLE_S), envelope.advance(t)
        for arm_m, speed in zip((-track_m / 2, track_m / 2), wheel_speeds(motion.twist, track_m), strict=True):
            low, high = bounds.wheel(arm_m)
            worst = max(worst, low - speed, speed - high)
    assert worst < 0.005


@pytest.mark.parametrize("seed", range(60))
def test_an_emergency_stop_of_the_drivers_limiter_stays_inside_from_any_motion(seed: int) -> None:
    """It begins at the last moment, and follows the order of before until then; a lease without the flag, and with
    motion, comes in between. Then the bounds are zero: as soon as the setpoints are."""
    random = Random(seed)
    limits, track_m = some_limits(random), random.choice((0.2, 0.5, 1.0))
    wait_s = random.choice((0.05, 0.12, 0.4))
    told = limits.model_dump(exclude={"jerk_mps3"}) | {"track_m": track_m, "emergency_wait_s": wait_s}
    envelope = Envelope(replace(CONFIG, **told, order_hold_s=5.0), -BEFORE_S)
    limiter, motion, order = Limiter(limits, track_m), MotionState.AT_REST, Twist2D.ZERO
    steps = random.choice((20, 150, 700))
    for cycle in range(steps):
        if cycle % 100 == 0:
            order, _ = some_order(random, limits, order)
        envelope.order(order.linear_mps, order.angular_radps, cycle * CYCLE_S)
        motion = limiter.step(motion, order, CYCLE_S)
        envelope.advance(cycle * CYCLE_S)
    since, worst, at_rest_s = steps * CYCLE_S, 0.0, math.inf
    later = random.choice((Twist2D.ZERO, order))
    for cycle in range(steps, steps + 3000):
        t = cycle * CYCLE_S
        envelope.order(later.linear_mps, later.angular_radps, t)
        motion = limiter.step(motion, order, CYCLE_S, emergency=t > since + wait_s - 1e-9)
        bounds = envelope.advance(t, since)
        for arm_m, speed in zip((-track_m / 2, track_m / 2), wheel_speeds(motion.twist, track_m), strict=True):
            low, high = bounds.wheel(arm_m)
            worst = max(worst, low - speed, speed - high)
        if bounds == Bounds(0.0, 0.0, 0.0, 0.0):
            at_rest_s = min(at_rest_s, t)
    longest_s = max(
        limits.linear_mps / limits.deceleration_mps2, limits.angular_radps / limits.angular_deceleration_radps2
    )
    longest_s *= limits.deceleration_mps2 / limits.emergency_deceleration_mps2
    assert worst < 0.005
    assert at_rest_s <= since + wait_s + longest_s + 2 * CYCLE_S
