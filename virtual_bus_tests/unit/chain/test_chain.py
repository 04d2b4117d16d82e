"""The whole chain in virtual time: from power on to turning wheels, commands that end, stops that are asked for."""

from __future__ import annotations

import math

import pytest

from canbase_base.latch_record import Mark
from canbase_driver.causes import DriverCause
from canbase_driver.drives.release_test import RETURN_S
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.supervision.lifecycle import Aim
from canbase_runtime.driver_state import DriverState
from canbase_sim.cia402.axis import Supply
from support.chain_world import BOOTED_S, FORWARD, STEP_S, World, setpoints, world_of

ENABLE_OPERATION, VL_RAMP = 0x0F, 0x70
CYCLES_MISSED = {True: 1, False: 60}
"""Of 300, in which no new feedback came: of drives that answer SYNC, and of those that go by a timer of their own."""


@pytest.fixture
def world(kind: str) -> World:
    return world_of(kind)


def words(world: World) -> set[int]:
    """Every controlword that the driver has sent, without the bits of an inverter's ramp."""
    return {word & ~VL_RAMP for frames in world.ticks for word, _ in setpoints(frames)}


def test_from_power_on_to_operation_enabled_takes_less_than_a_second_and_a_half(world: World) -> None:
    assert world.run_until(DriverState.ENABLED, BOOTED_S) > 0.1
    assert world.powered == [True, True]
    assert not world.core.stops


def test_without_a_watchdog_nothing_gets_power_and_the_status_says_why(world: World) -> None:
    watchdog, world.watchdog = world.watchdog, None
    world.run_until(DriverState.BOOTING if world.is_guarded else DriverState.DISARMED, BOOTED_S)
    world.run(1.0)
    missing = ("watchdog missing", "the watchdog alive")
    waits = ("booting", "drives booted") if world.is_guarded else missing
    assert (world.core.finding.cause.value, world.core.finding.clears_on) == waits
    assert ENABLE_OPERATION not in words(world)
    world.watchdog = watchdog  # nothing had moved: it goes on by itself
    world.run_until(DriverState.ENABLED, within_s=4.0 if world.is_guarded else 1.0)


def test_a_watchdog_that_has_tripped_before_the_start_needs_a_reset_and_power_comes_only_after_its_end() -> None:
    world = World()
    world.drive()
    world.kill_driver()
    world.run(1.0)
    world.start_driver()
    world.command = Twist2D.ZERO
    world.run_until(DriverState.LATCHED, within_s=1.5)
    world.run(0.5)
    assert (world.core.finding.cause.value, world.core.finding.detail) == (
        "watchdog tripped",
        "watchdog: driver silent",
    )
    assert ENABLE_OPERATION not in words(world)
    outcome = world.reset()
    assert outcome.done, outcome.sentence
    assert ENABLE_OPERATION not in words(world)
    world.run_until(DriverState.ENABLED, within_s=0.5)


def test_a_velocity_that_is_commanded_keeps_the_power_off(world: World) -> None:
    world.command = FORWARD
    world.run_until(DriverState.DISARMED, BOOTED_S)
    world.run(1.0)
    assert world.core.finding.cause.value == "command not zero"
    assert world.core.finding.detail == "cmd_vel orders 0.300 m/s, 0.000 rad/s"
    assert ENABLE_OPERATION not in words(world)
    world.command = Twist2D.ZERO
    world.run_until(DriverState.ENABLED, within_s=0.5)


def test_after_each_enable_nothing_is_followed_before_a_zero_was_seen(world: World) -> None:
    world.command = None
    world.run_until(DriverState.ENABLED, BOOTED_S)
    world.command = FORWARD  # the first command ever
    world.run(0.5)
    assert world.truth.path_m == 0.0
    world.command = Twist2D.ZERO
    world.run(0.05)
    world.command = FORWARD
    world.run(0.8)
    assert world.truth.linear_mps == pytest.approx(0.3, abs=0.005)
    world.core.request_stop()
    world.command = None
    world.run_until(DriverState.LATCHED, within_s=1.0)
    assert world.reset().done
    world.run_until(DriverState.ENABLED, within_s=0.5)
    way_m = world.truth.path_m
    world.command = FORWARD
    world.run(0.5)
    assert world.truth.path_m == way_m


def test_the_frame_that_enables_has_a_zero_target_and_so_has_every_one_before_it(world: World) -> None:
    world.enable()
    targets = {target for frames in world.ticks for _, target in setpoints(frames)}
    assert ENABLE_OPERATION in words(world)
    assert targets == {0}


