"""One request that cancels the goals of every action: by the service, by `canbase cancel`, and action by action."""

from __future__ import annotations

import math
from typing import Any

import pytest
from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from builtin_interfaces.msg import Time
from canbase.action import DriveDistance, RotateAngle
from rclpy.action import ActionClient
from rclpy.qos import qos_profile_action_status_default
from unique_identifier_msgs.msg import UUID

from canbase_action_server.node import CANCEL_GOALS
from canbase_action_server.outcome import ErrorCode, Status
from ros.conftest import MakeRobot, Spawn
from ros.test_drive_client import CANBASE
from support.fake_base import FakeBase, server_code
from support.ros_harness import Process, TestNode

pytestmark = [pytest.mark.ros, pytest.mark.timeout(180)]

PATIENT_S = 40.0


class Queue:
    """A server with the policy queue, its base, and plain clients of its actions."""

    def __init__(self, node: TestNode, spawn: Spawn, make_robot: MakeRobot) -> None:
        # Where a goal ends is not what this is about: a loaded machine may make the server late by centimetres.
        changes = {"timeouts": {"odometry_s": 0.5}, "action": {"goal_policy": "queue", "tolerance_m": 0.04}}
        self.node, self._spawn = node, spawn
        self.server = spawn(server_code(make_robot(changes)))
        self.base = FakeBase(node)
        self._drive = ActionClient(node.node, DriveDistance, "drive_distance")
        self._rotate = ActionClient(node.node, RotateAngle, "rotate_angle")
        for client in (self._drive, self._rotate):
            node.wait_for(client.server_is_ready, 20.0, "the server")
        node.wait_for(lambda: self.base.heard, 20.0, "the server to listen")
        node.spin_for(0.5)

    def drive(self, distance_m: float) -> Any:
        return self._sent(self._drive.send_goal_async(DriveDistance.Goal(distance_m=distance_m, max_speed_mps=0.3)))

    def rotate(self, angle_rad: float) -> Any:
        return self._sent(self._rotate.send_goal_async(RotateAngle.Goal(angle_rad=angle_rad, max_speed_radps=0.5)))

    def _sent(self, future: Any) -> Any:
        """Handle of a goal that was accepted."""
        self.node.wait_for(future.done, 10.0, "the answer to the goal")
        assert future.result().accepted, self.server.log()
        return future.result()

    def wait_until_moving(self) -> None:
        self.node.wait_for(lambda: abs(self.base.speed_mps) > 0.1, 10.0, "the base to move")

    def cancel(self, service: str, uuid: Any = None, stamp: Time | None = None) -> CancelGoal.Response:
        info = GoalInfo(goal_id=uuid or UUID(), stamp=stamp or Time())
        client = self.node.node.create_client(CancelGoal, service)
        self.node.wait_for(client.service_is_ready, 10.0, f"{service}")
        future = client.call_async(CancelGoal.Request(goal_info=info))
        self.node.wait_for(future.done, 10.0, f"the answer of {service}")
        return future.result()

    def status_stamp(self, handle: Any) -> Time:
        """When the goal was accepted, by the status topic of its action."""
        infos = [each.goal_info for each in self._status().status_list]
        return next(info.stamp for info in infos if info.goal_id == handle.goal_id)

    def canceling(self) -> list[bytes]:
        """The goals of drive_distance that are CANCELING or CANCELED."""
        wanted = (GoalStatus.STATUS_CANCELING, GoalStatus.STATUS_CANCELED)
        return [bytes(each.goal_info.goal_id.uuid) for each in self._status().status_list if each.status in wanted]

    def _status(self) -> GoalStatusArray:
        latched = qos_profile_action_status_default
        seen = self.node.record(GoalStatusArray, "drive_distance/_action/status", latched)
        self.node.wait_for(lambda: seen.last, 10.0, "the status")
        assert seen.last is not None
        return seen.last

    def end_of(self, handle: Any) -> tuple[Status, ErrorCode]:
        future = handle.get_result_async()
        self.node.wait_for(future.done, 20.0, "the result")
        return Status(future.result().status), ErrorCode(future.result().result.error_code)

    def canbase_cancel(self) -> Process:
        """`canbase cancel`, ended."""
        process = self._spawn([*CANBASE, "cancel", "--wait", "20"])
        self.node.wait_for(lambda: process.exit_code is not None, PATIENT_S, f"its end:\n{process.log()}")
        return process


@pytest.fixture
def queue(test_node: TestNode, spawn: Spawn, make_robot: MakeRobot) -> Queue:
    return Queue(test_node, spawn, make_robot)


CANCELED = (Status.CANCELED, ErrorCode.CANCELED)


def ids(answer: CancelGoal.Response) -> list[bytes]:
    return [bytes(info.goal_id.uuid) for info in answer.goals_canceling]


