"""`canbase drive` and `canbase rotate`, the Python client, and a hand-written client, against the real server.

Ctrl-C on a whole robot: test_stack_drive.py. Two namespaces: test_stack_namespaces.py.
"""

from __future__ import annotations

import json
import math
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatusArray
from canbase.action import DriveDistance
from canbase.msg import DriverStatus
from rclpy.action import ActionClient
from rclpy.node import Node

from canbase_action_server.action_servers import actions_of
from canbase_action_server.client import DriveClient, NoResponseError, NoServerError, RejectedError, ServerLostError
from canbase_action_server.outcome import Status
from canbase_action_server.rotate_client import RotateClient
from ros.conftest import MakeRobot, Spawn
from support.goal_stage import PATIENT_S, GoalStage, bare_stage, goal_stage
from support.ros_harness import TestNode
from support.running_robot import CANBASE

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

LEASE_S = 1.0


@pytest.fixture(scope="module")
def running() -> Iterator[GoalStage]:
    with goal_stage() as stage:
        yield stage


@pytest.fixture
def stage(running: GoalStage) -> Iterator[GoalStage]:
    yield running.recovered()
    print(running.server.log()[-3000:])


def test_exit_codes_tell_the_ends_apart(stage: GoalStage) -> None:
    forward = stage.canbase("drive", "0.2", "--speed", "0.3")
    assert forward.wait(PATIENT_S) == 0, forward.log()
    assert "SUCCEEDED (OK)" in forward.log()
    assert "m left" in forward.log()  # no terminal: lines instead of a bar
    assert "\x1b" not in forward.log()

    turned = stage.canbase("rotate", "-90deg", "--speed", "1.0", "--json")
    assert turned.wait(PATIENT_S) == 0, turned.log()
    told = json.loads(turned.log())
    assert (told["status"], told["code"]) == ("SUCCEEDED", "OK")
    assert told["turned_rad"] == pytest.approx(-math.pi / 2, abs=0.005 / 0.2)

    far = stage.canbase("drive", "100")
    assert far.wait(PATIENT_S) == 5
    reason = "|distance_m| is 100, outside 0.01 to 5.0 (action.max_distance_m of robot.yaml)"
    assert far.log().strip().endswith(reason), far.log()

    aborted = stage.canbase("drive", "2", "--speed", "0.3")
    stage.wait_until_moving()
    stage.base.driver.state = DriverStatus.LATCHED
    assert aborted.wait(PATIENT_S) == 4
    assert "DRIVE_FAULT" in aborted.log()


REASONLESS_SERVER = """
import rclpy
from canbase.action import DriveDistance
from rclpy.action import ActionServer, GoalResponse
rclpy.init()
node = rclpy.create_node("reasonless")
server = ActionServer(
    node, DriveDistance, "drive_distance", lambda handle: DriveDistance.Result(),
    goal_callback=lambda goal: GoalResponse.REJECT,
)
rclpy.spin(node)
"""


def test_a_server_that_gives_no_reason_is_asked_for_it_no_longer_than_a_second() -> None:
    with bare_stage() as stage:
        stage.spawn(REASONLESS_SERVER)
        client = DriveClient(stage.node.node, stage.node.executor)
        client.wait_for_server(PATIENT_S)
        sent_s = time.monotonic()
        with pytest.raises(RejectedError, match="the reason is in the log of its server") as told:
            client.send(1.0, 0.2)
        assert told.value.reason is None
        assert time.monotonic() - sent_s < 3.0


def test_cancel_after_cancels_the_goal(stage: GoalStage) -> None:
    drive = stage.canbase("drive", "3", "--speed", "0.2", "--cancel-after", "0.6")
    assert drive.wait(PATIENT_S) == 3, drive.log()
    assert abs(stage.base.speed_mps) < 0.02
    assert "the server accepts the cancel\nCANCELED" in drive.log()


