"""`canbase drive` whose feedback no longer arrives: what it reports, how it ends, and what the base does meanwhile.

A client that was suspended: test_drive_client.py. A goal that waits reports: test_cancel_goals.py.
"""

from __future__ import annotations

import time

import pytest

from canbase_action_server.client import DriveClient, FeedbackLostError
from canbase_action_server.outcome import ErrorCode, Status
from canbase_cli.goal import NO_FEEDBACK, NO_SERVER
from support.goal_stage import PATIENT_S, bare_stage, goal_stage

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]


def test_a_server_that_hangs_is_reported_and_the_base_stands_before_the_command_ends() -> None:
    with goal_stage() as stage:
        drive = stage.canbase("drive", "4", "--speed", "0.3", "--feedback-timeout", "1")
        stage.wait_until_moving()
        stage.server.stop()
        assert drive.wait(PATIENT_S) == NO_SERVER, drive.log()
        assert abs(stage.base.speed_mps) < 0.001  # its commands are too old: it stopped without client and server
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


def test_a_server_that_lives_and_reports_nothing_cancels_the_goal_and_code_and_error_say_why() -> None:
    with bare_stage() as stage:
        stage.spawn(SILENT_SERVER)
        drive = stage.canbase("drive", "1", "--feedback-timeout", "1", "--wait", "20")
        assert drive.wait(PATIENT_S) == NO_FEEDBACK, drive.log()
        assert "the server accepts the cancel\nCANCELED (CANCELED): canceled by request" in drive.log()

        goal = DriveClient(stage.node.node, stage.node.executor, feedback_timeout_s=1.0).send(
            1.0, 0.2, discovery_timeout_s=20.0
        )
        with pytest.raises(FeedbackLostError, match="its cancel was sent"):
            goal.wait(30.0)
        assert goal.cancel()  # the answer to the one that was sent
        assert goal.cancel()  # a goal that is being canceled needs no second one
        result = goal.wait(20.0)
        assert result is not None
        assert (result.status, result.code) == (Status.CANCELED, ErrorCode.CANCELED)
