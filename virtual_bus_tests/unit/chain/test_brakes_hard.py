"""How hard the base brakes comes with the lease of the command, by the watchdog, which enforces it. In virtual time.

The bench robot at 0.3 m/s: 0.3 s with 1 m/s² and its jerk limit, 0.15 s with 2 m/s². At 0.8 m/s: 0.88 s and 0.40 s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import pytest

from canbase_config.robot import Robot
from canbase_config.stopping import emergency_wait_s
from canbase_driver.causes import DriverCause
from canbase_driver.cia301.frame import Frame
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.limiter import MotionState
from canbase_runtime.driver_state import DriverState
from canbase_watchdog.trip_cause import FINE, TripCause
from canbase_watchdog.watchdog import State, Watchdog
from support.chain_world import BOOTED_S, FORWARD, World, bench_robot, world_of

STATE = 0x1FE
HARD = 0x40
"""Bit of byte 2 of the state frame."""
FAST = Twist2D(0.8, 0.0)


@pytest.fixture
def world(kind: str) -> World:
    return world_of(kind)


def fast_robot() -> Robot:
    bench = bench_robot().model_dump()
    bench["limits"] |= {"linear_mps": 0.8}
    bench["timeouts"] |= {"standstill_s": None}
    return Robot.model_validate(bench)


def fast() -> World:
    """At 0.8 m/s."""
    world = World(fast_robot())
    world.drive(FAST, 2.5)
    assert world.truth.linear_mps == pytest.approx(0.8, abs=0.01)
    return world


def watchdog(world: World) -> Watchdog:
    assert world.watchdog is not None
    return world.watchdog


def stop(world: World) -> tuple[float, float]:
    """Time [s] and distance [m] until the base is at standstill."""
    way_m = world.truth.path_m
    return world.stands_after(), world.truth.path_m - way_m


def brake(world: World) -> None:
    world.command, world.brakes_hard = Twist2D.ZERO, True


def test_an_emergency_brakes_with_the_emergency_deceleration_and_trips_nothing(world: World) -> None:
    world.drive()
    brake(world)
    world.run(0.2)
    assert world.targets_mps()[-4:] == [(0.0, 0.0)] * 4
    assert world.truth.linear_mps < 0.1
    world.brakes_hard, world.command = False, FORWARD
    world.run(0.8)
    assert world.core.state is DriverState.ENABLED
    assert world.truth.linear_mps == pytest.approx(0.3, abs=0.005)


def test_without_an_emergency_it_is_not_yet_at_zero_then(world: World) -> None:
    world.drive()
    world.command = Twist2D.ZERO
    world.run(0.2)
    assert world.targets_mps()[-1][0] > 0.05


def test_an_emergency_stop_of_0_8_mps_takes_half_the_time_and_the_way_of_an_ordinary_one() -> None:
    world = fast()
    brake(world)
    time_s, way_m = stop(world)
    assert 0.40 < time_s < 0.53  # the drives of the bench lag behind their setpoints
    assert way_m < 0.21
    assert watchdog(world).verdict is FINE
    ordinary = fast()
    ordinary.command = Twist2D.ZERO
    slow_s, far_m = stop(ordinary)
    assert slow_s > 0.85
    assert far_m > 0.36


def test_the_driver_knows_it_in_the_state_frame_that_follows_the_lease_at_once() -> None:
    world = fast()
    since = world.now_s
    brake(world)
    world.run(0.03)
    frames = [(at - since, frame.data[2] & HARD) for at, frame in world.log if frame.cob_id == STATE and at > since]
    first_s = next(at_s for at_s, bit in frames if bit)
    assert first_s < 0.026  # the lease comes every 20 ms here, a tick every 5 ms
    world.run(0.3)
    later = [at for at, frame in world.log if frame.cob_id == STATE and frame.data[2] & HARD]
    assert max(after - before for before, after in pairwise(later)) < 0.061


def test_a_lease_without_it_takes_nothing_back_before_standstill() -> None:
    """A filter that was started again, or a decision that is late: 0.1 s after it the leases order motion again."""
    world = fast()
    brake(world)
    world.run(0.1)
    world.brakes_hard, world.command = False, FAST
    world.run(0.32)
    setpoints = [left for left, _ in world.targets_mps()]
    began = next(at for at, (before, after) in enumerate(pairwise(setpoints)) if after < before - 0.015)
    falling = setpoints[began:]
    zero = falling.index(0.0)
    assert all(before - after >= 0.019 for before, after in pairwise(falling[: zero - 1]))
    assert zero <= 42
    assert watchdog(world).verdict is FINE
    world.run(1.5)
    assert world.truth.linear_mps == pytest.approx(0.8, abs=0.01)


def test_a_frame_without_the_bit_takes_nothing_back_before_the_ramp_is_at_zero() -> None:
    """As of a second watchdog: its frame between those of the first one."""
    world = fast()
    brake(world)
    for _ in range(22):
        world.run(0.02)
        world.inject(STATE, "01 00 80 00 0a 00 00 00")
    assert world.targets_mps()[-1] == (0.0, 0.0)


@pytest.mark.parametrize("held_s", [0.01, 0.1, 2.0])
def test_at_standstill_it_ends_with_the_next_lease_without_it(held_s: float) -> None:
    world = World()
    world.enable()
    world.brakes_hard = True
    world.run(held_s)
    world.brakes_hard, world.command = False, FORWARD
    world.run(0.8)
    assert world.truth.linear_mps == pytest.approx(0.3, abs=0.005)


def test_what_is_pressed_without_power_holds_after_enabling_too() -> None:
    world = World()
    world.brakes_hard = True
    world.run_until(DriverState.ENABLED, BOOTED_S)
    world.run(0.1)
    world.command = FORWARD
    world.run(0.5)
    assert world.truth.path_m == 0.0


@pytest.mark.parametrize("lost", [0, 1])
def test_one_state_frame_that_is_lost_trips_nothing(lost: int) -> None:
    """The next one, 0.05 s later, has the bit too."""
    world = fast()
    flagged: list[Frame] = []

    def loses(frame: Frame) -> bool:
        if frame.cob_id == STATE and frame.data[2] & HARD:
            flagged.append(frame)
            return len(flagged) <= lost
        return False

    world.loses = loses
    brake(world)
    time_s, _ = stop(world)
    assert time_s < 0.53 + 0.03 * lost  # half of the 0.05 s: it has braked gently until then
    assert watchdog(world).verdict is FINE


def soft(world: World) -> None:
    """A driver that obeys its command, and not the bit."""
    step = world.core._limiter.step

    def gently(current: MotionState, target: Twist2D, dt_s: float, *, emergency: bool = False) -> MotionState:
        return step(replace(current, emergency=False), target, dt_s)

    object.__setattr__(world.core, "_limiter", type("Soft", (), {"step": staticmethod(gently)})())


def follows_on(world: World) -> None:
    """A driver that keeps its setpoints."""
    stuck = world.core._motion
    object.__setattr__(world.core, "_limiter", type("Stuck", (), {"step": lambda *_, **__: stuck})())


@pytest.mark.parametrize(("fault", "within_s"), [(soft, 0.37), (follows_on, 0.24)])
def test_a_driver_that_brakes_too_softly_trips_and_the_drives_brake(
    fault: Callable[[World], None], within_s: float
) -> None:
    """0.12 s, then its setpoints lose more than 0.05 m/s and 5 % less than 2 m/s². An ordinary stop takes 0.88 s."""
    world = fast()
    fault(world)
    begin, way_m = world.now_s, world.truth.path_m
    brake(world)
    assert world.run(1.0, lambda: watchdog(world).status.state is State.TRIPPED)
    assert watchdog(world).verdict.cause is TripCause.TARGET_OUTSIDE
    assert emergency_wait_s(world.robot) < world.now_s - begin < within_s
    world.run(1.0)
    assert world.truth.path_m - way_m < 0.33


def test_a_driver_without_the_watchdog_brakes_hard_because_it_cannot_know() -> None:
    """0.2 s after the last state frame: timeouts.watchdog_s."""
    world = fast()
    world.watchdog = None
    world.run(0.14)
    assert world.targets_mps()[-1][0] == pytest.approx(0.8, abs=1e-3)
    assert world.run(0.1, lambda: world.targets_mps()[-1][0] < 0.77)
    falling = [left for left, _ in world.targets_mps()][-3:]
    assert [before - after for before, after in pairwise(falling)] == pytest.approx([0.02, 0.02], abs=0.001)


def test_a_driver_that_receives_no_frame_with_the_bit_brakes_hard_before_it_has_to() -> None:
    """All of them are lost to it: for 0.2 s it brakes gently, then it cannot know."""
    world = fast()
    world.loses = lambda frame: frame.cob_id == STATE and bool(frame.data[2] & HARD)
    brake(world)
    time_s, way_m = stop(world)
    assert time_s < 0.65
    assert way_m < 0.28
    assert world.core.finding.cause is DriverCause.WATCHDOG_MISSING
    assert watchdog(world).verdict is FINE
