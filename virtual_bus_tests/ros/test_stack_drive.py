"""The whole stack, driven by commands as a person types them: where the robot really goes, and what holds it still."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

import pytest
from canbase.msg import DriverStatus
from geometry_msgs.msg import TwistStamped

from support.running_robot import RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]


@pytest.fixture(scope="module")
def robot() -> Iterator[RunningRobot]:
    with own_domain() as domain, robot_on(domain) as robot:
        yield robot


@pytest.mark.parametrize("distance_m", [0.5, -0.5])
def test_a_drive_ends_at_its_distance_by_encoders_and_in_truth_and_stays_there(
    robot: RunningRobot, distance_m: float
) -> None:
    odometry, truth = robot.odometry(), robot.truth()
    command = robot.command("drive", f"{distance_m}", "--speed", "0.3")
    assert robot.exit_code(command) == 0, command.log()
    ended_s = time.monotonic()
    assert robot.moved_since(ended_s, 1.0) < RESTS_M
    ended = robot.truth()
    along_m = (ended.x_m - truth.x_m) * math.cos(truth.yaw_rad) + (ended.y_m - truth.y_m) * math.sin(truth.yaw_rad)
    assert along_m == pytest.approx(distance_m, abs=0.010)
    assert math.dist(odometry, robot.odometry()) == pytest.approx(abs(distance_m), abs=0.005)


def test_a_goal_out_of_range_is_rejected_and_nothing_moves(robot: RunningRobot) -> None:
    before_s = time.monotonic()
    assert robot.run("drive", "100") == 5
    assert robot.moved_since(before_s, 0.5) < RESTS_M


def test_ctrl_c_cancels_and_the_base_stands_when_the_command_ends(robot: RunningRobot) -> None:
    start = robot.truth()
    command = robot.command("drive", "3.0", "--speed", "0.3")
    robot.wait_speed(0.25)
    command.interrupt()
    assert robot.exit_code(command) == 3, command.log()
    assert robot.moved_since(time.monotonic(), 1.0) < RESTS_M
    assert 0.05 < robot.truth().travel_m - start.travel_m < 2.5


def test_without_a_server_there_is_an_exit_code_of_its_own(robot: RunningRobot) -> None:
    nowhere = ("--wait", "1", "--namespace", "nobody_is_here")
    commands = [robot.command(*words, *nowhere) for words in (("drive", "0.5"), ("stop",))]
    assert [robot.exit_code(command) for command in commands] == [6, 6]


def test_canbase_stop_holds_the_robot_until_canbase_reset(robot: RunningRobot) -> None:
    command = robot.command("drive", "3.0", "--speed", "0.3")
    robot.wait_speed(0.25)
    assert robot.run("stop") == 0
    assert robot.exit_code(command) == 4
    assert "DRIVE_FAULT" in command.log()
    robot.wait_state(DriverStatus.LATCHED)
    robot.wait_standing()

    latched_s = time.monotonic()
    assert robot.run("drive", "0.3") == 5  # not even accepted
    assert robot.moved_since(latched_s, 1.0) < RESTS_M

    assert robot.run("reset") == 0
    robot.wait_enabled()
    assert robot.moved_since(latched_s, 1.0) < RESTS_M
    assert robot.run("drive", "0.1") == 0


def test_a_reset_is_refused_while_a_source_orders_a_velocity(robot: RunningRobot) -> None:
    joystick = robot.node.source()
    assert robot.run("stop") == 0
    robot.wait_state(DriverStatus.LATCHED)
    robot.wait_standing()

    held_s = time.monotonic()
    joystick.message = TwistStamped()
    joystick.message.twist.linear.x = 0.2
    robot.node.spin_for(0.5)
    refused = robot.command("reset")
    assert robot.exit_code(refused) == 1
    assert "joystick orders a velocity" in refused.log()
    assert robot.moved_since(held_s, 1.0) < RESTS_M

    joystick.message = None
    robot.make_ready()
    assert robot.moved_since(held_s, 1.0) < RESTS_M
