"""Nav2's behaviours on a few bases and goals of benchmarks/behaviors.py, driven by canbase and by Nav2's loops."""

from __future__ import annotations

import pytest

from accuracy import cases
from behaviors import STRAIGHT, TURNS, LimitedSpeed, Measured, Nav2Spin, angles, straight, table, turn
from canbase_action_server.along_track import BasePose
from canbase_action_server.inputs import Odometry
from canbase_action_server.motion import STOP
from canbase_config.load import load_robot, sample

ROBOT = load_robot(sample("bench")).robot
OURS_M, OURS_RAD = 0.003, 0.006
"""The budgets of canbase's own actions: 3 mm, for the wheels of a turn 1.2 mm."""
AT_START = Odometry(0.0, BasePose(0.0, 0.0, 0.0), 0.0, 0.0)


@pytest.mark.parametrize("number", range(6))
def test_canbase_ends_a_straight_goal_of_nav2_within_its_budget_and_nothing_moves_after_the_result(number: int) -> None:
    measured = straight(ROBOT, cases(ROBOT, 6)[number], STRAIGHT["drive_on_heading of canbase"])
    assert abs(measured.error) <= OURS_M
    assert measured.after <= 0.0002


@pytest.mark.parametrize("number", range(6))
def test_canbase_ends_a_spin_of_nav2_within_its_budget_and_nothing_moves_after_the_result(number: int) -> None:
    measured = turn(ROBOT, cases(ROBOT, 6)[number], angles(6)[number], TURNS["spin of canbase"])
    assert abs(measured.error) <= OURS_RAD
    assert measured.after <= 0.001


@pytest.mark.parametrize("name", ["DriveOnHeading, Nav2 jazzy", "DriveOnHeading, Nav2 main"])
def test_a_straight_loop_of_nav2_goes_beyond_its_goal_after_its_result(name: str) -> None:
    measured = straight(ROBOT, cases(ROBOT, 1)[0], STRAIGHT[name])
    assert measured.error > 0.01
    assert measured.after > 0.01


def test_the_spin_of_nav2_turns_beyond_its_goal() -> None:
    measured = turn(ROBOT, cases(ROBOT, 1)[0], 1.57, TURNS["Spin, Nav2 jazzy and main"])
    assert measured.error > 0.03


def test_the_loop_of_the_branch_main_speeds_up_by_its_limit_slows_down_and_keeps_its_minimum() -> None:
    loop = LimitedSpeed(AT_START, -2.0, 0.4)
    at = [Odometry(0.1, BasePose(-x_m, 0.0, 0.0), 0.0, 0.0) for x_m in (0.0, 0.1, 1.99, 1.9999, 2.0)]
    speeds = [loop.cycle(odometry, 0.1)[0].linear_mps for odometry in at[:4]]
    assert speeds == [-0.25, -0.4, pytest.approx(-((2 * 2.5 * 0.01) ** 0.5)), -0.1]
    assert loop.cycle(at[4], 0.5) == (STOP, True)


def test_the_spin_of_nav2_counts_more_than_half_a_turn() -> None:
    loop = Nav2Spin(AT_START, 4.0)
    for yaw_rad in (1.5, 3.0, -2.3):
        twist, ends = loop.cycle(Odometry(0.1, BasePose(0.0, 0.0, yaw_rad), 0.0, 0.0), 0.1)
    assert (twist.angular_radps, ends) == (0.4, False)  # turned by 3.98
    assert loop.cycle(Odometry(0.1, BasePose(0.0, 0.0, -2.2), 0.0, 0.0), 0.1) == (STOP, True)


def test_the_table_has_the_unit_of_its_values() -> None:
    assert "| one | 2.0 | 2.0 | 2.0 | 0.5 | 0.5 | 0.5 | 1.0 |" in table(
        {"one": [Measured(-0.002, 0.0005, 1.0)]}, 1e3, "mm"
    )