def test_a_client_that_was_suspended_goes_on_with_its_goal(stage: GoalStage) -> None:
    drive = stage.canbase("drive", "0.8", "--speed", "0.2", "--feedback-timeout", "1")  # 4 s
    stage.wait_until_moving()
    drive.stop()
    stage.node.spin_for(2.0)
    drive.resume()
    assert drive.wait(PATIENT_S) == 0, drive.log()


def test_a_second_ctrl_c_gives_up_waiting_and_says_so(stage: GoalStage) -> None:
    drive = stage.canbase("drive", "3", "--speed", "0.4")
    stage.wait_until_moving()
    stage.base.ramp_mps2 = 0.0  # nothing slows it down: no final status comes
    drive.interrupt()
    stage.node.wait_for(lambda: "the server accepts the cancel" in drive.log(), 10.0, "the answer to the cancel")
    drive.interrupt()
    assert drive.wait(PATIENT_S) == 1, drive.log()
    assert "no longer waiting for the result: the base may still move" in drive.log()


SHORT_LEASE = """<dds><profiles xmlns="http://www.eprosima.com">
  <participant profile_name="short_lease" is_default_profile="true"><rtps><builtin><discovery_config>
    <leaseDuration><sec>3</sec></leaseDuration><leaseAnnouncement><sec>1</sec></leaseAnnouncement>
  </discovery_config></builtin></rtps></participant>
</profiles></dds>"""
"""Fast DDS misses a process that was killed after 3 s. By default it takes 20 s."""


def test_a_server_that_dies_is_told_and_the_goal_is_not_sent_again(tmp_path: Path) -> None:
    profile = tmp_path / "short_lease.xml"
    profile.write_text(SHORT_LEASE, encoding="utf-8")
    with goal_stage(env={"FASTRTPS_DEFAULT_PROFILES_FILE": str(profile)}) as stage:
        client = DriveClient(stage.node.node, stage.node.executor, feedback_timeout_s=60.0)
        drive = client.send(2.0, 0.3)
        stage.wait_until_moving()
        stage.server.kill()
        with pytest.raises(ServerLostError):
            drive.wait(30.0)
        assert stage.base.speed_mps == pytest.approx(0.0, abs=0.001)


def test_a_server_that_does_not_answer_is_an_error_of_its_own_and_its_late_goal_is_canceled() -> None:
    with goal_stage() as stage:
        stage.server.stop()  # hangs: it is still in the graph
        asked_s = time.monotonic()
        with pytest.raises(NoResponseError, match="cancel was sent"):
            stage.client.send(2.0, 0.3, response_timeout_s=1.0)
        assert time.monotonic() - asked_s < 4.0  # by default it waits for 5 s
        stage.server.resume()
        stage.node.wait_for(
            lambda: '"step": "ended"' in stage.server.log() or "rejected" in stage.server.log(), 10.0, "its end"
        )
        assert "SUCCEEDED" not in stage.server.log()
        stage.node.spin_for(0.5)
        assert stage.base.speed_mps == pytest.approx(0.0, abs=0.001)


DEAF_CLIENT = """
import signal, time, rclpy
from canbase.action import DriveDistance
from rclpy.action import ActionClient
from rclpy.node import Node
signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGUSR1})
rclpy.init()
node = rclpy.create_node("deaf")
client = ActionClient(node, DriveDistance, "drive_distance")
client.wait_for_server()
print("found", flush=True)
signal.sigwait({signal.SIGUSR1})
client.send_goal_async(DriveDistance.Goal(distance_m=1.0, max_speed_mps=0.3))
print("sent", flush=True)
time.sleep(60.0)
"""


