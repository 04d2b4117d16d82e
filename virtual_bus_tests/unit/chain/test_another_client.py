"""Another client writes an object by which a drive stops, and the driver sets it again before there is power."""

from __future__ import annotations

from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.cia301.dictionary import key
from canbase_watchdog.trip_cause import TripCause
from support.chain_world import World

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
