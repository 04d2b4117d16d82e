"""The client lease over DDS: a client that is killed stops the robot, if the robot was told to look after that."""

from __future__ import annotations

import sys
import time

import pytest
from action_msgs.msg import GoalStatusArray
from canbase.action import DriveDistance
from rclpy.action import ActionClient

from canbase_action_server.client import DriveClient
from canbase_action_server.outcome import ErrorCode, Status
from ros.conftest import MakeRobot, Spawn
from support.fake_base import FakeBase, server_code
from support.ros_harness import TestNode

pytestmark = pytest.mark.ros

LEASE_S = 1.0
CANBASE = (sys.executable, "-c", "from canbase_cli.main import app; app()")


class Stage:
    """A running server before a base."""

    def __init__(self, node: TestNode, spawn: Spawn, make_robot: MakeRobot, *, lease: bool) -> None:
        self.node, self.spawn = node, spawn
        action = {"require_client_lease": lease, "client_lease_s": LEASE_S}
        self.server = spawn(server_code(make_robot({"timeouts": {"odometry_s": 0.5}, "action": action})))
        self.base = FakeBase(node)
        self.client = DriveClient(node.node, node.executor)
        self.client.wait_for_server(20.0)
        self.status = node.record(GoalStatusArray, "drive_distance/_action/status")
        node.wait_for(lambda: self.base.heard, 20.0, "the server to listen")
        node.spin_for(1.0)

    def last_status(self) -> list[int]:
        """Of all goals, as the server published it last."""
        return [goal.status for goal in self.status.last.status_list] if self.status.last else []

    def killed_client(self) -> None:
        """A client process is killed while its goal drives 1.5 m."""
        process = self.spawn([*CANBASE, "drive", "1.5", "--speed", "0.3"])
        self.node.wait_for(lambda: self.base.speed_mps > 0.2, 20.0, "the base to move")
        process.kill()


def test_a_killed_client_stops_the_robot_within_the_lease(
    test_node: TestNode, spawn: Spawn, make_robot: MakeRobot
) -> None:
    stage = Stage(test_node, spawn, make_robot, lease=True)
    stage.killed_client()
    killed_s = time.monotonic()
    test_node.wait_for(lambda: stage.base.orders[-1][1] == 0.0, 5.0, "the order to stop")
    assert time.monotonic() - killed_s < LEASE_S + 0.5
    test_node.wait_for(lambda: "CLIENT_LOST" in stage.server.log(), 5.0, "the end of the goal")
    assert abs(stage.base.speed_mps) < 0.02
    assert stage.base.x_m < 1.0
    test_node.wait_for(lambda: stage.last_status() == [Status.ABORTED], 2.0, "the status of the goal")


def test_without_the_lease_the_goal_of_a_killed_client_runs_to_its_end(
    test_node: TestNode, spawn: Spawn, make_robot: MakeRobot
) -> None:
    stage = Stage(test_node, spawn, make_robot, lease=False)
    stage.killed_client()
    test_node.wait_for(lambda: "SUCCEEDED" in stage.server.log(), 15.0, "the end of the goal")
    assert stage.base.x_m == pytest.approx(1.5, abs=0.01)


def test_our_client_keeps_its_goal_alive_by_itself_and_a_bare_one_does_not(
    test_node: TestNode, spawn: Spawn, make_robot: MakeRobot
) -> None:
    stage = Stage(test_node, spawn, make_robot, lease=True)
    result = stage.client.send(0.5, 0.2).wait(20.0)
    assert result is not None
    assert (result.status, result.code) == (Status.SUCCEEDED, ErrorCode.OK)
    bare = ActionClient(test_node.node, DriveDistance, "drive_distance")
    test_node.wait_for(bare.server_is_ready, 5.0, "the bare client")
    answer = bare.send_goal_async(DriveDistance.Goal(distance_m=-1.0, max_speed_mps=0.2))
    test_node.wait_for(answer.done, 5.0, "the answer")
    ended = answer.result().get_result_async()
    test_node.wait_for(ended.done, 10.0, "the result")
    assert ended.result().result.error_code == ErrorCode.CLIENT_LOST
