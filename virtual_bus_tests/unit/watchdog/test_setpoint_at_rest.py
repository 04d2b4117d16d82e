"""Setpoints within the tolerance, while nothing may move: forgiven for `order_hold_s` (0.35 s here), then a trip."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_driver.motion.kinematics import Twist2D
from canbase_watchdog.envelope import Bounds
from canbase_watchdog.frames import DriveState
from canbase_watchdog.policy import decide
from canbase_watchdog.setpoint_at_rest import SetpointAtRestWatch
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.view import Axis, BusView
from canbase_watchdog.watchdog import State
from support.chain_world import BITS_PER_MPS, World
from support.watchdog_story import config
from support.watchdog_views import AT_REST, CONFIG, NOW, well
from unit.watchdog.test_lies import lies

REST = Bounds(0.0, 0.0, 0.0, 0.0)
HOLD_S = config().order_hold_s
CREEPS = replace(AT_REST, target_mps=0.001)


def check(watch: SetpointAtRestWatch, axis: Axis, bounds: Bounds, now_s: float) -> str:
    return watch.check_setpoints(BusView((AT_REST, axis), ()), bounds, now_s)


@pytest.mark.parametrize("target_mps", [0.001, -0.001, 0.029, 0.8])
def test_a_setpoint_that_nothing_allows_is_told_after_the_hold_and_not_before(target_mps: float) -> None:
    watch = SetpointAtRestWatch(config())
    axis = replace(AT_REST, target_mps=target_mps)
    assert check(watch, axis, REST, 10.0) == ""
    assert check(watch, axis, REST, 10.0 + HOLD_S - 0.001) == ""
    assert f"{target_mps:.4f} m/s for 0.35" in check(watch, axis, REST, 10.0 + HOLD_S + 0.001)


def test_what_it_tells_does_not_grow_while_nobody_hears_the_drive_any_more() -> None:
    """A driver that died and a cable that is cut leave the last setpoint standing: the trip stays one and the same."""
    watch = SetpointAtRestWatch(config())
    check(watch, CREEPS, REST, 10.0)
    told = {check(watch, CREEPS, REST, 10.0 + HOLD_S + 0.1 * step) for step in range(1, 600)}
    assert told == {f"{CREEPS.drive.joint} is ordered 0.0010 m/s for {HOLD_S:.3f} s"}


@pytest.mark.parametrize(
    "bounds", [Bounds(-0.01, 0, 0, 0), Bounds(0, 0.01, 0, 0), Bounds(0, 0, -0.1, 0), Bounds(0, 0, 0, 0.1)]
)
def test_as_soon_as_anything_is_allowed_it_begins_anew(bounds: Bounds) -> None:
    watch = SetpointAtRestWatch(config())
    check(watch, CREEPS, REST, 10.0)
    assert check(watch, CREEPS, bounds, 11.0) == ""
    assert check(watch, CREEPS, REST, 11.01) == ""
    assert check(watch, CREEPS, REST, 11.0 + HOLD_S) == ""
    assert check(watch, CREEPS, REST, 11.011 + HOLD_S) != ""


# 10 s it creeps ── 10.25 s a moment is allowed ── the whole hold again, from 10.28125 s on
def test_a_moment_that_is_allowed_gives_the_whole_hold_again() -> None:
    watch = SetpointAtRestWatch(replace(config(), order_hold_s=0.375))
    told = [check(watch, CREEPS, Bounds(0.0, 0.01, 0.0, 0.0) if n == 8 else REST, 10.0 + n / 32) for n in range(22)]
    assert [n for n, why in enumerate(told) if why] == [21]


# 10 s to 10.25 s it creeps ── rests for exactly the hold ── 10.625 s it creeps: the whole hold again
@pytest.mark.parametrize(("rest", "found_after"), [(12, 12), (11, 4)])
def test_a_rest_as_long_as_the_hold_ends_it_and_a_shorter_one_does_not(rest: int, found_after: int) -> None:
    watch = SetpointAtRestWatch(replace(config(), order_hold_s=0.375))
    told = [check(watch, CREEPS if n <= 8 or n >= 8 + rest else AT_REST, REST, 10.0 + n / 32) for n in range(40)]
    assert next(n for n, why in enumerate(told) if why) == 8 + rest + found_after


@pytest.mark.parametrize("changes", [{"target_mps": 0.0}, {"state": DriveState.SWITCHED_ON}, {"state": None}])
def test_a_zero_and_a_drive_without_power_are_no_order(changes: dict[str, object]) -> None:
    watch = SetpointAtRestWatch(config())
    check(watch, CREEPS, REST, 10.0)
    assert check(watch, replace(CREEPS, **changes), REST, 11.0) == ""  # type: ignore[arg-type]
    assert check(watch, CREEPS, REST, 11.01) == ""


def test_a_zero_now_and_then_ends_nothing_and_one_that_lasts_does() -> None:
    watch = SetpointAtRestWatch(config())
    told = [check(watch, AT_REST if n % 5 == 0 else CREEPS, REST, 10.0 + n / 64) for n in range(45)]
    assert told[0] == told[33] == ""
    assert told[-1] != ""
    assert check(watch, AT_REST, REST, 10.0 + 45 / 64 + HOLD_S) == ""
    assert check(watch, CREEPS, REST, 10.8 + HOLD_S) == ""


def test_it_is_a_setpoint_outside_of_the_leases() -> None:
    verdict = decide(well(setpoint_at_rest="left is ordered 0.0280 m/s for 0.400 s"), CONFIG, NOW)
    assert verdict.cause is TripCause.TARGET_OUTSIDE
    assert verdict.detail == "left is ordered 0.0280 m/s for 0.400 s, while the leases allow no motion"


@pytest.mark.parametrize("slow", [Twist2D(0.028, 0.0), Twist2D(0.0, 0.1)])
def test_a_driver_that_repeats_a_slow_setpoint_for_ever_is_stopped(slow: Twist2D) -> None:
    """2.8 cm/s and 5.7 degrees/s are within the tolerance: they went on for ever after the filter had ordered zero."""
    world = World()
    world.drive(slow, 0.6)
    lies(world, lambda cob_id, target: target, parrot=True)
    world.run(0.02)
    world.command = Twist2D.ZERO
    assert world.run(1.0, lambda: world.watchdog is not None and world.watchdog.status.state is State.TRIPPED)
    assert world.watchdog is not None
    assert world.watchdog.status.verdict.cause is TripCause.TARGET_OUTSIDE
    assert world.run(0.2, lambda: not any(world.powered))


@pytest.mark.parametrize("turn", [1, -1])
def test_a_driver_that_creeps_with_a_zero_now_and_then_is_stopped(turn: int) -> None:
    """0.028 m/s for 0.3 s and two zeros, again and again: 0.26 m in 10 s, or a turn of 1 rad, with zero ordered."""
    world = World()
    world.enable()
    start, slow = world.now_s, round(0.028 * BITS_PER_MPS)
    both = {0x201: slow, 0x202: -turn * slow}  # the right one is mounted mirrored
    lies(world, lambda cob_id, target: both[cob_id] if (world.now_s - start) % 0.32 < 0.3 else 0)
    assert world.run(2.0, lambda: world.watchdog is not None and world.watchdog.status.state is State.TRIPPED)
    assert abs(world.truth.x_m) < 0.05


def test_an_honest_driver_that_creeps_to_its_stop_is_left_alone() -> None:
    """Slow orders one after the other, each with a rest that is as long as the hold, or shorter."""
    world = World()
    world.enable()
    for rest_s in (0.1, 0.36, 0.5):
        world.command = Twist2D(0.02, 0.05)
        world.run(0.3)
        world.command = Twist2D.ZERO
        world.run(rest_s)
    assert world.watchdog is not None
    assert world.watchdog.status.state is State.WATCHING, world.watchdog.status
