"""Another client writes an object by which a drive stops, and the driver sets it again before there is power."""

from __future__ import annotations

import pytest

from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.cia301.dictionary import key
from canbase_watchdog.trip_cause import TripCause
from support.chain_world import World, world_of

MONITORED = key(0x1016, 1)
UNMONITORED = "23 16 10 01 00 00 00 00"
FORWARD = Twist2D(0.3, 0.0)


def monitored(world: World) -> int:
    """1016h:1 of the left drive; 0: no heartbeat."""
    return int(world.node.dictionary.values[MONITORED])


# 0.3 m/s ── 1016h:1 = 0 from elsewhere ── trip ── standstill ── booted anew ── reset ── power, and monitored again
def test_after_a_stop_the_drive_is_configured_anew_before_a_reset_gives_it_power() -> None:
    world = World()
    world.drive(FORWARD, seconds=1.2)
    before = monitored(world)
    assert before
    world.inject(0x601, UNMONITORED)
    assert monitored(world) == 0
    world.command = Twist2D.ZERO
    world.run(2.0)
    assert world.watchdog is not None
    assert world.watchdog.status.verdict.cause is TripCause.FOREIGN_MASTER
    assert world.reset().done
    world.run(3.0, lambda: world.core.state is DriverState.ENABLED)
    assert (world.core.state, monitored(world)) == (DriverState.ENABLED, before)


def write_block(world: World, head: str, data: str) -> None:
    """An SDO block download of one segment (CiA 301): it begins, the data, its end."""
    unused = 7 - len(bytes.fromhex(data))
    for frame in (f"C2 {head} 04 00 00 00", f"81 {data}" + " 00" * unused, f"{0xC1 | unused << 2:02X}" + " 00" * 7):
        world.inject(0x601, frame)
        world.run(0.01)


# 0.3 m/s ── 1016h:1 = 0 in a block ── trip ── standstill ── booted anew, monitored again before a reset gives power
def test_a_write_in_a_block_is_one_as_well() -> None:
    world = World()
    world.drive(FORWARD, seconds=1.2)
    before = monitored(world)
    write_block(world, "16 10 01", "00 00 00 00")
    assert monitored(world) == 0
    assert world.watchdog is not None
    assert world.watchdog.status.verdict.cause is TripCause.FOREIGN_MASTER
    world.command = Twist2D.ZERO
    world.run(3.0)
    assert not any(world.powered)
    assert monitored(world) == before


# standstill, enabled ── 604Ch:1 = 10: each order would turn the wheel ten times as fast ── trip, before any order
def test_the_factor_of_the_speeds_of_mode_2_is_nobody_elses() -> None:
    world = world_of("inverter")
    world.enable()
    world.inject(0x601, "23 4C 60 01 0A 00 00 00")
    world.run(0.01)
    assert world.watchdog is not None
    assert world.watchdog.status.verdict.cause is TripCause.FOREIGN_MASTER
    assert "an SDO that writes 604Ch" in world.watchdog.status.verdict.detail


# power on ── 1016h:1 is set ── the boot goes on, 1016h:1 = 0 from elsewhere ── booted anew before there is any power
@pytest.mark.parametrize("later_s", [0.01, 0.05])
def test_a_write_during_the_boot_is_undone_before_there_is_power(later_s: float) -> None:
    world = World()
    assert world.run(3.0, lambda: monitored(world) != 0)
    before = monitored(world)
    world.run(later_s)
    assert not world.core.snapshot(world.now_s).drives[0].configured
    world.inject(0x601, UNMONITORED)
    assert monitored(world) == 0
    assert not world.run(3.0, lambda: any(world.powered) and monitored(world) == 0)
    assert (world.core.state, monitored(world)) == (DriverState.ENABLED, before)


# latched, no power ── 1016h:1 = 0 from elsewhere: no trip, nothing has power ── booted anew ── reset ── monitored again
def test_a_write_while_there_is_no_power_is_undone_as_well() -> None:
    world = World()
    world.drive(FORWARD, seconds=1.2)
    before = monitored(world)
    world.core.request_stop()
    world.command = Twist2D.ZERO
    world.run(2.0)
    assert not any(world.powered)
    world.inject(0x601, UNMONITORED)
    world.run(3.0)
    assert monitored(world) == before
    assert world.reset().done
    world.run(3.0, lambda: world.core.state is DriverState.ENABLED)
    assert (world.core.state, monitored(world)) == (DriverState.ENABLED, before)
