"""The whole stack under Nav2: a controller drives, gives up, and the tree backs up and spins at once."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point, TwistStamped
from nav2_msgs.action import BackUp, Spin
from rclpy.action import ActionClient

from support.running_robot import PATIENT, RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]
END_S = 20.0
ALLOWANCE = Duration(sec=15)


@pytest.fixture(scope="module")
def robot() -> Iterator[RunningRobot]:
    changes = {**PATIENT, "action": {"nav2_behaviors": True}}
    with own_domain() as domain, robot_on(domain, changes=changes) as running:
        yield running


def result(robot: RunningRobot, client: ActionClient, goal: Any) -> Any:
    """Of a goal that is accepted at once."""
    answer = client.send_goal_async(goal)
    robot.node.wait_for(answer.done, 5.0, "the answer")
    assert answer.result().accepted, robot.logs()
    ended = answer.result().get_result_async()
    robot.node.wait_for(ended.done, END_S, "the result")
    return ended.result()


def test_a_recovery_follows_on_a_controller_that_has_just_driven(robot: RunningRobot) -> None:
    back_up = ActionClient(robot.node.node, BackUp, "backup")
    spin = ActionClient(robot.node.node, Spin, "spin")
    robot.node.wait_for(lambda: back_up.server_is_ready() and spin.server_is_ready(), 10.0, "the servers")
    controller = robot.node.source("cmd_vel_nav")
    controller.message = TwistStamped()
    controller.message.twist.linear.x = 0.25
    robot.wait_speed(0.2)
    controller.message = TwistStamped()  # it gives up …
    robot.node.spin_for(0.1)  # … and the base is still braking
    controller.message = None

    ended = result(robot, back_up, BackUp.Goal(target=Point(x=0.3), speed=0.2, time_allowance=ALLOWANCE))
    ended_s, stood = time.monotonic(), robot.truth()
    assert ended.status == GoalStatus.STATUS_SUCCEEDED, ended.result.error_msg
    assert "drove -0.30" in ended.result.error_msg or "drove -0.29" in ended.result.error_msg
    assert robot.moved_since(ended_s, 1.0) < RESTS_M

    ended = result(robot, spin, Spin.Goal(target_yaw=-1.57, time_allowance=ALLOWANCE))
    assert ended.status == GoalStatus.STATUS_SUCCEEDED, ended.result.error_msg
    turned_rad = math.remainder(robot.truth().yaw_rad - stood.yaw_rad, 2.0 * math.pi)
    assert turned_rad == pytest.approx(-1.57, abs=0.05)  # in truth: the simulated wheels slip a little
