"""A watchdog that comes back over drives that still turn, and one that hears nothing any more. The whole chain."""

from __future__ import annotations

import pytest

from canbase_config.robot import Robot
from canbase_runtime.driver_state import DriverState
from canbase_sim.faults import apply
from canbase_watchdog.frames import Frame
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import State, Watchdog
from support.chain_world import FORWARD, World
from support.crews import robot_with


def watchdog_of(world: World) -> Watchdog:
    assert world.watchdog is not None
    return world.watchdog


def lost_its_computer(kind: str) -> World:
    """At 0.3 m/s the computer loses its supply for 0.6 s, and only the watchdog comes back."""
    world = World(robot_with(kind), keeps=True)
    world.drive(FORWARD, 0.4)
    world.driver = world.watchdog = None
    world.run(0.6)
    world.start_watchdog()
    return world


@pytest.mark.parametrize("kind", ["dryve_d1", "tmcm1636"])
def test_a_watchdog_alone_stops_drives_that_went_on_without_their_masters(kind: str) -> None:
    """They do not stop by themselves, and no SYNC makes them tell anything: they turned on until a driver came."""
    world = lost_its_computer(kind)
    assert world.truth.linear_mps > 0.2
    assert world.run(3.0, lambda: world.truth.standing_s > 0.1 and watchdog_of(world).status.settled)
    assert not any(world.powered)
    status = watchdog_of(world).status
    assert (status.state, status.verdict.cause) == (State.TRIPPED, TripCause.POWER_AT_END)


# 0 s both die ── 0.65 s an encoder freezes ── 0.7 s the drives miss them: quick stop, pre-operational; one runs away
# ── 0.75 s the watchdog starts ── 1.1 s no heartbeat of a driver: it reads the drive ── 1.17 s power off
def test_a_drive_that_left_operational_by_itself_and_runs_away_is_read_when_no_driver_can_boot_it() -> None:
    values = robot_with("generic").model_dump()
    values["timeouts"]["drive_heartbeat_s"] = 0.7
    world = World(Robot.model_validate(values), keeps=True)
    world.drive(FORWARD, 0.4)
    world.driver = world.watchdog = None
    world.run(0.65)
    apply(world.bench.nodes, 1, "encoder_frozen", world.now_s, {})
    world.run(0.1)
    world.start_watchdog()
    assert world.powered[0]
    assert world.run(0.45, lambda: not any(world.powered))


def test_it_leaves_the_sdo_channel_to_a_driver_that_is_there() -> None:
    """The driver's boot makes them tell: a drive answers one request at a time."""
    world = lost_its_computer("generic")
    watchdog, asked = watchdog_of(world), list[Frame]()
    tick = watchdog.tick

    def tick_and_note(now_s: float) -> list[Frame]:
        frames = tick(now_s)
        asked.extend(frame for frame in frames if frame.cob_id in (0x601, 0x602))
        return frames

    watchdog.tick = tick_and_note  # type: ignore[method-assign]
    world.bench.nodes[2].line.deaf = True  # so that its boot takes long
    world.start_driver()
    world.run(1.5)
    assert asked == []


def test_a_boot_beside_the_stop_of_the_watchdog_succeeds_at_once() -> None:
    """Both stop the drives by SDO. Their requests for one object once looked like two drives with one node id."""
    world = World(keeps=True)
    world.drive(FORWARD, 0.4)
    world.reboot(0.2)
    assert world.truth.linear_mps > 0.2
    assert world.run(0.6, lambda: world.core._drives.are_ready)


def test_a_drive_that_is_known_to_be_off_is_looked_at_now_and_then() -> None:
    """Each 0.5 s three readings, and no writing: a wheel may be pushed."""
    world = lost_its_computer("generic")
    world.run(2.0)
    assert watchdog_of(world).status.settled
    since = world.now_s
    world.run(1.2)
    for asked in (world.sent(0x601, since), world.sent(0x602, since)):
        assert {data[0] for data in asked} == {0x40}
        assert 3 <= len(asked) <= 9


def test_a_watchdog_that_hears_nothing_is_no_watchdog() -> None:
    """It goes deaf while one drive waits for its STO; then the STO closes. It said that it watched, and power came."""
    world = World(keeps=True)
    apply(world.bench.nodes, 2, "sto", world.now_s, {})
    world.run(1.2)
    assert watchdog_of(world).status.armed
    watchdog_of(world).on_frame = lambda *_: None  # type: ignore[method-assign]
    world.run(0.4)
    assert not watchdog_of(world).status.armed
    apply(world.bench.nodes, 2, "heal", world.now_s, {})
    world.run(1.0)
    assert world.core.state is DriverState.DISARMED
    assert world.core.finding.cause.value == "stop record"
    assert not any(world.powered)
