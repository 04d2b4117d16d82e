"""Two robots in two namespaces of one ROS domain on one machine: each obeys its own topics and its own bus alone."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from canbase.msg import DriverStatus
from geometry_msgs.msg import TwistStamped

from support.running_robot import RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

Pair = dict[str, RunningRobot]


@pytest.fixture(scope="module")
def robots() -> Iterator[Pair]:
    with (
        own_domain() as domain,
        robot_on(domain, namespace="robot1") as one,
        robot_on(domain, namespace="robot2") as two,
    ):
        yield {"robot1": one, "robot2": two}


def test_a_goal_moves_the_robot_of_its_namespace_alone(robots: Pair) -> None:
    driven, idle = robots["robot1"], robots["robot2"]
    orders = idle.node.record(TwistStamped, "cmd_vel")
    before, idle_odometry, began_s = driven.truth(), idle.odometry(), time.monotonic()
    words = ("drive", "0.15", "--speed", "0.1", "--namespace", "robot1")  # slow: two robots load the computer
    command = driven.command(*words)
    assert driven.exit_code(command) == 0, command.log()
    assert driven.truth().travel_m - before.travel_m == pytest.approx(0.15, abs=0.010)
    assert idle.moved_since(began_s, 1.0) < RESTS_M
    assert idle.odometry() == pytest.approx(idle_odometry, abs=RESTS_M)
    idle.node.wait_for(lambda: orders.messages, 10.0, "orders to the idle robot")
    assert all(order.twist.linear.x == 0.0 for order in orders.messages)


def test_a_joystick_moves_the_robot_of_its_namespace_alone(robots: Pair) -> None:
    driven, idle = robots["robot2"], robots["robot1"]
    joystick = driven.node.source()
    began_s = time.monotonic()
    joystick.message = TwistStamped()
    joystick.message.twist.angular.z = 0.5
    driven.node.wait_for(lambda: driven.truth().angular_radps > 0.4, 20.0, "a turn")
    joystick.message = None
    driven.wait_standing()
    assert idle.moved_since(began_s, 0.5) < RESTS_M
    assert idle.truth().angular_radps == 0.0


def test_a_latched_stop_of_one_leaves_the_other_alone(robots: Pair) -> None:
    one, two = robots["robot1"], robots["robot2"]
    assert one.run("stop") == 0
    one.wait_state(DriverStatus.LATCHED)
    assert two.driven(0.05, 0.1)
    assert one.wait_any_state().state == DriverStatus.LATCHED


def test_no_topic_of_a_robot_is_outside_its_namespace(robots: Pair) -> None:
    names = {name for name, _ in robots["robot1"].node.node.get_topic_names_and_types()}
    ours = {"cmd_vel", "cmd_vel_mux", "odom", "joint_states", "motor_driver/status", "safety_filter/state"}
    for topic in ours:
        assert f"/{topic}" not in names
        assert {f"/robot1/{topic}", f"/robot2/{topic}"} <= names
