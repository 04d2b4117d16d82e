"""Encoders that fail, wheels that do not follow, frames of one axis that stay away: real driver core, simulated drives.

    fault ──── trip ──── power off          the drive closes its own loops on the sensor that failed:
                                            a wheel runs away until its power is off

All in virtual time. The base drives straight on; the fault is that of the left wheel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import pytest

from canbase_driver.cia301.frame import Frame
from canbase_driver.core import DriverCore
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.supervision.lifecycle import Aim
from canbase_sim import faults
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.plant.encoder import EncoderFault
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import State, Watchdog
from support.chain_world import STEP_S, World, bench_robot

IMPLAUSIBLE, MISSING, TWIST = TripCause.FEEDBACK_IMPLAUSIBLE, TripCause.MOTION_MISSING, TripCause.TWIST_OUTSIDE


@dataclass(frozen=True)
class Course:
    """What came of a fault. Times since it began [s]."""

    cause: TripCause
    detail: str
    trip_s: float
    off_s: float
    peak_mps: float
    turned_rad: float


def watchdog_alone() -> World:
    """A driver that takes a wheel with torque and no speed for a stall is first at some speeds: here it waits."""
    robot = bench_robot()
    return World(robot.model_copy(update={"health": robot.health.model_copy(update={"stall_time_s": 2.0})}))


def driving(speed: float, turn: float = 0.0) -> World:
    world = watchdog_alone()
    world.drive(Twist2D(speed, turn), 1.2)
    return world


def at_rest() -> World:
    world = watchdog_alone()
    world.enable()
    return world


def suffer(world: World, kind: str, **arguments: Any) -> None:
    faults.apply(world.bench.nodes, 1, kind, world.now_s, arguments)


def watchdog(world: World) -> Watchdog:
    assert world.watchdog is not None
    return world.watchdog


def tripped(world: World) -> bool:
    return watchdog(world).status.state is State.TRIPPED


def course(world: World, within_s: float) -> Course:
    """Let time pass until the power of the left wheel is off."""
    start, heading, peak_mps = world.now_s, world.truth.yaw_rad, 0.0
    trip_s = turned_rad = 0.0
    while world.powered[0]:
        world.run(STEP_S)
        peak_mps = max(peak_mps, abs(world.truth.v_left_mps))
        if tripped(world) and not trip_s:
            trip_s, turned_rad = world.now_s - start, abs(world.truth.yaw_rad - heading)
        assert world.now_s < start + within_s, f"no trip in time, {world.truth}"
    verdict = watchdog(world).status.verdict
    return Course(verdict.cause, verdict.detail, trip_s, world.now_s - start, peak_mps, turned_rad)


# --- all that hangs on one encoder


@pytest.mark.parametrize(("shown", "ordered"), [(0.1, 0.11), (0.1, 0.15), (0.5, 0.52), (0.5, 0.6)])
def test_an_encoder_that_loses_counts_just_below_the_order_makes_no_wheel_run_away(
    shown: float, ordered: float
) -> None:
    """Its wheel was 10 m/s fast and nothing tripped: what it shows is within every tolerance of the order."""
    world = at_rest()
    world.bench.nodes[1].axes[0].lose_encoder(EncoderFault(factor=1.0, most_mps=shown))
    world.command = Twist2D(ordered, 0.0)
    world.run(2.0, lambda: abs(world.truth.v_left_mps) > ordered)
    seen = course(world, 1.0)
    assert seen.cause is MISSING
    assert seen.off_s <= 0.5
    assert seen.peak_mps <= ordered + 2.3


@pytest.mark.parametrize(
    ("kind", "speed", "cause", "off_s", "peak_mps"),
    [
        ("encoder_lost", 0.05, MISSING, 0.28, 1.45),
        ("encoder_lost", 0.2, MISSING, 0.28, 1.55),
        ("encoder_lost", 0.3, IMPLAUSIBLE, 0.07, 0.7),
        ("encoder_lost", 0.8, IMPLAUSIBLE, 0.07, 1.2),
        ("encoder_zero", 0.3, IMPLAUSIBLE, 0.07, 0.7),
        ("encoder_frozen", 0.05, IMPLAUSIBLE, 0.25, 1.5),
        ("encoder_frozen", 0.3, IMPLAUSIBLE, 0.25, 1.5),
        ("encoder_reversed", 0.3, TripCause.MOTION_OUTSIDE, 0.12, 1.0),
        ("encoder_intermittent", 0.3, IMPLAUSIBLE, 0.07, 0.7),
        ("encoder_jumping", 0.3, IMPLAUSIBLE, 0.1, 0.5),
    ],
)
def test_an_encoder_that_fails_at_speed_takes_the_power(
    kind: str, speed: float, cause: TripCause, off_s: float, peak_mps: float
) -> None:
    world = driving(speed)
    suffer(world, kind)
    seen = course(world, 1.0)
    assert seen.cause is cause
    assert "left_wheel" in seen.detail
    assert seen.off_s <= off_s
    assert seen.peak_mps <= peak_mps
    world.command = Twist2D.ZERO
    world.stands_after(6.0)


@pytest.mark.parametrize("speed", [0.03, 0.8])
def test_an_encoder_that_is_lost_at_rest_is_found_at_the_first_order(speed: float) -> None:
    world = at_rest()
    suffer(world, "encoder_lost")
    world.run(2.0)
    assert not tripped(world)
    world.command = Twist2D(speed, 0.0)
    seen = course(world, 1.0)
    assert seen.cause is MISSING
    assert seen.off_s <= 0.45
    assert seen.peak_mps <= 1.9
    assert "left_wheel is" in seen.detail


def test_an_encoder_that_is_lost_while_the_base_brakes_is_found_after_the_order_has_ended() -> None:
    world = driving(0.5)
    world.command = Twist2D.ZERO
    world.run(0.2)
    suffer(world, "encoder_lost")
    assert course(world, 1.0).off_s <= 0.4


def test_short_orders_with_a_lost_encoder_add_up() -> None:
    world = at_rest()
    suffer(world, "encoder_lost")
    orders = 0
    while not tripped(world):
        orders += 1
        assert orders < 6
        world.command = Twist2D(0.1, 0.0)
        world.run(0.06)
        world.command = Twist2D.ZERO
        world.run(0.3)


def test_short_orders_add_up_over_the_times_without_power() -> None:
    world = at_rest()
    suffer(world, "encoder_lost")
    cycles = 0
    while not tripped(world):
        cycles += 1
        assert cycles < 8
        world.command = Twist2D(0.1, 0.0)
        world.run(0.06)
        world.command = Twist2D.ZERO
        if not world.run(0.3, lambda: tripped(world)):
            assert world.go(Aim.CONFIGURED).done
            assert world.go(Aim.ACTIVE).done
            world.enable()
    assert watchdog(world).status.verdict.cause is MISSING


@pytest.mark.parametrize("speed", [0.002, 0.005])
def test_an_order_that_is_slower_than_standstill_is_no_cover_for_a_lost_encoder(speed: float) -> None:
    """A setpoint of this kind comes from a driver that does not leave it out."""
    world = at_rest()
    suffer(world, "encoder_lost")
    world.command = Twist2D(speed, 0.0)
    start = world.now_s
    assert course(world, 0.006 / speed + 0.4).cause is MISSING
    assert world.now_s - start <= 0.006 / speed + 0.4


@pytest.mark.parametrize("speed", [0.5, 0.8])
def test_an_encoder_that_is_lost_in_the_quick_stop_proves_no_standstill(speed: float) -> None:
    world = driving(speed)
    world.leases = False
    assert world.run(1.0, lambda: tripped(world))
    world.run(0.05)
    suffer(world, "encoder_lost")
    while abs(world.truth.v_left_mps) > 0.01:
        world.run(STEP_S)
        assert not watchdog(world).status.settled, world.truth
    assert not world.powered[0]


@pytest.mark.parametrize(("speed", "way_m"), [(0.03, 0.01), (0.1, 0.03), (0.8, 0.1)])
def test_a_frozen_6064h_is_found_after_a_stated_way_at_any_speed(speed: float, way_m: float) -> None:
    world = driving(speed)
    start_m = world.bench.base.travel_left_m
    suffer(world, "frozen_encoder")
    seen = course(world, 1.0)
    assert seen.cause in (MISSING, IMPLAUSIBLE)
    assert speed * seen.trip_s <= way_m
    assert world.bench.base.travel_left_m - start_m <= way_m


# --- wheels that do not follow upward


@pytest.mark.parametrize(
    ("kind", "speed"), [("blocked", 0.03), ("blocked", 0.4), ("weak", 0.1), ("ignores_setpoints", 0.1)]
)
def test_a_wheel_that_stays_while_the_other_one_goes(kind: str, speed: float) -> None:
    world = at_rest()
    suffer(world, kind)
    world.command = Twist2D(speed, 0.0)
    seen = course(world, 1.0)
    assert seen.cause is MISSING
    assert "left_wheel is" in seen.detail
    assert seen.trip_s <= 0.45
    assert seen.turned_rad <= 0.1


@pytest.mark.parametrize(("speed", "share"), [(0.1, 0.5), (0.3, 0.75), (0.8, 0.5)])
def test_a_base_with_a_wheel_that_gets_a_share_of_its_setpoint_stops_turning(speed: float, share: float) -> None:
    world = at_rest()
    suffer(world, "limited", share=share)
    world.command = Twist2D(speed, 0.0)
    seen = course(world, 2.0)
    assert seen.cause is TWIST
    assert "left_wheel is" in seen.detail
    assert seen.trip_s <= 1.0
    assert seen.turned_rad <= 0.2


def test_a_turn_in_place_about_one_wheel_is_no_turn_in_place() -> None:
    world = at_rest()
    suffer(world, "limited", share=0.5)
    world.command = Twist2D(0.0, 1.0)
    assert course(world, 2.0).cause is TWIST


def test_on_a_curve_a_slow_wheel_is_found_by_its_own_speed() -> None:
    world = at_rest()
    faults.apply(world.bench.nodes, 2, "limited", world.now_s, {"share": 0.5})
    world.command = Twist2D(0.4, 0.8)
    assert world.run(4.0, lambda: tripped(world))
    verdict = watchdog(world).status.verdict
    assert (verdict.cause, verdict.node_id) == (MISSING, 2)
    assert "right_wheel turns at 0.300 m/s, its setpoints order" in verdict.detail


# --- what is not a reason


@pytest.mark.parametrize(("speed", "force_n"), [(0.0, 150.0), (0.1, 250.0), (0.3, 60.0), (0.3, 250.0), (0.8, 250.0)])
def test_a_wheel_against_a_threshold_for_a_moment_goes_on(speed: float, force_n: float) -> None:
    world = driving(speed)
    suffer(world, "blocked", force_n=force_n)
    world.command = Twist2D(speed or 0.3, 0.0)
    world.run(0.2)
    suffer(world, "heal")
    assert not world.run(2.0, lambda: tripped(world)), watchdog(world).status


@pytest.mark.parametrize(
    ("speed", "force_n", "held_s", "creep"),
    [(0.08, 150.0, 0.15, -0.004), (0.1, 250.0, 0.2, -0.006), (0.15, 150.0, 0.2, -0.004)],
)
def test_a_wheel_that_is_held_while_its_order_goes_through_zero_goes_on(
    speed: float, force_n: float, held_s: float, creep: float
) -> None:
    """Free again it has to creep the other way: friction holds it until the drive pushes enough."""
    world = driving(speed)
    suffer(world, "blocked", force_n=force_n)
    world.command = Twist2D(creep, 0.0)
    world.run(held_s)
    suffer(world, "heal")
    assert not world.run(2.0, lambda: tripped(world)), watchdog(world).status


def test_a_glitch_of_the_velocity_is_no_reason() -> None:
    for speed in (0.0, 0.3):
        world = driving(speed)
        axis = world.node.axes[0]
        for raw in (0, 10_000, 0):
            axis.faults.stuck_velocity = raw
            world.run(0.01)
            axis.faults.stuck_velocity = None
            world.run(0.3)
        assert not tripped(world), watchdog(world).status


# --- the reset: a sensor that is doubted proves no standstill


def test_after_a_lost_encoder_the_reset_waits_until_the_wheel_has_rolled_out() -> None:
    world = driving(0.3)
    suffer(world, "encoder_lost")
    course(world, 1.0)
    world.command = Twist2D.ZERO
    world.run(2.0)
    assert abs(world.truth.v_left_mps) > 0.0 or not watchdog(world).status.settled
    assert not world.reset().done
    world.run(2.0 * world_coasting_s(world))  # the watchdog's own, then the driver's, from its new boot on
    assert world.truth.standing_s > 0.5
    suffer(world, "heal")
    assert world.reset().done
    world.command = Twist2D(0.3, 0.0)
    assert not world.run(2.0, lambda: tripped(world))


def world_coasting_s(world: World) -> float:
    return watchdog(world)._config.coasting_s


def test_a_reset_trusts_a_sensor_until_it_fails_again() -> None:
    world = driving(0.3)
    suffer(world, "encoder_lost")
    course(world, 1.0)
    world.command = Twist2D.ZERO
    world.run(2.0 + 2.0 * world_coasting_s(world))
    assert world.reset().done
    world.run(1.0)
    world.command = Twist2D(0.3, 0.0)
    assert course(world, 1.0).cause is MISSING


# --- frames of one axis


class Sieve:
    """The real driver, of whose frames some do not get onto the bus."""

    def __init__(self, driver: DriverCore, drops: Callable[[Frame, int], bool]) -> None:
        self._driver, self._drops, self._cycle = driver, drops, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._driver, name)

    def tick(self, now_s: float) -> list[Frame]:
        self._cycle += 1
        return [frame for frame in self._driver.tick(now_s) if not self._drops(frame, self._cycle)]


def sieve(world: World, drops: Callable[[Frame, int], bool]) -> None:
    world.driver = cast(DriverCore, Sieve(world.core, drops))


@pytest.mark.parametrize(("speed", "every", "within_s"), [(0.0, 1, 0.12), (0.3, 1, 0.12), (0.3, 2, 0.45)])
def test_setpoints_of_one_axis_that_do_not_come_trip(speed: float, every: int, within_s: float) -> None:
    world = driving(speed)
    sieve(world, lambda frame, cycle: frame.cob_id == 0x201 and cycle % every == 0)
    start = world.now_s
    assert world.run(1.0, lambda: tripped(world))
    verdict = watchdog(world).status.verdict
    assert (verdict.cause, verdict.node_id) == (TripCause.SETPOINT_MISSING, 1)
    assert world.now_s - start <= within_s


def test_a_setpoint_that_is_lost_now_and_then_does_not() -> None:
    world = driving(0.3)
    sieve(world, lambda frame, cycle: frame.cob_id == 0x201 and cycle % 3 == 0)
    assert not world.run(2.0, lambda: tripped(world))


def test_feedback_of_one_axis_that_does_not_come_trips() -> None:
    world = driving(0.3)
    suffer(world, "tpdo_lost")
    assert course(world, 1.0).cause is TripCause.DRIVE_SILENT


@pytest.mark.parametrize("speed", [0.3])
def test_two_drives_with_one_node_id_trip(speed: float) -> None:
    world = driving(speed)
    tick = world.bench.tick

    def twice(now_s: float) -> list[BenchFrame]:
        said = tick(now_s)
        return said + [frame for frame in said if frame.cob_id in (0x181, 0x281)]

    world.bench.tick = twice  # type: ignore[method-assign]
    start = world.now_s
    assert world.run(1.0, lambda: tripped(world))
    verdict = watchdog(world).status.verdict
    assert (verdict.cause, verdict.node_id) == (TripCause.ANSWERED_TWICE, 1)
    assert world.now_s - start <= 0.12


# 0.3 m/s ── the left drive, or a second one with its id, sends a boot-up and goes on ── trip in the next turn
def test_a_boot_up_of_an_enabled_drive_trips_at_once_whatever_the_driver_does() -> None:
    world = driving(0.3)
    deaf(world, 0x701)
    start = world.now_s
    world.inject(0x701, "00")
    assert world.run(0.1, lambda: tripped(world))
    verdict = watchdog(world).status.verdict
    assert (verdict.cause, verdict.node_id) == (TripCause.DRIVE_RESTARTED, 1)
    assert world.now_s - start <= 0.006
    assert world.run(1.0, lambda: world.truth.standing_s > 0.1)


def test_a_boot_up_before_there_is_power_is_the_ordinary_start() -> None:
    world = World()
    world.run(0.2)
    assert not world.powered[0]
    world.inject(0x701, "00")
    world.run(0.5)
    assert not tripped(world)


# 0.3 m/s ── the TPDOs of the left drive get lost, somebody polls it by SDO 50 times a second ── trip after 0.1 s
def test_values_that_somebody_polls_do_not_stand_in_for_a_tpdo_that_is_lost() -> None:
    world = driving(0.3)
    deaf(world, 0x181, 0x281)  # the driver stops for it by itself, some cycles later
    suffer(world, "tpdo_lost")
    start = world.now_s
    while not tripped(world) and world.now_s < start + 1.0:
        world.inject(0x601, "40 41 60 00 00 00 00 00")
        world.run(0.01)
        world.inject(0x601, "40 6C 60 00 00 00 00 00")
        world.run(0.01)
    assert watchdog(world).status.verdict.cause is TripCause.DRIVE_SILENT
    assert world.now_s - start <= 0.13


def deaf(world: World, *cob_ids: int) -> None:
    """The driver does not receive these frames."""
    take = world.core.on_frame
    world.core.on_frame = lambda frame, now_s: [] if frame.cob_id in cob_ids else take(frame, now_s)  # type: ignore[method-assign]
