"""A sensor that lies while one part of the computer is missing: who is left has to look for itself.

In virtual time: real driver core, real watchdog, simulated drives of the bench (90 N at the rim, 18 kg a wheel).
"""

from __future__ import annotations

import pytest

from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim import faults
from canbase_sim.cia402.states import State
from support.chain_world import STEP_S, World, world_of
from support.crews import robot_with
from support.watchdog_story import Story

CAUSE_STANDS, DONE = 2, 1


def suffer(world: World, kind: str) -> None:
    faults.apply(world.bench.nodes, 1, kind, world.now_s, {})


def peak_mps(world: World, seconds: float) -> float:
    peak = 0.0
    end = world.now_s + seconds
    while world.now_s < end:
        world.run(STEP_S)
        peak = max(peak, abs(world.truth.v_left_mps), abs(world.truth.v_right_mps))
    return peak


# 0.00 the watchdog dies ── 0.05 the encoder counts backward ── 0.3 its drive misses the heartbeat, and brakes by it:
# faster and faster, pre-operational, without a TPDO ── the driver reads its speed by SDO, and takes the power
@pytest.mark.parametrize("kind", ["epos4", "elmo_gold", "tmcm1636"])
@pytest.mark.parametrize("fault", ["encoder_reversed", "encoder_frozen"])
def test_a_drive_that_brakes_by_a_lying_sensor_without_watchdog_is_seen_by_the_driver(kind: str, fault: str) -> None:
    world = world_of(kind)
    world.drive(Twist2D(0.2, 0.0), 1.0)
    world.watchdog = None
    world.run(0.05)
    suffer(world, fault)
    assert peak_mps(world, 1.0) < 1.8
    assert not world.powered[0]
    assert world.core.state in (DriverState.STOPPING, DriverState.LATCHED)


# 0.0 driver and watchdog die ── 0.14 the encoder freezes at 0.05 m/s ── 0.3 the drives brake: one of them pushes on
# ── 0.5 both start, latched, and the driver boots: neither waits for a wheel that does not get slower
@pytest.mark.parametrize("speed", [0.05, 0.3])
def test_a_drive_that_is_found_with_power_after_a_restart_has_to_get_slower(speed: float) -> None:
    world = World(robot_with("epos4"), keeps=True)
    world.drive(Twist2D(speed, 0.0), 1.0)
    world.driver = world.watchdog = None
    world.run(0.14)
    suffer(world, "encoder_frozen")
    world.run(0.36)
    assert world.powered[0]
    world.start_watchdog()
    world.start_driver()
    assert world.run(0.5, lambda: not world.powered[0])


@pytest.mark.parametrize("alone", ["driver", "watchdog"])
def test_either_of_them_does_that_alone(alone: str) -> None:
    world = World(robot_with("epos4"), keeps=True)
    world.drive(Twist2D(0.05, 0.0), 1.0)
    world.driver = world.watchdog = None
    world.run(0.14)
    suffer(world, "encoder_frozen")
    world.run(0.36)
    assert world.powered[0]
    if alone == "driver":
        world.start_driver()
    else:
        world.start_watchdog()
    assert world.run(1.0, lambda: not world.powered[0])


# the driver dies ── stopped ── 2 s later somebody pushes the base, whose drives nobody asks for TPDOs any more
def test_a_wheel_that_rolls_after_its_stop_keeps_a_reset_away() -> None:
    story = Story()
    story.run(0.4)
    story.drive_at(300)
    story.driver = False
    story.run(2.0)
    for drive in story.drives:
        drive.brakes = False
        drive.speed[0] = 200.0
    story.run(0.7)
    story.heartbeat = story.driver = True
    story.sync = False
    story.run(0.1)
    assert story.reset(1) == CAUSE_STANDS
    for drive in story.drives:
        drive.speed[0] = 0.0
    story.run(1.2)
    assert story.reset(2) == DONE


def test_a_drive_that_nobody_hears_any_more_keeps_a_reset_away() -> None:
    story = Story()
    story.run(0.4)
    story.drive_at(300)
    story.filter = False
    story.run(1.0)
    story.filter, story.sync = True, False
    story.drives[0].mute = True
    story.run(1.7)
    assert story.reset(1) == CAUSE_STANDS
    story.drives[0].mute = False
    story.run(0.8)
    assert story.reset(2) == DONE


# a boot reads and writes other objects: its SDO channel is not used meanwhile
def test_a_drive_that_is_being_configured_is_not_read() -> None:
    story = Story()
    story.run(0.4)
    story.drive_at(300)
    story.driver = False
    story.run(1.5)
    for _ in range(20):
        story.watchdog.on_frame(0x601, bytes.fromhex("4018100100000000"), story.t)
        story.run(0.1)
    since = story.t - 1.9
    assert story.since(since, 0x601) == []
    assert story.since(since, 0x602)
    story.run(0.7)
    assert story.since(since, 0x601)


# 0.0 the watchdog dies ── 0.3 the drives brake, pre-operational; one encoder freezes ── 0.36 a new watchdog, latched of
# before: the driver leaves the drives to it, and it must not leave them to the driver
def test_a_watchdog_that_is_back_does_not_wait_for_a_driver_that_waits_for_it() -> None:
    world = World(robot_with("elmo_gold"), keeps=True)
    world.drive(Twist2D(0.3, 0.0), 1.0)
    world.watchdog = None
    world.run(0.3, lambda: not all(axis.state is State.OPERATION_ENABLED for axis in world.node.axes[:1]))
    world.run(0.03)
    suffer(world, "encoder_frozen")
    world.run(0.05)
    world.start_watchdog()
    assert world.core.state is DriverState.STOPPING
    assert world.powered[0]
    assert world.run(0.5, lambda: not world.powered[0])
