"""A latched stop outlives its process: killed, started again, all of them at once, over a reboot. In virtual time."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from canbase_base.latch_record import Mark
from canbase_campaign.disk import StopDisk
from canbase_driver.core import DriverCore
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import State, Watchdog
from support.chain_world import World

LONG_S = 1.2


def keeping() -> World:
    return World(keeps=True)


def guard(world: World) -> Watchdog:
    assert world.watchdog is not None
    return world.watchdog


def restart_driver(world: World) -> None:
    world.kill_driver()
    world.run(0.5)
    world.start_driver()


def restart_watchdog(world: World) -> None:
    world.watchdog = None
    world.run(0.5)
    world.start_watchdog()


def stays_stopped(world: World) -> None:
    """With a zero command, booted, and then one to move: nothing gets power or moves."""
    begin_m = world.truth.travel_m
    for world.command in (Twist2D.ZERO, Twist2D(0.3, 0.0)):
        assert not world.run(LONG_S, lambda: any(world.powered)), world.core.finding
    assert world.truth.travel_m == pytest.approx(begin_m, abs=1e-4)


# stop at a stand ── 1 s ── SIGKILL ── start ── commands: nothing; reset ── drives again
def test_a_requested_stop_outlives_the_driver() -> None:
    world = keeping()
    world.enable()
    world.core.request_stop()
    world.run_until(DriverState.LATCHED, 1.0)
    world.run(0.1)
    restart_driver(world)
    assert (world.core.state, world.core.finding.cause.value) == (DriverState.LATCHED, "stop requested")
    assert world.core.finding.detail == "latched since before the start: service motor_driver/stop"
    stays_stopped(world)
    restart_driver(world)
    assert world.core.finding.detail == "latched since before the start: service motor_driver/stop"
    assert world.recovered()


def test_a_requested_stop_without_power_outlives_the_driver() -> None:
    world = keeping()
    world.run(0.05)
    world.core.request_stop()
    world.run(0.02)
    restart_driver(world)
    assert world.core.state is DriverState.LATCHED
    stays_stopped(world)
    assert world.recovered()


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("restart", [restart_driver, restart_watchdog, World.reboot])
def test_who_dies_with_power_comes_back_latched(moving: bool, restart: Callable[[World], None]) -> None:
    world = keeping()
    world.enable()
    if moving:
        world.drive()
    restart(world)
    world.command = Twist2D.ZERO
    world.run(0.5)
    if restart is not restart_watchdog:
        assert (world.core.state, world.core.finding.cause.value) == (DriverState.LATCHED, "ended with power")
        assert "killed, crashed" in world.core.finding.detail
    if restart is not restart_driver:
        assert guard(world).status.state is State.TRIPPED
        assert guard(world).status.verdict.cause is TripCause.POWER_AT_END
    stays_stopped(world)
    assert world.recovered()


# another master ── trip ── driver and watchdog both started again, twice ── the same cause
def test_a_trip_outlives_both_processes() -> None:
    world = keeping()
    world.drive()
    world.inject(0x601, "2b 40 60 00 06 00 00 00")  # another master
    world.run(1.0)
    cause = guard(world).status.verdict.cause
    assert guard(world).status.state is State.TRIPPED
    for _ in range(2):
        world.reboot()
        world.run(0.2)
        verdict = guard(world).status.verdict
        assert verdict.cause is cause
        assert verdict.detail.count("since before the start: ") == 1
        assert world.core.state is DriverState.LATCHED
        stays_stopped(world)
    assert world.recovered()


def test_an_orderly_end_leaves_nothing_latched() -> None:
    world = keeping()
    world.drive()
    world.command = Twist2D.ZERO
    world.core.request_shutdown()
    assert world.run(3.0, lambda: world.core.finished)
    world.run(0.3)
    assert not world.disk.found().latched
    assert not world.watchdog_disk.found().latched
    world.reboot()
    world.enable()


def test_a_shutdown_of_a_latched_driver_keeps_its_cause() -> None:
    world = keeping()
    world.enable()
    world.core.request_stop()
    world.run_until(DriverState.LATCHED, 1.0)
    world.core.request_shutdown()
    assert world.run(3.0, lambda: world.core.finished)
    assert (world.disk.found().record.mark, world.disk.found().record.cause) == (Mark.LATCHED, "stop requested")


def test_a_power_off_that_was_never_confirmed_is_no_orderly_end() -> None:
    world = keeping()
    world.enable()
    world.cable = False
    world.core.request_shutdown()
    assert world.run(5.0, lambda: world.core.finished)
    assert world.disk.found().latched


# ── the record on disk says LIVE ── only then power
def test_the_record_says_live_before_any_drive_has_power() -> None:
    world = keeping()
    world.run(3.0, lambda: any(world.powered))
    assert world.disk.found().record.mark is Mark.LIVE
    assert world.watchdog_disk.found().record.mark is Mark.LIVE


@pytest.mark.parametrize("disk", ["driver", "watchdog"])
def test_a_disk_that_cannot_be_written_gives_no_power_and_says_why(disk: str) -> None:
    world = keeping()
    file = world.disk.file if disk == "driver" else world.watchdog_disk.file
    file.writable = False
    assert not world.run(LONG_S, lambda: any(world.powered))
    assert (world.core.state, world.core.finding.cause.value) == (DriverState.DISARMED, "stop record")
    assert "no space left" in world.core.finding.detail or "watchdog's log" in world.core.finding.detail
    file.writable = True
    world.run_until(DriverState.ENABLED, 1.0)


def test_a_disk_that_fails_while_there_is_power_loses_no_latch() -> None:
    world = keeping()
    world.drive()
    world.disk.file.writable = world.watchdog_disk.file.writable = False
    world.core.request_stop()
    world.run(1.5)
    world.disk.file.writable = world.watchdog_disk.file.writable = True
    world.reboot()
    world.run(2.0)
    assert world.core.state is DriverState.LATCHED
    assert guard(world).status.state is State.TRIPPED
    stays_stopped(world)
    assert world.recovered()


def test_a_record_that_cannot_be_read_is_latched_until_a_reset() -> None:
    world = keeping()
    world.enable()
    world.disk.file.data = world.watchdog_disk.file.data = None
    world.disk, world.watchdog_disk = StopDisk("driver", "another"), StopDisk("watchdog", "another")
    stolen = world.disk.file.data, world.watchdog_disk.file.data
    world.disk, world.watchdog_disk = StopDisk("driver"), StopDisk("watchdog")
    world.disk.file.data, world.watchdog_disk.file.data = stolen
    world.reboot()
    world.run(2.0)
    assert (world.core.state, world.core.finding.cause.value) == (DriverState.LATCHED, "stop record unusable")
    assert guard(world).status.verdict.cause is TripCause.RECORD_UNUSABLE
    stays_stopped(world)
    assert world.recovered()


def test_nothing_is_latched_by_a_kill_without_power() -> None:
    world = keeping()
    world.run(0.1)
    world.reboot()
    world.enable()
    world.core.request_shutdown()
    world.run(3.0)
    world.reboot()
    world.enable()


def test_a_watchdog_that_is_tripped_from_the_start_leaves_the_boot_alone() -> None:
    world = keeping()
    world.enable()
    world.reboot()
    start = world.now_s
    world.run(1.5)
    assert all(each.data[0] != 0x80 for at, each in world.log if each.cob_id == 0x000 and at > start + 1.0)
    assert world.recovered()


def test_a_core_without_a_record_has_nothing_to_keep() -> None:
    core = DriverCore(World().robot)
    assert core.state is DriverState.BOOTING


@pytest.mark.parametrize("before_s", [0.0, 0.05, 2.0])
@pytest.mark.parametrize("stop_first", [True, False])
def test_a_stop_in_the_last_cycle_before_the_end_is_not_forgotten(before_s: float, stop_first: bool) -> None:
    """The service has answered that nothing moves until a reset; SIGTERM comes in the same 10 ms, with power or not."""
    world = keeping()
    world.run(before_s)
    requests = [world.core.request_stop, world.core.request_shutdown]
    for request in requests if stop_first else reversed(requests):
        request()
    world.run(1.0)
    assert world.core.finished
    restart_driver(world)
    assert (world.core.state, world.core.finding.cause.value) == (DriverState.LATCHED, "stop requested")
    stays_stopped(world)
    assert world.recovered()