def test_a_goal_that_waited_in_a_server_that_stood_still_never_starts() -> None:
    with goal_stage() as stage:
        client = stage.spawn(DEAF_CLIENT)
        stage.node.wait_for(lambda: "found" in client.log(), PATIENT_S, "the client to find the server")
        stage.node.spin_for(1.5)  # and the server the client: else its request is never delivered
        stage.server.stop()
        os.kill(client.pid, signal.SIGUSR1)
        stage.node.wait_for(lambda: "sent" in client.log(), 10.0, "the goal to be sent")
        stage.node.spin_for(1.0)
        resumed_s = time.monotonic()
        stage.server.resume()
        stage.node.wait_for(lambda: '"step": "rejected"' in stage.server.log(), 10.0, "its rejection")
        assert "did not run before it" in stage.server.log()
        stage.node.spin_for(4.0)  # RESENT_S: until then no goal is taken for a new one
        assert set(stage.base.orders_since(resumed_s)) <= {0.0}
        assert stage.end_of(stage.client.send(0.1, 0.1)).status is Status.SUCCEEDED  # the server is well


SLOW_SERVER = """
import time, rclpy
from canbase.action import DriveDistance
from rclpy.action import ActionServer, CancelResponse, GoalResponse

def on_goal(goal):
    print("asked", flush=True)
    time.sleep(2.0)
    return GoalResponse.ACCEPT

def on_cancel(handle):
    print("cancel requested", flush=True)
    return CancelResponse.ACCEPT

rclpy.init()
node = rclpy.create_node("slow")
server = ActionServer(
    node, DriveDistance, "drive_distance", lambda handle: DriveDistance.Result(),
    goal_callback=on_goal, cancel_callback=on_cancel,
    handle_accepted_callback=lambda handle: print("accepted", flush=True),
)
rclpy.spin(node)
"""


def test_a_client_that_ends_before_the_acceptance_leaves_its_cancel_behind() -> None:
    with bare_stage() as stage:
        server, drive = stage.spawn(SLOW_SERVER), stage.canbase("drive", "1.0", "--wait", "20")
        stage.node.wait_for(lambda: "asked" in server.log(), PATIENT_S, "the goal to arrive")
        drive.interrupt()
        stage.node.wait_for(lambda: drive.exit_code is not None, 1.5, f"its end:\n{drive.log()}")
        assert drive.wait(1.0) == 3
        assert "accepted" not in server.log()
        stage.node.wait_for(lambda: "cancel requested" in server.log(), 5.0, "the cancel, after the acceptance")
        assert server.log().index("accepted") < server.log().index("cancel requested")


def test_a_killed_client_stops_the_robot_within_the_lease() -> None:
    with goal_stage({"action": {"require_client_lease": True, "client_lease_s": LEASE_S}}) as stage:
        status = stage.node.record(GoalStatusArray, "drive_distance/_action/status")
        client = stage.canbase("drive", "1.5", "--speed", "0.3")
        stage.wait_until_moving(0.2)
        client.kill()
        killed_s = time.monotonic()
        stage.node.wait_for(lambda: stage.base.orders[-1][1] == 0.0, 5.0, "the order to stop")
        assert time.monotonic() - killed_s < LEASE_S + 0.5
        stage.node.wait_for(lambda: "CLIENT_LOST" in stage.server.log(), 5.0, "the end of the goal")
        assert abs(stage.base.speed_mps) < 0.02
        assert stage.base.x_m < 1.0
        told = lambda: [goal.status for goal in status.last.status_list] if status.last else []  # noqa: E731
        stage.node.wait_for(lambda: told() == [Status.ABORTED], 2.0, "the status of the goal")


def test_clients_share_the_executor_of_their_node(stage: GoalStage) -> None:
    drive, rotate, other = (kind(stage.node.node) for kind in (DriveClient, RotateClient, DriveClient))
    for client in (drive, other):
        result = client.send(0.1, 0.3).wait(20.0)
        assert result is not None
        assert result.status is Status.SUCCEEDED
    with pytest.raises(RejectedError):
        rotate.send(1.0, 99.0)
    for each in (drive, rotate, other):
        each.close()


