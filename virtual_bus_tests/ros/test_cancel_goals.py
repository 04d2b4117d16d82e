"""One request that cancels the goals of every action: by the service, by `canbase cancel`, and action by action."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from builtin_interfaces.msg import Time
from canbase.action import DriveDistance, RotateAngle
from rclpy.action import ActionClient
from rclpy.qos import qos_profile_action_status_default
from unique_identifier_msgs.msg import UUID

from canbase_action_server.client import DriveClient
from canbase_action_server.node import CANCEL_GOALS
from canbase_action_server.outcome import ErrorCode, Status
from support.goal_stage import PATIENT_S, GoalStage, bare_stage, goal_stage

pytestmark = [pytest.mark.ros, pytest.mark.timeout(180)]

# Where a goal ends is not what this is about: a loaded machine may make the server late by centimetres.
CHANGES = {"action": {"goal_policy": "queue", "tolerance_m": 0.04}}


class Queue:
    """A server with the policy queue, its base, and plain clients of its actions."""

    def __init__(self, stage: GoalStage) -> None:
        self.stage, self.node, self.base, self.server = stage, stage.node, stage.base, stage.server
        self._drive = ActionClient(stage.node.node, DriveDistance, "drive_distance")
        self._rotate = ActionClient(stage.node.node, RotateAngle, "rotate_angle")
        self._status = stage.node.record(
            GoalStatusArray, "drive_distance/_action/status", qos_profile_action_status_default
        )
        for client in (self._drive, self._rotate):
            stage.node.wait_for(client.server_is_ready, PATIENT_S, "the server")

    def drive(self, distance_m: float) -> Any:
        return self._sent(self._drive.send_goal_async(DriveDistance.Goal(distance_m=distance_m, max_speed_mps=0.3)))

    def rotate(self, angle_rad: float) -> Any:
        return self._sent(self._rotate.send_goal_async(RotateAngle.Goal(angle_rad=angle_rad, max_speed_radps=0.5)))

    def _sent(self, future: Any) -> Any:
        """Handle of a goal that was accepted."""
        self.node.wait_for(future.done, 10.0, "the answer to the goal")
        assert future.result().accepted, self.server.log()
        return future.result()

    def cancel(self, service: str, uuid: Any = None, stamp: Time | None = None) -> CancelGoal.Response:
        info = GoalInfo(goal_id=uuid or UUID(), stamp=stamp or Time())
        client = self.node.node.create_client(CancelGoal, service)
        self.node.wait_for(client.service_is_ready, 10.0, f"{service}")
        future = client.call_async(CancelGoal.Request(goal_info=info))
        self.node.wait_for(future.done, 10.0, f"the answer of {service}")
        self.node.node.destroy_client(client)
        return future.result()

    def status_of(self, handle: Any) -> GoalStatus | None:
        """By the status topic of drive_distance."""
        known = self._status.last.status_list if self._status.last else []
        return next((each for each in known if each.goal_info.goal_id == handle.goal_id), None)

    def status_stamp(self, handle: Any) -> Time:
        """When the goal was accepted, by the status topic of its action."""
        status = self.node.wait_for(lambda: self.status_of(handle), 10.0, "its status")
        assert status is not None
        return status.goal_info.stamp

    def is_canceling(self, handle: Any) -> bool:
        """CANCELING or CANCELED."""
        status = self.status_of(handle)
        return status is not None and status.status in (GoalStatus.STATUS_CANCELING, GoalStatus.STATUS_CANCELED)

    def end_of(self, handle: Any) -> tuple[Status, ErrorCode]:
        future = handle.get_result_async()
        self.node.wait_for(future.done, 20.0, "the result")
        return Status(future.result().status), ErrorCode(future.result().result.error_code)

    def steps_of(self, *handles: Any) -> list[str]:
        """Of these goals, by the server's log."""
        uuids = {bytes(handle.goal_id.uuid).hex() for handle in handles}
        return [step["step"] for step in self.stage.steps() if step["uuid"] in uuids]


@pytest.fixture(scope="module")
def running() -> Iterator[Queue]:
    with goal_stage(CHANGES) as stage:
        yield Queue(stage)


@pytest.fixture
def queue(running: Queue) -> Iterator[Queue]:
    running.stage.recovered()
    yield running
    print(running.server.log()[-3000:])


CANCELED = (Status.CANCELED, ErrorCode.CANCELED)


def ids(answer: CancelGoal.Response) -> list[bytes]:
    return [bytes(info.goal_id.uuid) for info in answer.goals_canceling]