def test_it_drives_to_and_fro_and_the_odometry_is_what_the_robot_did(world: World) -> None:
    world.drive(Twist2D(0.4, 0.0), seconds=1.5)
    cycles, samples = world.snapshot.cycle.cycles, world.core.odometry_serial
    world.command = Twist2D(-0.3, 0.0)
    world.run(2.0)
    world.command = Twist2D.ZERO
    world.run(1.0)
    truth, snapshot = world.truth, world.snapshot
    assert truth.path_m > 0.8
    assert snapshot.odometry.pose.x_m == pytest.approx(truth.x_m, abs=1e-4)
    missed = CYCLES_MISSED[world.robot.drives[0].kind.pdo.synchronous]
    assert world.core.odometry_serial - samples == pytest.approx(snapshot.cycle.cycles - cycles, abs=missed)
    assert snapshot.standstill
    assert truth.linear_mps == 0.0


def test_the_curvature_is_kept_from_the_first_motion_to_the_stand(world: World) -> None:
    world.drive(Twist2D(0.4, 0.4), seconds=1.5)  # an arc of radius 1 m
    world.command = Twist2D.ZERO
    world.run(1.0)
    truth = world.truth
    assert truth.travel_m > 0.4
    assert math.hypot(truth.x_m - math.sin(truth.yaw_rad), truth.y_m - 1.0 + math.cos(truth.yaw_rad)) < 0.01
    moving = [(left, right) for left, right in world.targets_mps() if left + right > 0.02]
    assert len(moving) > 100
    # half the track times the curvature: (right − left) / (right + left) = 0.25
    assert [(right - left) / (right + left) for left, right in moving] == pytest.approx([0.25] * len(moving), abs=0.01)


def test_a_command_that_ends_counts_for_200_ms_then_the_base_ramps_down_stays_enabled_and_holds_zero(
    world: World,
) -> None:
    world.drive()
    world.command = None  # lost on the way to the driver; the filter and its leases are well
    world.run(0.18)
    assert world.targets_mps()[-1] == pytest.approx((0.3, 0.3), abs=1e-4)
    world.run(0.06)
    assert 0.2 < world.targets_mps()[-1][0] < 0.3
    assert 0.25 < world.stands_after() < 0.4
    assert world.core.state is DriverState.ENABLED
    assert world.targets_mps()[-1] == (0.0, 0.0)
    world.command = FORWARD
    world.run(0.8)
    assert world.truth.linear_mps == pytest.approx(0.3, abs=0.005)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_refused_and_counted_and_does_not_refresh_the_command(world: World, bad: float) -> None:
    world.drive()
    world.command = Twist2D(0.0, bad)
    world.run(0.1)
    assert world.snapshot.command.refused == 5
    assert world.truth.linear_mps == pytest.approx(0.3, abs=0.005)  # the last good command still counts
    world.run(1.0)
    assert world.snapshot.command.refused == 55
    assert world.truth.linear_mps == 0.0
    assert world.core.state is DriverState.ENABLED


def test_the_stop_service_ramps_takes_the_power_away_and_latches(world: World) -> None:
    world.drive()
    world.core.request_stop()
    assert 0.3 < world.stands_after() < 0.45
    assert world.core.state is DriverState.LATCHED
    assert world.powered == [False, False]
    (stop,) = world.core.stops
    assert (stop.stopped_by, stop.cause, stop.latched, stop.clears_on) == (
        "motor_driver",
        "stop requested",
        True,
        "reset",
    )
    assert world.recovered()


def test_a_reset_is_refused_while_a_velocity_is_commanded(world: World) -> None:
    world.drive()
    world.core.request_stop()
    world.run_until(DriverState.LATCHED, within_s=1.0)
    outcome = world.reset()
    assert not outcome.done
    assert outcome.sentence.startswith("refused: cmd_vel orders 0.300 m/s")
    assert world.core.state is DriverState.LATCHED


def test_a_reset_is_refused_while_there_is_power(world: World) -> None:
    world.enable()
    outcome = world.reset()
    assert not outcome.done
    assert outcome.sentence == "refused: an enabled robot needs no reset. `canbase stop` takes the power off"
    assert world.core.state is DriverState.ENABLED


def test_a_stop_during_a_reset_breaks_it_off_and_stays_latched(world: World) -> None:
    world.drive()
    world.core.request_stop()
    world.run_until(DriverState.LATCHED, within_s=1.0)
    world.command = Twist2D.ZERO
    world.run(0.1)
    sentences: list[str] = []
    world.core.request_reset(world.now_s, lambda outcome: sentences.append(outcome.sentence))
    world.core.request_stop()
    world.run(1.0)
    assert sentences == ["broken off: service motor_driver/stop"]
    assert world.core.state is DriverState.LATCHED


