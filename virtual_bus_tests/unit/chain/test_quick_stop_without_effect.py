"""A drive reports its quick stop and brakes not at all, or far less than asked: how long until its power goes.

Real driver core, real watchdog, simulated drives. It takes the lag, a window of time that follows from the noise of the
speed and the deceleration, and LASTS_S: at any speed (docs/decisions/0023).
"""

from __future__ import annotations

import pytest

from canbase_config.derive import slope_window_s
from canbase_config.robot import Robot
from canbase_config.stopping import lag_s
from canbase_driver.motion.braking import Braking
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.faults import apply
from canbase_watchdog import policy
from canbase_watchdog.slowing import LASTS_S
from canbase_watchdog.trip_cause import FINE
from canbase_watchdog.watchdog import State
from support.chain_world import World, bench_robot

SEEN_S = 0.02
"""A sample waits for its SYNC, and the order to take the power for the next tick."""


def robot(mps: float, deceleration_mps2: float, hz: float = 100.0) -> Robot:
    bench = bench_robot().model_dump()
    bench["limits"] |= {
        "linear_mps": mps,
        "acceleration_mps2": 3.0,
        "deceleration_mps2": deceleration_mps2,
        "emergency_deceleration_mps2": deceleration_mps2,
        "jerk_mps3": 100.0,
    }
    bench["rates"] |= {"control_hz": hz}
    bench["timeouts"] |= {"standstill_s": None, "feedback_s": max(0.1, 4.0 / hz + 0.01)}
    return Robot.model_validate(bench)


def worst_s(of: Robot) -> float:
    """From the order to stop until the power goes, by robot.yaml."""
    cycles_s = 3.0 / of.rates.control_hz
    return of.watchdog.drive_lag_s + slope_window_s(of) + max(LASTS_S, cycles_s) + 2.0 / of.rates.control_hz + SEEN_S


def driving(of: Robot, share: float = 0.0) -> World:
    """At full speed; the left drive will brake with this share of its ramp."""
    world = World(of)
    mps = of.limits.linear_mps
    world.drive(Twist2D(mps, 0.0), 0.5 + 1.3 * mps / 3.0)
    apply(world.bench.nodes, 1, "unbraked", world.now_s, {"share": share})
    assert world.truth.v_left_mps == pytest.approx(mps, rel=0.03)
    return world


def power_s(world: World, longest_s: float = 20.0) -> float:
    """So long the drive keeps its power."""
    begin = world.now_s
    assert world.run(longest_s, lambda: not world.powered[0]), "the drive has power for ever"
    return world.now_s - begin


def stopped_by_watchdog(of: Robot, share: float = 0.0) -> tuple[float, World]:
    """Its leases end; the driver sees that it has tripped, and takes no power away by itself."""
    world = driving(of, share)
    watchdog, world.leases = world.watchdog, False
    assert watchdog is not None
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Braking, "keeps_speed", lambda self, speed_mps, now_s: False)
        patch.setattr(Braking, "fails", lambda self, speed_mps, now_s: False)
        assert world.run(1.0, lambda: watchdog.status.state is State.TRIPPED)
        return power_s(world), world


def stopped_by_driver(of: Robot, share: float = 0.0) -> float:
    """The other drive is in fault: the driver's quick stop. The watchdog judges nothing."""
    world = driving(of, share)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(policy, "decide", lambda view, config, now_s, fine: FINE)
        apply(world.bench.nodes, 2, "fault", world.now_s, {})
        assert world.run(1.0, lambda: world.core.state is DriverState.STOPPING)
        return power_s(world)


CASES = [(0.3, 0.4), (0.8, 0.2), (0.8, 1.0), (3.0, 0.4), (3.0, 3.0)]


@pytest.mark.parametrize(("mps", "deceleration_mps2"), CASES)
def test_the_watchdog_takes_the_power_after_a_time_that_does_not_depend_on_the_speed(
    mps: float, deceleration_mps2: float
) -> None:
    of = robot(mps, deceleration_mps2)
    power, world = stopped_by_watchdog(of)
    assert world.watchdog is not None
    assert power <= worst_s(of)
    assert not world.watchdog.keeps_relay
    if deceleration_mps2 >= 0.4:
        assert power <= of.watchdog.drive_lag_s + 0.3


@pytest.mark.parametrize(("mps", "deceleration_mps2"), CASES)
def test_the_driver_takes_the_power_after_a_time_that_does_not_depend_on_the_speed(
    mps: float, deceleration_mps2: float
) -> None:
    of = robot(mps, deceleration_mps2)
    assert stopped_by_driver(of) <= worst_s(of) - of.watchdog.drive_lag_s + lag_s(of)


@pytest.mark.parametrize("share", [0.05, 0.15])
def test_a_drive_that_brakes_far_less_than_asked_is_found_as_soon(share: float) -> None:
    of = robot(3.0, 0.4)
    assert stopped_by_watchdog(of, share)[0] <= worst_s(of)


def test_a_drive_that_brakes_with_half_of_it_is_waited_for() -> None:
    """0.8 m/s at 0.2 m/s² takes 4 s; the other wheel has its own ramp of 0.4 m/s²."""
    power, world = stopped_by_watchdog(robot(0.8, 0.4), 0.55)
    assert power == pytest.approx(0.8 / 0.22, abs=0.2)
    assert world.truth.v_left_mps == pytest.approx(0.0, abs=0.01)


def test_a_drive_without_power_that_rolls_does_not_cost_the_other_one_its_power() -> None:
    """STO opens at the right wheel, which rolls; the left one brakes to the end of its ramp."""
    world = World(robot(0.8, 0.4))
    world.drive(Twist2D(0.8, 0.0), 1.0)
    apply(world.bench.nodes, 2, "sto", world.now_s, {})
    assert world.run(1.0, lambda: world.core.state is DriverState.STOPPING)
    assert power_s(world) > 0.7


def test_at_20_hz_it_takes_the_lag_the_window_and_some_cycles() -> None:
    of = robot(0.8, 1.0, 20.0)
    assert stopped_by_watchdog(of)[0] <= worst_s(of)


def test_without_sync_the_speeds_are_read_by_sdo_one_after_the_other() -> None:
    """The driver is dead: 0.03 s a turn of SDO. It was 0.2 s more when feedback had to be 0.1 s old to be read."""
    of = robot(0.8, 0.4)
    world = driving(of)
    watchdog = world.watchdog
    assert watchdog is not None
    world.kill_driver()
    assert world.run(1.0, lambda: watchdog.status.state is State.TRIPPED)
    assert power_s(world) <= worst_s(of) + 2 * 0.035