def test_one_request_of_zeros_cancels_the_goals_of_every_action_and_none_that_waits_begins(queue: Queue) -> None:
    goals = [queue.drive(4.0), queue.rotate(math.pi), queue.drive(-1.0), queue.rotate(-1.0)]
    queue.stage.wait_until_moving()
    answer = queue.cancel(CANCEL_GOALS)
    assert answer.return_code == CancelGoal.Response.ERROR_NONE
    assert ids(answer) == [bytes(goal.goal_id.uuid) for goal in goals]
    assert [queue.end_of(goal) for goal in goals] == [CANCELED] * 4
    assert abs(queue.base.speed_mps) < 0.02
    assert queue.steps_of(*goals).count("started") == 1
    assert queue.steps_of(*goals).count("cancel requested") == 4
    assert ids(queue.cancel(CANCEL_GOALS)) == []  # nothing is open: no error


def test_a_stamp_or_a_uuid_chooses_goals_over_all_actions(queue: Queue) -> None:
    first, second, third, fourth = queue.drive(4.0), queue.rotate(math.pi), queue.drive(-0.2), queue.rotate(-1.0)
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
    first, turn, second, third = queue.drive(4.0), queue.rotate(0.3), queue.drive(-0.1), queue.drive(-0.2)
    service = "drive_distance/_action/cancel_goal"
    # ROS stamps a goal twice: the stamp that its client got is a moment before the one that this service compares.
    assert bytes(second.goal_id.uuid) not in ids(queue.cancel(service, stamp=second.stamp))
    queue.cancel(service, stamp=queue.status_stamp(second))
    queue.node.wait_for(lambda: queue.is_canceling(first) and queue.is_canceling(second), 5.0, "both to be canceled")
    assert not queue.is_canceling(third)
    assert ids(queue.cancel(service)) == [bytes(third.goal_id.uuid)]  # all that is not canceled yet
    assert [queue.end_of(goal) for goal in (first, second, third)] == [CANCELED] * 3
    assert queue.end_of(turn) == (Status.SUCCEEDED, ErrorCode.OK)  # another action


def test_a_goal_that_waits_for_longer_than_the_feedback_timeout_is_not_lost(queue: Queue) -> None:
    client = DriveClient(queue.node.node, queue.node.executor, feedback_timeout_s=2.0)
    before = queue.drive(0.9)  # 3 s
    result = client.send(0.1, 0.2).wait(PATIENT_S)
    assert result is not None
    assert result.code is ErrorCode.OK
    assert queue.steps_of(before)[-1] == "ended"
    client.close()


def test_canbase_cancel_waits_for_standstill_and_then_finds_nothing(queue: Queue) -> None:
    drive, turn = queue.drive(4.0), queue.rotate(math.pi)
    queue.stage.wait_until_moving()
    canceled = queue.stage.canbase("cancel", "--wait", "20")
    assert canceled.wait(PATIENT_S) == 0, canceled.log()
    assert "2 goals ended; the base is at standstill" in canceled.log()
    assert abs(queue.base.speed_mps) < 0.02
    assert [queue.end_of(goal) for goal in (drive, turn)] == [CANCELED] * 2
    again = queue.stage.canbase("cancel", "--wait", "20")
    assert (again.wait(PATIENT_S), again.log().strip()) == (0, "no goal runs or waits")


HASTY = (
    "from canbase_cli import cancel\ncancel.STANDSTILL_S = cancel.ANSWER_S = 1.0\n"
    "from canbase_cli.main import app\napp(prog_name='canbase')\n"
)
"""`canbase`, whose `cancel` waits for shorter than 10 s and 5 s."""


def test_canbase_cancel_reports_a_base_that_moves_on_and_a_server_that_hangs() -> None:
    with goal_stage(CHANGES) as stage:
        queue = Queue(stage)
        queue.drive(4.0)
        stage.wait_until_moving()
        stage.base.ramp_mps2 = 0.0  # nothing slows it down
        moving = stage.spawn([sys.executable, "-c", HASTY, "cancel", "--wait", "20"])
        assert moving.wait(PATIENT_S) == 1, moving.log()
        assert "`canbase stop`" in moving.log()
        stage.server.stop()
        hanging = stage.canbase("cancel", "--wait", "2")
        assert hanging.wait(PATIENT_S) == 6, hanging.log()
        assert "no action server with drive_distance_server/cancel_goals is found" in hanging.log()
        assert "it has ended, hangs, or has another namespace" in hanging.log()  # DDS finds nobody who hangs


DEAF_SERVER = """
import time, rclpy
from action_msgs.srv import CancelGoal
rclpy.init()
node = rclpy.create_node("deaf")
node.create_service(CancelGoal, "drive_distance_server/cancel_goals", print)
time.sleep(120.0)
"""


def test_a_server_that_is_found_and_does_not_answer_is_reported() -> None:
    with bare_stage() as stage:
        stage.spawn(DEAF_SERVER)
        process = stage.spawn([sys.executable, "-c", HASTY, "cancel", "--wait", "20"])
        assert process.wait(PATIENT_S) == 6
        assert "the action server hangs" in process.log()
