"""Drives of every kind that come and go while the base drives: booted again, disarmed, and the pose without a jump."""

from __future__ import annotations

import itertools

import pytest

from canbase_driver.cia301.nmt import NmtState
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.faults import apply
from support.chain_world import FORWARD, World, world_of

LOSSES = ["power_cycle", "reset_node", "bus_off", "extra_boot_up"]


def driving(kind: str) -> World:
    world = world_of(kind)
    world.drive(seconds=0.5)
    return world


def run_with_poses(world: World, seconds: float) -> list[float]:
    """How far the pose moves in each 10 ms, distance and turn [m, rad]."""
    poses = [world.snapshot]
    for _ in range(round(seconds / 0.01)):
        world.run(0.01)
        poses.append(world.snapshot)
    return [
        abs(b.odometry.pose.x_m - a.odometry.pose.x_m)
        + abs(b.odometry.pose.y_m - a.odometry.pose.y_m)
        + abs(b.odometry.pose.yaw_rad - a.odometry.pose.yaw_rad)
        for a, b in itertools.pairwise(poses)
    ]


@pytest.mark.parametrize("loss", LOSSES)
def test_a_drive_that_comes_back_is_booted_again_stays_disarmed_and_waits_for_a_reset(kind: str, loss: str) -> None:
    """t   0  0.3 m/s: the drive is lost ── base stands ── 4.0  booted, no power ── reset ── drives again

    After a power cycle the encoder counts anew, so it has not shown how the wheel stopped: the watchdog waits until it
    must have rolled out (10 s).
    """
    world = driving(kind)
    apply(world.bench.nodes, 1, loss, world.now_s, {})
    steps = run_with_poses(world, 12.5 if loss == "power_cycle" else 4.0)
    assert max(steps) < FORWARD.linear_mps * 0.01 * 1.5 + 0.01
    assert world.truth.standing_s > 1.0
    assert world.core.state is DriverState.LATCHED
    if (
        not world.is_guarded
    ):  # the watchdog withholds its requests until the reset, and a guarded drive reports nothing else
        assert [drive.nmt_state for drive in world.snapshot.drives] == [NmtState.OPERATIONAL] * 2
    assert not any(world.powered)
    assert world.recovered()


def test_an_adapter_that_is_unplugged_for_a_while(kind: str) -> None:
    """t   0  unplugged: drives and watchdog stop the base ── 3.0  plugged in ── 6.0  booted, no power ── reset"""
    world = driving(kind)
    world.cable = False
    steps = run_with_poses(world, 3.0)
    assert world.truth.standing_s > 0.5
    assert world.core.finding.cause.value == "bus failed"
    world.cable = True
    steps += run_with_poses(world, 3.0)
    assert max(steps) < FORWARD.linear_mps * 0.01 * 1.5 + 0.01
    assert world.core.state is DriverState.LATCHED
    assert not any(world.powered)
    assert world.recovered()


def test_a_power_cycle_at_a_stand_costs_nothing_of_the_pose(kind: str) -> None:
    """The encoder shows other counts after it; nobody has moved."""
    world = driving(kind)
    world.command = Twist2D.ZERO
    world.run(1.5)
    before = world.snapshot
    world.node.power_cycle(world.now_s)
    world.run(5.0)
    assert world.recovered()
    world.command = Twist2D.ZERO
    world.run(1.5)
    after, truth = world.snapshot, world.truth
    assert after.odometry.valid
    assert after.odometry.pose.x_m > before.odometry.pose.x_m + 0.1
    assert (after.odometry.pose.x_m, after.odometry.pose.y_m, after.odometry.pose.yaw_rad) == pytest.approx(
        (truth.x_m, truth.y_m, truth.yaw_rad), abs=0.02
    )
