"""A wheel is blocked while it is ordered to turn: the driver names the stall and takes the power, in virtual time.

Driver, watchdog and simulated drives of every kind. What may not stop the base: kerbs, slopes, payload, reversals.
"""

from __future__ import annotations

import pytest

from canbase_config.profile_file import load_profile
from canbase_config.robot import Robot
from canbase_driver.causes import DriverCause
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim import faults
from canbase_sim.plant.base import PlantParameters
from canbase_sim.world.bench import Bench
from canbase_watchdog.trip_cause import TripCause
from support.chain_world import FORWARD, STEP_S, World, bench_robot, world_of

ANSWER_S = 0.15
"""From the limit of a stall to the power off, at most."""
AT_ONCE_S = 0.05
"""The same, where no wheel is braked first: one sample, one cycle of quick stop, and one until the power is off."""
LIMIT_S = 0.22
"""health.stall_time_s of the sample robot."""


def robot_with_health(motion_missing_s: float = 0.25, **keys: object) -> Robot:
    robot = bench_robot()
    watchdog = robot.watchdog.model_copy(update={"motion_missing_s": motion_missing_s})
    return robot.model_copy(update={"health": robot.health.model_copy(update=keys), "watchdog": watchdog})


def block(world: World, *sides: str, force_n: float = faults.BLOCKED_N) -> None:
    for drive in world.robot.drives:
        if drive.side in sides:
            told = {"axis": drive.axis, "force_n": force_n}
            faults.apply(world.bench.nodes, drive.node_id, "blocked", world.now_s, told)


def pushes(world: World, share: float = 0.8) -> bool:
    """The left motor has the torque at which a stall begins."""
    drive = world.robot.drives[0]
    motor = world.bench.nodes[drive.node_id].axes[drive.axis].motor
    return abs(motor.force_n) >= share * motor.peak_force_n


def until_off_s(world: World, share: float = 0.8) -> float:
    """From the torque of a stall until no motor has power [s]."""
    assert world.run(2.0, lambda: pushes(world, share)), "the motor never had the torque of a stall"
    begin = world.now_s
    assert world.run(2.0, lambda: not any(world.powered)), f"power stays on: {world.core.finding}"
    return world.now_s - begin


def test_a_blocked_wheel_loses_its_power_within_150_ms_of_the_limit(kind: str) -> None:
    """A kind that reports no torque is stopped by the watchdog, which misses the motion."""
    world = world_of(kind)
    world.enable()
    world.run(0.1)
    block(world, "left")
    world.command = FORWARD
    off_s = until_off_s(world)
    world.run(0.05)
    if load_profile(kind).options.torque == "none":
        assert world.core.finding.cause is DriverCause.WATCHDOG_TRIPPED
        return
    assert LIMIT_S <= off_s <= LIMIT_S + ANSWER_S
    assert world.core.finding.cause is DriverCause.STALLED
    assert world.core.finding.detail.startswith(f"{world.robot.drives[0].joint} stalls: 100% of the rated torque")


@pytest.mark.parametrize("sides", [("left",), ("left", "right")])
@pytest.mark.parametrize("speed", [0.02, 0.1, -0.05, -0.3])
def test_one_wheel_or_both_at_any_speed_and_in_reverse(sides: tuple[str, ...], speed: float) -> None:
    world = World()
    world.enable()
    block(world, *sides)
    world.command = Twist2D(speed, 0.0)
    assert LIMIT_S <= until_off_s(world) <= LIMIT_S + ANSWER_S
    assert world.core.finding.cause is DriverCause.STALLED


@pytest.mark.parametrize(("time_s", "share"), [(0.05, 0.8), (0.3, 0.8), (0.3, 0.3)])
def test_its_limits_are_those_of_robot_yaml_and_the_driver_acts_alone(time_s: float, share: float) -> None:
    world = World(robot_with_health(2.0, stall_time_s=time_s, stall_torque_share=share))
    world.enable()
    block(world, "left")
    world.command = FORWARD
    assert time_s <= until_off_s(world, share) <= time_s + AT_ONCE_S, "the other wheel is not braked first"
    assert world.core.finding.cause is DriverCause.STALLED
    assert world.watchdog is not None
    assert world.watchdog.status.verdict.cause is TripCause.NONE


