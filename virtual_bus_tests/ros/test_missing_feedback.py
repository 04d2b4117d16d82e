"""`canbase drive` whose feedback no longer arrives: what it reports, how it ends, and what the base does meanwhile."""

from __future__ import annotations

import time

import pytest

from canbase_action_server.client import DriveClient, FeedbackLostError
from canbase_action_server.outcome import ErrorCode, Status
from canbase_cli.goal import NO_FEEDBACK, NO_SERVER
from ros.conftest import MakeRobot, Spawn
from ros.test_drive_client import CANBASE, Stage
from support.fake_base import FakeBase, server_code
from support.ros_harness import TestNode

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

PATIENT_S = 40.0
"""On a loaded computer a command takes seconds to start."""


@pytest.fixture
def stage(test_node: TestNode, spawn: Spawn, make_robot: MakeRobot) -> Stage:
    return Stage(test_node, spawn, make_robot)


def wait_standing(stage: Stage) -> None:
    stage.node.wait_for(lambda: abs(stage.base.speed_mps) < 0.001, 10.0, "the base to stand")


def test_a_server_that_hangs_is_reported_and_the_base_stands_before_the_command_ends(stage: Stage) -> None:
    drive = stage.canbase_drive("4", "--speed", "0.3", "--feedback-timeout", "1")
    stage.wait_until_moving()
    stage.server.stop()
    assert stage.exit_code(drive, PATIENT_S) == NO_SERVER, drive.log()
    assert abs(stage.base.speed_mps) < 0.001  # its commands are too old: the base stopped without client and server
    told = drive.log()
    assert "no feedback from drive_distance for 1 s" in told
    assert "no answer to the cancel" in told
    assert "`canbase stop`" in told
    stage.server.resume()
    resumed_s = time.monotonic()
    stage.node.wait_for(lambda: '"step": "ended"' in stage.server.log(), 20.0, "the end of the goal")
    assert '"error_code": "ODOMETRY_LOST"' in stage.server.log()
    stage.node.spin_for(1.0)
    assert set(stage.base.orders_since(resumed_s)) <= {0.0}


def test_a_server_that_was_killed_is_reported_long_before_dds_misses_it(stage: Stage) -> None:
    drive = stage.canbase_drive("4", "--speed", "0.3", "--feedback-timeout", "1")
    stage.wait_until_moving()
    stage.server.kill()
    killed_s = time.monotonic()
    stage.node.wait_for(lambda: "no feedback from drive_distance" in drive.log(), 15.0, "the message")
    assert time.monotonic() - killed_s < 15.0  # DDS takes 20 s
    wait_standing(stage)
    assert stage.exit_code(drive, PATIENT_S) == NO_SERVER, drive.log()


def test_odometry_that_dies_is_the_servers_to_report_and_no_missing_feedback(stage: Stage) -> None:
    drive = stage.canbase_drive("4", "--speed", "0.3", "--feedback-timeout", "2")
    stage.wait_until_moving()
    stage.base.silent.add("odom")
    assert stage.exit_code(drive, PATIENT_S) == 4, drive.log()
    assert "ODOMETRY_LOST" in drive.log()
    assert "no feedback" not in drive.log()


SILENT_SERVER = """
import time, rclpy
from canbase.action import DriveDistance
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor

def drive(handle):
    print("runs", flush=True)
    while not handle.is_cancel_requested:
        time.sleep(0.05)
    handle.canceled()
    return DriveDistance.Result(error_code=DriveDistance.Result.CANCELED, message="canceled by request")

rclpy.init()
node = rclpy.create_node("silent")
server = ActionServer(node, DriveDistance, "drive_distance", drive, callback_group=ReentrantCallbackGroup(),
                      cancel_callback=lambda handle: CancelResponse.ACCEPT)
executor = MultiThreadedExecutor(3)
executor.add_node(node)
executor.spin()
"""


def test_a_server_that_lives_and_reports_nothing_cancels_the_goal_and_the_code_says_why(
    test_node: TestNode, spawn: Spawn
) -> None:
    spawn(SILENT_SERVER)
    drive = spawn([*CANBASE, "drive", "1", "--feedback-timeout", "1", "--wait", "20"])
    test_node.wait_for(lambda: drive.exit_code is not None, PATIENT_S, f"its end:\n{drive.log()}")
    assert drive.exit_code == NO_FEEDBACK, drive.log()
    assert "the server accepts the cancel\nCANCELED (CANCELED): canceled by request" in drive.log()


def test_the_python_client_raises_once_cancels_and_can_wait_for_the_end(test_node: TestNode, spawn: Spawn) -> None:
    spawn(SILENT_SERVER)
    goal = DriveClient(test_node.node, test_node.executor, feedback_timeout_s=1.0).send(
        1.0, 0.2, discovery_timeout_s=20.0
    )
    with pytest.raises(FeedbackLostError, match="its cancel was sent"):
        goal.wait(30.0)
    assert goal.cancel()  # the answer to the one that was sent
    assert goal.cancel()  # a goal that is being canceled needs no second one
    result = goal.wait(20.0)
    assert result is not None
    assert (result.status, result.code) == (Status.CANCELED, ErrorCode.CANCELED)


def test_a_client_that_was_suspended_goes_on_with_its_goal(stage: Stage) -> None:
    drive = stage.canbase_drive("1", "--speed", "0.2", "--feedback-timeout", "1")  # 5 s
    stage.wait_until_moving()
    drive.stop()
    stage.node.spin_for(2.0)
    drive.resume()
    assert stage.exit_code(drive, PATIENT_S) == 0, drive.log()


def test_a_goal_that_waits_in_the_queue_for_longer_than_the_timeout_is_not_lost(
    test_node: TestNode, spawn: Spawn, make_robot: MakeRobot
) -> None:
    spawn(server_code(make_robot({"timeouts": {"odometry_s": 0.5}, "action": {"goal_policy": "queue"}})))
    base = FakeBase(test_node)
    client = DriveClient(test_node.node, test_node.executor, feedback_timeout_s=3.0)
    client.wait_for_server(20.0)
    test_node.wait_for(lambda: base.heard, 20.0, "the server to listen")
    test_node.spin_for(0.5)
    before = client.send(1.2, 0.2)  # 6 s
    waits = client.send(0.1, 0.2)
    result = waits.wait(40.0)
    assert result is not None
    assert result.code is ErrorCode.OK
    assert before.result is not None