def test_clients_leave_the_node_of_the_application_alone(test_node: TestNode) -> None:
    node = Node("application", context=test_node.node.context)
    clients = (DriveClient(node), RotateClient(node))
    assert node.executor is None
    assert clients[0]._executor is not clients[1]._executor
    for client in clients:
        client.close()
    node.destroy_node()


def test_no_server_is_an_error_of_its_own(test_node: TestNode) -> None:
    with pytest.raises(NoServerError, match="drive_distance"):
        DriveClient(test_node.node, test_node.executor).wait_for_server(0.5)


PARTS = ("send_goal", "cancel_goal", "get_result", "feedback", "status")


def test_the_server_with_another_node_name_and_all_five_parts_remapped_serves_under_the_new_name() -> None:
    parts = [("-r", f"drive_distance/_action/{part}:=/far/go/_action/{part}") for part in PARTS]
    rules = ("-r", "__node:=goals", "-r", "goals:rotate_angle:=turn", *(word for rule in parts for word in rule))
    lease = {"action": {"require_client_lease": True}}
    with goal_stage(lease, arguments=["--ros-args", *rules]) as stage:
        node, expected = stage.node.node, {"/far/go", "/turn"}
        stage.node.wait_for(lambda: actions_of(node, "goals", "/") == expected, 20.0, "both names")
        services = {name for name, _types in node.get_service_names_and_types_by_node("goals", "/")}
        assert "/drive_distance_server/cancel_goals" in services
        assert actions_of(node, "nobody", "/") == set()  # a node that has just ended is no error
        goals = (
            ("drive", "0.3", "--wait", "20", "--namespace", "elsewhere", "--ros-args", "-r", "drive_distance:=/far/go"),
            ("rotate", "0.5", "--wait", "20", "--ros-args", "-r", "rotate_angle:=turn"),
        )
        for words in goals:
            sent = stage.canbase(*words)
            assert sent.wait(PATIENT_S) == 0, sent.log()  # without a lease beside the action it would have ended
        assert stage.base.x_m == pytest.approx(0.3, abs=0.005)


def test_rules_that_would_tear_an_action_apart_end_server_and_client_with_a_message(
    spawn: Spawn, make_robot: MakeRobot
) -> None:
    server, client = ("action-server", "--config", str(make_robot({}))), ("drive", "1")
    torn = (
        (server, "drive_distance/_action/status:=state", "/drive_distance/_action/status to /state"),
        (client, "rosservice://drive_distance:=go", "one rule for both"),
    )
    ended = [(spawn([*CANBASE, *command, "--ros-args", "-r", rule]), words) for command, rule, words in torn]
    for process, words in ended:
        assert process.wait(PATIENT_S) == 2, process.log()
        assert words in process.log()
        assert "Traceback" not in process.log()


def test_the_flow_of_a_client_with_callbacks(stage: GoalStage) -> None:
    # send_goal_async → done callback → get_result_async → done callback, as in every rclpy tutorial.
    told: dict[str, Any] = {"feedback": []}
    client = ActionClient(stage.node.node, DriveDistance, "drive_distance")

    def on_response(future: Any) -> None:
        told["handle"] = future.result()
        told["handle"].get_result_async().add_done_callback(on_result)

    def on_result(future: Any) -> None:
        told["result"] = future.result()

    assert client.wait_for_server(timeout_sec=5.0)
    goal = DriveDistance.Goal(distance_m=0.2, max_speed_mps=0.4)
    future = client.send_goal_async(goal, feedback_callback=lambda message: told["feedback"].append(message.feedback))
    future.add_done_callback(on_response)
    stage.node.wait_for(lambda: "result" in told, 15.0, "the result")
    assert told["handle"].accepted
    assert told["result"].status == 4
    assert told["result"].result.traveled_m == pytest.approx(0.2, abs=0.005)
    client.destroy()
    remaining = [feedback.remaining_m for feedback in told["feedback"]]
    assert remaining[0] > remaining[-1]