def test_a_stall_is_latched_and_a_reset_goes_on_once_the_wheel_is_free() -> None:
    world = World()
    world.enable()
    block(world, "left")
    world.command = FORWARD
    until_off_s(world)
    world.run_until(DriverState.LATCHED, 1.0)
    stop = world.core.stops[-1]
    assert (stop.cause, stop.latched, stop.clears_on) == ("stalled", True, "reset, with the wheel free to turn")
    block(world, "left", force_n=0.0)
    world.command = None
    world.run(30.0)
    assert world.recovered()


def test_the_torque_of_a_wheel_that_the_watchdog_misses_is_named_with_its_trip() -> None:
    """A wheel that stops at once from speed may have a dead encoder: there the watchdog does not wait for a stall."""
    world = World()
    world.drive(FORWARD, 1.0)
    block(world, "left")
    world.run_until(DriverState.STOPPING, 0.2)
    assert world.core.finding.cause is DriverCause.WATCHDOG_TRIPPED
    assert "feedback implausible, node 1; left_wheel stalls: 100% of the rated torque" in world.core.finding.detail


def test_a_wheel_that_is_blocked_on_the_ramp_of_a_stop_is_no_longer_pushed() -> None:
    world = World(robot_with_health(2.0, stall_time_s=0.1))
    world.drive(Twist2D(0.1, 0.0), 1.0)
    world.core.request_stop()
    block(world, "left")
    assert world.run(1.0, lambda: not any(world.powered))
    assert world.core.finding.cause is DriverCause.STOP_REQUESTED


def loaded(push_share: float) -> World:
    """Enabled, with double payload, on a slope that takes this share of the torque."""
    world = World()
    body = PlantParameters(payload_factor=2.0)
    world.bench = Bench(world.robot, world.now_s, body)
    world.enable()
    world.bench.base.push_n = push_share * body.peak_force_n * 2.0
    return world


@pytest.mark.parametrize("share", [-0.45, 0.0, 0.45])
@pytest.mark.parametrize("speed", [0.012, 0.02, 0.3])
def test_a_start_with_double_payload_on_a_slope_is_no_stall(share: float, speed: float) -> None:
    world = loaded(share)
    for sign in (1.0, -1.0):
        world.command = Twist2D(sign * speed, 0.0)
        world.run(3.0)
        world.command = Twist2D.ZERO
        world.run(2.0)
    assert world.core.state is DriverState.ENABLED, world.core.finding


def test_a_standstill_on_a_slope_that_takes_nearly_all_the_torque_is_no_stall() -> None:
    world = loaded(0.9)
    world.run(5.0)
    assert world.core.state is DriverState.ENABLED, world.core.finding
    assert pushes(world)


@pytest.mark.parametrize("held_s", [0.05, 0.1, 0.19])
@pytest.mark.parametrize("speed", [0.05, 0.3])
def test_a_kerb_that_holds_the_wheels_for_a_moment_is_no_stall(held_s: float, speed: float) -> None:
    world = World()
    world.drive(Twist2D(speed, 0.0), 1.0)
    for sides in (("left",), ("right",), ("left", "right")):
        block(world, *sides, force_n=200.0)
        world.run(held_s)
        block(world, *sides, force_n=0.0)
        world.run(1.0)
    assert world.core.state is DriverState.ENABLED, world.core.finding


def test_reversals_at_the_full_acceleration_with_double_payload_are_no_stall() -> None:
    world = loaded(0.0)
    greatest = 0.0
    for n in range(8):
        world.command = Twist2D(0.5 if n % 2 else -0.5, 0.0)
        for _ in range(round(0.7 / STEP_S)):
            world.run(STEP_S)
            greatest = max(greatest, *(axis.stall.time_s for axis in world.core._drives.axes))
    assert world.core.state is DriverState.ENABLED, world.core.finding
    assert greatest <= 0.05
