"""Setpoints that do not fall while zero is leased: how long a driver that is stuck is followed, with any jerk limit.

0.35 s of waiting for orders under way ── the setpoints of that moment ── 0.1 s ── the S-curve to zero. 100 SYNCs a
second, 0.03 m/s and one bit (0.001 m/s) of tolerance; deceleration 1 m/s².
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf, sqrt
from random import Random

import pytest

from canbase_config.robot import Robot
from canbase_driver.motion.kinematics import Twist2D, wheel_speeds
from canbase_driver.motion.limiter import Limiter, MotionState
from canbase_watchdog.lease import Lease
from canbase_watchdog.policy import decide
from canbase_watchdog.ramp_to_zero import RECEIVED_S, RampToZeroWatch
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.view import BusView
from canbase_watchdog.watchdog import State
from support.chain_world import World, bench_robot
from support.watchdog_story import config
from support.watchdog_views import CONFIG, LEFT, NOW, RIGHT, well
from unit.watchdog.test_envelope_limiter import some_limits

CYCLE_S, WAIT_S = 0.01, 0.35
ZERO, MOVE = Lease(1, 1, 0.0, 0.0, 0), Lease(1, 1, 0.3, 0.0, 0)


def bus(speeds: tuple[float, float], at: float, came: bool = True, enabled: bool = True) -> BusView:
    since = at if came else at - CYCLE_S
    axes = (replace(axis, setpoint_mps=v, setpoint_at=since) for axis, v in zip((LEFT, RIGHT), speeds, strict=True))
    state = LEFT.state if enabled else None
    return BusView(tuple(replace(axis, state=state) for axis in axes), (), sync_at=at)


def found_s(
    wheels: Callable[[float], tuple[float, float]], jerk: float, longest_s: float = 20.0, **changes: object
) -> float:
    """Seconds since zero was leased until it is found that the setpoints, by time since then, do not fall."""
    watch = RampToZeroWatch(replace(config(), order_wait_s=WAIT_S, jerk_mps3=jerk, **changes))  # type: ignore[arg-type]
    for i in range(round(longest_s / CYCLE_S)):
        if watch.check_setpoints(bus(wheels(i * CYCLE_S), 5.0 + i * CYCLE_S), ZERO, 5.0 + i * CYCLE_S):
            return i * CYCLE_S
    return inf


@pytest.mark.parametrize("jerk", [0.1, 0.2, 1.0, 4.0])
@pytest.mark.parametrize("mps", [0.1, 0.4, 0.8, -0.8])
def test_a_driver_that_repeats_its_setpoints_is_found_when_the_ramp_has_lost_the_tolerance(
    mps: float, jerk: float
) -> None:
    lost_s = sqrt(2.0 * 0.031 / jerk)
    assert found_s(lambda t: (mps, mps), jerk) == pytest.approx(WAIT_S + RECEIVED_S + lost_s, abs=0.035)


def test_with_a_high_jerk_it_is_the_straight_ramp() -> None:
    assert found_s(lambda t: (0.8, 0.8), 1000.0) == pytest.approx(WAIT_S + RECEIVED_S + 0.031, abs=0.035)
    assert found_s(lambda t: (-0.4, 0.4), 0.1) == pytest.approx(WAIT_S + RECEIVED_S + 0.031, abs=0.065)


def test_a_driver_that_brakes_and_then_holds_its_speed_is_found() -> None:
    """0.8 m/s with 1 m/s² to 0.4 m/s, where it stays."""
    stops = found_s(lambda t: (max(0.4, 0.8 - t),) * 2, 1000.0)
    assert 0.4 < stops < 1.0


def test_a_driver_that_creeps_on_is_found_above_the_tolerance() -> None:
    assert found_s(lambda t: (0.03, 0.03), 10.0) == inf
    assert found_s(lambda t: (0.032, -0.032), 10.0) < 1.0


def test_one_wheel_is_enough() -> None:
    assert found_s(lambda t: (max(0.0, 0.8 - t), 0.8), 100.0) < 1.0


def test_it_takes_two_syncs_and_a_sync_without_setpoints_shows_nothing() -> None:
    watch = RampToZeroWatch(replace(config(), order_wait_s=0.0, jerk_mps3=100.0))
    watch.check_setpoints(bus((0.8, 0.8), 5.0), ZERO, 5.0)
    told = []
    for i in range(1, 40):
        at = 5.0 + i / 100
        told.append(bool(watch.check_setpoints(bus((0.8, 0.8), at, came=i != 30), ZERO, at)))
        assert watch.check_setpoints(bus((0.8, 0.8), at), ZERO, at + 0.005) == ""  # the same SYNC
    assert told.index(True) in (14, 15)  # 0.1 s, 0.031 m/s of 1 m/s², and one SYNC more
    assert [told[28], told[29], told[30]] == [True, False, True]


def test_a_new_order_and_a_missing_lease_begin_anew() -> None:
    for lease in (MOVE, None):
        watch = RampToZeroWatch(replace(config(), order_wait_s=WAIT_S, jerk_mps3=100.0))
        for i in range(400):
            at = 5.0 + i / 100
            assert watch.check_setpoints(bus((0.8, 0.8), at), lease if i % 40 == 0 else ZERO, at) == ""


def test_a_drive_that_is_not_enabled_is_ordered_nothing() -> None:
    watch = RampToZeroWatch(replace(config(), order_wait_s=WAIT_S, jerk_mps3=100.0))
    assert {
        watch.check_setpoints(bus((0.8, 0.8), 5.0 + i / 100, enabled=False), ZERO, 5.0 + i / 100) for i in range(300)
    } == {""}


def test_a_driver_that_was_late_goes_on_with_its_ramp_from_where_it_was() -> None:
    """Its cycle stood still for 0.25 s: the limiter counts 0.1 s of it."""
    watch = RampToZeroWatch(replace(config(), order_wait_s=0.0, jerk_mps3=1000.0))
    speed, at = 0.8, 5.0
    while speed > 0.0:
        assert watch.check_setpoints(bus((speed, speed), at), ZERO, at) == ""
        late = 5.3 < at < 5.31
        at += 0.25 if late else 0.01
        speed -= 0.1 if late else 0.01


@pytest.mark.parametrize("seed", range(60))
def test_the_drivers_own_limiter_is_never_found(seed: int) -> None:
    """Whatever it was doing when the last order reached it, late cycles and receptions included."""
    random = Random(seed)
    limits, track_m = some_limits(random), random.choice((0.2, 0.5, 1.0))
    limits = limits.model_copy(update={"jerk_mps3": random.choice((0.1, 0.5, 2.0, 10.0, 1000.0))})
    told = limits.model_dump(exclude={"emergency_deceleration_mps2"}) | {"track_m": track_m}
    watch = RampToZeroWatch(replace(config(), **told, order_wait_s=WAIT_S))
    limiter, motion = Limiter(limits, track_m), MotionState.AT_REST
    for _ in range(6):
        order = Twist2D(
            random.uniform(-1, 1) * limits.linear_mps,
            random.choice((0.0, random.uniform(-1, 1))) * limits.angular_radps,
        )
        order = random.choice((order, Twist2D(0.0, order.angular_radps), Twist2D.ZERO))
        for _ in range(random.choice((5, 40, 300))):
            motion = limiter.step(motion, order, CYCLE_S)
    arrives_s, at = random.uniform(0.0, WAIT_S), 5.0
    while motion != MotionState.AT_REST:
        cycle_s = random.choice((CYCLE_S,) * 20 + (0.05, 0.3))
        target = order if at < 5.0 + arrives_s else Twist2D.ZERO
        at, motion = at + cycle_s, limiter.step(motion, target, cycle_s)
        speeds = wheel_speeds(motion.twist, track_m)
        received = at + random.choice((0.0, 0.0, 0.09))
        assert watch.check_setpoints(bus(speeds, max(received, watch._sync_at + 1e-6)), ZERO, received) == ""
        if at > 30.0:
            break


# "Brakes hard": 0.12 s, the setpoints of that moment, 0.1 s, then 2 m/s² in a straight line


def hard_found_s(wheels: Callable[[float], tuple[float, float]], lease: Lease = ZERO, before_s: float = 0.0) -> float:
    """As found_s, by seconds since "brakes hard"; zero was leased for `before_s` before."""
    watch = RampToZeroWatch(replace(config(), order_wait_s=WAIT_S, jerk_mps3=1.0, emergency_wait_s=0.12))
    begin = round(before_s / CYCLE_S)
    for i in range(-begin, 200):
        at = 5.0 + i * CYCLE_S
        if watch.check_setpoints(bus(wheels(i * CYCLE_S), at), ZERO if i < 0 else lease, at, 5.0 if i >= 0 else inf):
            return i * CYCLE_S
    return inf


@pytest.mark.parametrize("lease", [ZERO, MOVE])
@pytest.mark.parametrize(("mps", "lost_s"), [(0.8, 0.0155), (-0.3, 0.0155), (0.032, 0.016)])
def test_a_driver_that_goes_on_under_brakes_hard_is_found_whatever_is_leased(
    lease: Lease, mps: float, lost_s: float
) -> None:
    assert hard_found_s(lambda t: (mps, mps), lease) == pytest.approx(0.12 + RECEIVED_S + lost_s, abs=0.035)


@pytest.mark.parametrize(("mps2", "is_found"), [(2.0, False), (1.6, False), (1.3, True), (1.0, True), (0.5, True)])
def test_a_driver_that_brakes_too_softly_is_found(mps2: float, is_found: bool) -> None:
    """0.8 m/s: with the 0.1 s of a late SYNC and the tolerance it has to be above 0.8 − 2.0 (t − 0.1) + 0.031."""
    after_s = hard_found_s(lambda t: (max(0.0, 0.8 - mps2 * t),) * 2)
    assert (after_s < inf) is is_found
    if is_found:
        assert 0.12 + RECEIVED_S < after_s < 0.8


def test_zero_that_was_leased_before_makes_no_ramp_of_brakes_hard() -> None:
    """0.5 s of a gentle ramp, then the hard one from the setpoints of 0.12 s later."""
    gentle, hard = lambda t: 0.8 - 0.4 * (t + 0.5), lambda t: 0.552 - 2.0 * (t - 0.12)
    assert hard_found_s(lambda t: (max(0.0, gentle(t) if t < 0.12 else hard(t)),) * 2, before_s=0.5) == inf
    assert hard_found_s(lambda t: (max(0.0, gentle(t)),) * 2, before_s=0.5) < 0.4


def test_the_end_of_brakes_hard_begins_anew() -> None:
    watch = RampToZeroWatch(replace(config(), order_wait_s=WAIT_S, jerk_mps3=1000.0, emergency_wait_s=0.0))
    for i in range(5):
        watch.check_setpoints(bus((0.0, 0.0), 5.0 + i / 100), ZERO, 5.0 + i / 100, 5.0)
    for i in range(5, 100):
        assert watch.check_setpoints(bus((0.3, 0.3), 5.0 + i / 100), MOVE, 5.0 + i / 100) == ""


def test_the_policy_trips_with_it() -> None:
    view = replace(well(), ramp_to_zero="left is ordered 0.8 m/s")
    verdict = decide(view, CONFIG, NOW)
    assert (verdict.cause, verdict.detail) == (TripCause.TARGET_OUTSIDE, "left is ordered 0.8 m/s")


# The whole chain


def low_jerk(jerk: float) -> Robot:
    bench = bench_robot().model_dump()
    bench["limits"] |= {"jerk_mps3": jerk, "linear_mps": 0.8}
    bench["timeouts"] |= {"standstill_s": None}
    return Robot.model_validate(bench)


@pytest.mark.parametrize("jerk", [0.1, 0.3])
def test_a_stuck_driver_with_a_low_jerk_is_stopped_after_a_second_or_two(jerk: float) -> None:
    """It was 5.2 s with 0.1 m/s³."""
    world = World(low_jerk(jerk))
    world.drive(Twist2D(0.8, 0.0), 8.0)
    watchdog = world.watchdog
    assert watchdog is not None
    stuck = world.core._motion
    object.__setattr__(world.core, "_limiter", type("Stuck", (), {"step": lambda *_, **__: stuck})())
    world.command = Twist2D.ZERO
    begin = world.now_s
    assert world.run(8.0, lambda: watchdog.status.state is State.TRIPPED)
    assert watchdog.status.verdict.cause is TripCause.TARGET_OUTSIDE
    assert world.now_s - begin < 0.37 + RECEIVED_S + sqrt(2.0 * 0.031 / jerk) + 0.05


@pytest.mark.parametrize(("jerk", "twist"), [(0.2, Twist2D(0.8, 0.0)), (10.0, Twist2D(0.5, 0.5))])
def test_a_driver_that_stops_is_not(jerk: float, twist: Twist2D) -> None:
    world = World(low_jerk(jerk))
    world.drive(twist, 1.5)
    world.command = Twist2D.ZERO
    assert world.run(6.0, lambda: world.truth.standing_s > 0.2)
    assert world.watchdog is not None
    assert world.watchdog.status.state is State.WATCHING, world.watchdog.status.verdict