@pytest.mark.parametrize("seconds", [0.0, 0.05, 0.15, 0.3, 0.38, 0.39, 0.4, 0.41, 1.0])
def test_a_shutdown_at_any_moment_of_the_start_ends_within_half_a_second(world: World, seconds: float) -> None:
    world.run(seconds)
    was_enabled = world.core.state is DriverState.ENABLED
    world.core.request_shutdown()
    assert world.run(0.5, lambda: world.core.finished)
    assert world.powered == [False, False]
    off = {node.node_id for node in world.core._drives.nodes if node.is_off(world.now_s)}
    resets = {frame.data[1] for frame in world.ticks[-1] if frame.cob_id == 0x000 and frame.data[0] == 0x82}
    assert resets <= off  # only who has reported that its power is off; one that was just started has not yet
    assert not was_enabled or resets == {drive.node_id for drive in world.robot.drives}
    assert world.truth.path_m == 0.0


def test_a_shutdown_while_driving_ramps_down_disables_and_leaves_drives_without_an_error(world: World) -> None:
    world.drive()
    world.core.request_shutdown()
    assert world.run(1.0, lambda: world.core.finished)
    assert world.truth.standing_s > 0.0
    assert world.powered == [False, False]
    world.driver = None
    world.run(1.0)
    assert not world.sent(0x081)[1:]
    assert world.watchdog is not None
    assert world.watchdog.status.verdict.detail == ""


@pytest.mark.parametrize("cycles", range(9))
@pytest.mark.parametrize("aim", [None, Aim.CONFIGURED, Aim.RELEASED], ids=["shutdown", "deactivated", "cleaned up"])
def test_an_orderly_end_while_the_drives_let_go_latches_nothing(world: World, aim: Aim | None, cycles: int) -> None:
    """At 0 s the drives let go, get their power back until 0.03 s, and in one of these cycles the end is ordered."""
    world.drive(seconds=0.2)
    world.command = Twist2D.ZERO
    assert world.run(8.0, lambda: world.core.lets_go)
    world.run(cycles * STEP_S)
    if aim is None:
        world.core.request_shutdown()
    else:
        world.core.request_aim(aim, world.now_s, lambda outcome: None)
    world.run(1.5)

    assert world.powered == [False, False]
    assert [stop.cause for stop in world.core.stops if stop.latched] == []
    assert world.core.record.mark is Mark.CLEAR


def test_a_drive_that_fails_after_an_end_and_a_new_start_has_no_excuse_from_before(world: World) -> None:
    """Deactivated while the drives let go, active again within RETURN_S; then STO opens for a moment."""
    world.drive(seconds=0.2)
    world.command = Twist2D.ZERO
    assert world.run(8.0, lambda: world.core.lets_go)
    began_s = world.now_s
    world.core.request_aim(Aim.CONFIGURED, world.now_s, lambda outcome: None)
    world.run_until(DriverState.DISARMED, RETURN_S)
    world.core.request_aim(Aim.ACTIVE, world.now_s, lambda outcome: None)
    world.run_until(DriverState.ENABLED, RETURN_S)
    assert world.powered == [True, True]

    world.node.axes[0].lose(Supply.NO_TORQUE)
    world.node.axes[0].lose(Supply.FULL)
    world.run(1.0)

    assert world.core.state is DriverState.LATCHED
    assert world.core.finding.cause is DriverCause.DRIVE_DISABLED
    assert world.core.stops[-1].at_s - began_s < RETURN_S


def test_a_shutdown_without_a_watchdog_ends_at_once(world: World) -> None:
    world.watchdog = None
    world.run_until(DriverState.BOOTING if world.is_guarded else DriverState.DISARMED, BOOTED_S)
    world.core.request_shutdown()
    assert world.run(0.05, lambda: world.core.finished)


def test_a_shutdown_with_a_drive_that_is_silent_ends_within_its_deadlines(world: World) -> None:
    world.drive()
    world.node.line.silent = True
    world.core.request_shutdown()
    assert world.run(2.5, lambda: world.core.finished)  # 0.1 s until it is silent, 1.5 s quick stop, 0.5 s power off
    assert world.powered == [False, False]


def test_a_shutdown_on_a_dead_bus_ends_within_its_deadlines(world: World) -> None:
    world.drive()
    world.cable = False
    world.run(0.1)
    world.core.request_shutdown()
    assert world.run(2.5, lambda: world.core.finished)
    assert world.truth.standing_s > 0.3