def test_one_request_of_zeros_cancels_the_goals_of_every_action_and_none_that_waits_begins(queue: Queue) -> None:
    goals = [queue.drive(4.0), queue.rotate(math.pi), queue.drive(-1.0), queue.rotate(-1.0)]
    queue.wait_until_moving()
    answer = queue.cancel(CANCEL_GOALS)
    assert answer.return_code == CancelGoal.Response.ERROR_NONE
    assert ids(answer) == [bytes(goal.goal_id.uuid) for goal in goals]
    assert [queue.end_of(goal) for goal in goals] == [CANCELED] * 4
    assert abs(queue.base.speed_mps) < 0.02
    assert queue.server.log().count('"step": "started"') == 1
    assert queue.server.log().count('"step": "cancel requested"') == 4
    assert ids(queue.cancel(CANCEL_GOALS)) == []  # nothing is open: no error


def test_a_stamp_or_a_uuid_chooses_goals_over_all_actions(queue: Queue) -> None:
    first, second, third, fourth = queue.drive(4.0), queue.rotate(math.pi), queue.drive(-1.0), queue.rotate(-1.0)
    answer = queue.cancel(CANCEL_GOALS, fourth.goal_id)
    assert ids(answer) == [bytes(fourth.goal_id.uuid)]
    assert queue.end_of(fourth) == CANCELED
    answer = queue.cancel(CANCEL_GOALS, stamp=second.stamp)
    assert ids(answer) == [bytes(each.goal_id.uuid) for each in (first, second)]
    assert queue.end_of(second) == CANCELED
    assert queue.end_of(first) == CANCELED
    unknown = queue.cancel(CANCEL_GOALS, UUID(uuid=[7] * 16))
    assert (unknown.return_code, ids(unknown)) == (CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID, [])
    assert queue.end_of(third) == (Status.SUCCEEDED, ErrorCode.OK)


def test_the_cancel_service_of_one_action_follows_the_same_rule_for_that_action(queue: Queue) -> None:
    first, turn, second, third = queue.drive(4.0), queue.rotate(1.0), queue.drive(-0.1), queue.drive(-0.2)
    service = "drive_distance/_action/cancel_goal"
    both = sorted(bytes(each.goal_id.uuid) for each in (first, second))
    # ROS stamps a goal twice: the stamp that its client got is a moment before the one that this service compares.
    assert bytes(second.goal_id.uuid) not in ids(queue.cancel(service, stamp=second.stamp))
    queue.cancel(service, stamp=queue.status_stamp(second))
    assert sorted(queue.canceling()) == both
    assert ids(queue.cancel(service)) == [bytes(third.goal_id.uuid)]  # all that is not canceled yet
    assert [queue.end_of(goal) for goal in (first, second, third)] == [CANCELED] * 3
    assert queue.end_of(turn) == (Status.SUCCEEDED, ErrorCode.OK)  # another action


def test_canbase_cancel_waits_for_standstill_and_then_finds_nothing(queue: Queue) -> None:
    drive, turn = queue.drive(4.0), queue.rotate(math.pi)
    queue.wait_until_moving()
    canceled = queue.canbase_cancel()
    assert canceled.exit_code == 0, canceled.log()
    assert "2 goals ended; the base is at standstill" in canceled.log()
    assert abs(queue.base.speed_mps) < 0.02
    assert [queue.end_of(goal) for goal in (drive, turn)] == [CANCELED] * 2
    again = queue.canbase_cancel()
    assert (again.exit_code, again.log().strip()) == (0, "no goal runs or waits")


def test_canbase_cancel_reports_a_base_that_moves_on_and_a_server_that_hangs(queue: Queue) -> None:
    queue.drive(4.0)
    queue.wait_until_moving()
    queue.base.ramp_mps2 = 0.0  # nothing slows it down
    moving = queue.canbase_cancel()
    assert moving.exit_code == 1, moving.log()
    assert "`canbase stop`" in moving.log()
    queue.server.stop()
    hanging = queue.canbase_cancel()
    assert hanging.exit_code == 6, hanging.log()
    assert "it has ended, hangs, or has another namespace" in hanging.log()  # DDS finds nobody who hangs
    queue.server.resume()


DEAF_SERVER = """
import time, rclpy
from action_msgs.srv import CancelGoal
rclpy.init()
node = rclpy.create_node("deaf")
node.create_service(CancelGoal, "drive_distance_server/cancel_goals", print)
time.sleep(120.0)
"""


def test_a_server_that_is_found_and_does_not_answer_is_reported(test_node: TestNode, spawn: Spawn) -> None:
    spawn(DEAF_SERVER)
    process = spawn([*CANBASE, "cancel", "--wait", "20"])
    test_node.wait_for(lambda: process.exit_code is not None, PATIENT_S, "its end")
    assert process.exit_code == 6
    assert "the action server hangs" in process.log()


def test_without_a_server_canbase_cancel_says_so(test_node: TestNode, spawn: Spawn) -> None:
    process = spawn([*CANBASE, "cancel", "--wait", "0.5"])
    test_node.wait_for(lambda: process.exit_code is not None, PATIENT_S, "its end")
    assert process.exit_code == 6
    assert "no action server with drive_distance_server/cancel_goals is found" in process.log()
