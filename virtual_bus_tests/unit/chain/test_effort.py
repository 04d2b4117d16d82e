"""Torque that the drives report, at the wheel: the right motor of the bench is mounted mirrored."""

from __future__ import annotations

import math

import pytest

from canbase_driver.motion.kinematics import Twist2D
from support.chain_world import World, bench_robot

RATED_NM, GEAR = 0.5, 20.0


def world_with(rated_torque_nm: float | None) -> World:
    robot = bench_robot()
    drives = tuple(drive.model_copy(update={"rated_torque_nm": rated_torque_nm}) for drive in robot.drives)
    return World(robot.model_copy(update={"drives": drives}))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_both_wheels_have_a_positive_effort_forward_and_a_negative_one_backward(sign: float) -> None:
    """0 s order 0.5 m/s ── 0.3 s gains speed ── 2 s drives, against friction."""
    world = world_with(RATED_NM)
    for duration_s in (0.3, 1.7):
        world.drive(Twist2D(sign * 0.5, 0.0), duration_s)
        for drive in world.snapshot.drives:
            assert sign * drive.torque_share > 0.02
            assert math.isclose(drive.effort_nm, drive.torque_share * RATED_NM * GEAR)


def test_without_a_rated_torque_there_is_no_effort() -> None:
    world = world_with(None)
    world.drive(Twist2D(0.5, 0.0), 0.3)
    assert all(math.isnan(drive.effort_nm) and drive.torque_share > 0.02 for drive in world.snapshot.drives)
