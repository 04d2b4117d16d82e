"""Another client writes an object by which a drive stops, and the driver sets it again before there is power."""

from __future__ import annotations

import pytest

from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.cia301.dictionary import key
from canbase_sim.world.bench import BenchParameters
from canbase_watchdog.trip_cause import TripCause
from support.chain_world import World, world_of

MONITORED = key(0x1016, 1)
UNMONITORED = "23 16 10 01 00 00 00 00"
FORWARD = Twist2D(0.3, 0.0)


def writes_of(world: World, address: str) -> int:
    """How many requests of node 1 have begun to write this object."""
    return sum(data[1:4] == bytes.fromhex(address) and data[0] >> 5 == 1 for data in world.sent(0x601))


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


# power on ── 1016h:1 is set, and the answer gets lost ── requested again ── 1016h:1 = 0 from elsewhere ── booted anew
@pytest.mark.parametrize("later_s", [0.01, 0.05])
def test_a_request_that_the_boot_had_to_repeat_hides_no_foreign_write(later_s: float) -> None:
    world = World()
    assert world.run(3.0, lambda: monitored(world) != 0)
    before, requests = monitored(world), writes_of(world, "16 10 01")
    world.node.line.forget()
    assert world.run(1.0, lambda: writes_of(world, "16 10 01") > requests), "requested again"
    world.run(later_s)
    assert not world.core.snapshot(world.now_s).drives[0].configured
    world.inject(0x601, UNMONITORED)
    assert monitored(world) == 0
    assert not world.run(3.0, lambda: any(world.powered) and monitored(world) == 0)
    assert (world.core.state, monitored(world)) == (DriverState.ENABLED, before)


# answers after 0.4 s, later than the boot waits: requests are repeated, and answered twice ── booted once, enabled
def test_answers_that_come_late_are_no_foreign_writes() -> None:
    world = World(parameters=BenchParameters(sdo_delay_s=0.4))
    assert world.run(120.0, lambda: world.core.state is DriverState.ENABLED)
    assert len(world.sent(0x000)) == len(set(world.sent(0x000))), "one NMT reset and one start of each drive"


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
