"""`canbase drive`, the Python client, and the flow of a hand-written client, against the real server."""

from __future__ import annotations

import json
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from canbase.action import DriveDistance
from canbase.msg import DriverStatus
from rclpy.action import ActionClient
from rclpy.node import Node

from canbase_action_server.action_servers import actions_of
from canbase_action_server.client import DriveClient, NoResponseError, NoServerError, RejectedError, ServerLostError
from canbase_action_server.outcome import Status
from canbase_action_server.rotate_client import RotateClient
from ros.conftest import MakeRobot, Spawn
from support.fake_base import FakeBase, server_code
from support.ros_harness import Process, TestNode

pytestmark = pytest.mark.ros

CANBASE = (sys.executable, "-c", "from canbase_cli.main import app; app()")


class Stage:
    """A running server before a base."""

    def __init__(self, test_node: TestNode, spawn: Spawn, make_robot: MakeRobot, **server_environment: str) -> None:
        self.node = test_node
        self.spawn = spawn
        code = server_code(make_robot({"timeouts": {"odometry_s": 0.5}}))
        self.server = spawn(code, server_environment)
        self.base = FakeBase(test_node)
        self.client = DriveClient(test_node.node, test_node.executor)
        self.client.wait_for_server(20.0)
        test_node.spin_for(1.0)

    def canbase_drive(self, *arguments: str) -> Process:
        """`canbase drive …`, started."""
        return self.spawn([*CANBASE, "drive", *arguments])

    def exit_code(self, process: Process, timeout_s: float = 20.0) -> int:
        """Of a process that ends by itself, while the base goes on."""
        self.node.wait_for(lambda: process.exit_code is not None, timeout_s, f"the end of it:\n{process.log()}")
        return process.wait(1.0)

    def wait_until_moving(self) -> None:
        """The base is on its way."""
        self.node.wait_for(lambda: abs(self.base.speed_mps) > 0.1, 10.0, "the base to move")


@pytest.fixture
def stage(test_node: TestNode, spawn: Spawn, make_robot: MakeRobot) -> Stage:
    return Stage(test_node, spawn, make_robot)


def test_exit_codes_tell_the_ends_apart(stage: Stage) -> None:
    forward = stage.canbase_drive("0.3", "--speed", "0.3")
    assert stage.exit_code(forward) == 0, forward.log()
    assert "SUCCEEDED (OK)" in forward.log()
    assert "m left" in forward.log()  # no terminal: lines instead of a bar
    assert "\x1b" not in forward.log()

    backward = stage.canbase_drive("-0.3", "--json")
    assert stage.exit_code(backward) == 0, backward.log()
    told = json.loads(backward.log())
    assert (told["status"], told["code"]) == ("SUCCEEDED", "OK")
    assert told["traveled_m"] == pytest.approx(-0.3, abs=0.005)

    assert stage.exit_code(stage.canbase_drive("100", "--speed", "9")) == 5
    assert stage.exit_code(stage.canbase_drive("far")) == 2
    assert stage.exit_code(stage.canbase_drive("1", "--wait", "1", "--namespace", "elsewhere")) == 6

    aborted = stage.canbase_drive("2", "--speed", "0.3")
    stage.wait_until_moving()
    stage.base.driver.state = DriverStatus.LATCHED
    assert stage.exit_code(aborted) == 4
    assert "DRIVE_FAULT" in aborted.log()


def test_a_rejected_goal_names_the_limit_and_its_key(stage: Stage) -> None:
    for words, reason in (
        (("drive", "100"), "|distance_m| is 100, outside 0.01 to 5.0 (action.max_distance_m of robot.yaml)"),
        (("drive", "1", "--speed", "9"), "(action.max_speed_mps of robot.yaml)"),
        (("rotate", "1", "--speed", "99"), "(action.max_speed_radps of robot.yaml)"),
    ):
        goal = stage.spawn([*CANBASE, *words])
        assert stage.exit_code(goal) == 5
        assert goal.log().strip().endswith(reason), goal.log()
    with pytest.raises(RejectedError) as told:
        stage.client.send(0.1, 0.3 + 9.0)
    assert told.value.reason is not None
    assert "action.max_speed_mps" in told.value.reason


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


def test_a_server_that_gives_no_reason_is_asked_for_it_no_longer_than_a_second(
    test_node: TestNode, spawn: Spawn
) -> None:
    spawn(REASONLESS_SERVER)
    client = DriveClient(test_node.node, test_node.executor)
    client.wait_for_server(20.0)
    sent_s = time.monotonic()
    with pytest.raises(RejectedError, match="the reason is in the log of its server") as told:
        client.send(1.0, 0.2)
    assert told.value.reason is None
    assert time.monotonic() - sent_s < 3.0


def test_ctrl_c_cancels_and_waits_until_the_base_stands(stage: Stage) -> None:
    drive = stage.canbase_drive("3", "--speed", "0.4")
    stage.wait_until_moving()
    drive.interrupt()
    assert stage.exit_code(drive) == 3, drive.log()
    assert abs(stage.base.speed_mps) < 0.02
    assert "CANCELED" in drive.log()


def test_cancel_after_cancels_the_goal(stage: Stage) -> None:
    drive = stage.canbase_drive("3", "--speed", "0.2", "--cancel-after", "1.0")
    assert stage.exit_code(drive) == 3, drive.log()
    assert abs(stage.base.speed_mps) < 0.02
    assert "the server accepts the cancel\nCANCELED" in drive.log()


def test_a_second_ctrl_c_gives_up_waiting_and_says_so(stage: Stage) -> None:
    drive = stage.canbase_drive("3", "--speed", "0.4")
    stage.wait_until_moving()
    stage.server.stop()  # hangs: no final status will come
    drive.interrupt()
    stage.node.spin_for(0.5)
    drive.interrupt()
    assert stage.exit_code(drive) in (1, 6)
    assert "may still move" in drive.log()
    stage.server.resume()


SHORT_LEASE = """<dds><profiles xmlns="http://www.eprosima.com">
  <participant profile_name="short_lease" is_default_profile="true"><rtps><builtin><discovery_config>
    <leaseDuration><sec>3</sec></leaseDuration><leaseAnnouncement><sec>1</sec></leaseAnnouncement>
  </discovery_config></builtin></rtps></participant>
</profiles></dds>"""
"""Fast DDS misses a process that was killed after 3 s. By default it takes 20 s."""


def test_a_server_that_dies_is_told_and_the_goal_is_not_sent_again(
    test_node: TestNode, spawn: Spawn, make_robot: MakeRobot, tmp_path: Path
) -> None:
    profile = tmp_path / "short_lease.xml"
    profile.write_text(SHORT_LEASE, encoding="utf-8")
    stage = Stage(test_node, spawn, make_robot, FASTRTPS_DEFAULT_PROFILES_FILE=str(profile))
    client = DriveClient(test_node.node, test_node.executor, feedback_timeout_s=60.0)
    drive = client.send(2.0, 0.3)
    stage.wait_until_moving()
    stage.server.kill()
    with pytest.raises(ServerLostError):
        drive.wait(30.0)
    stage.node.spin_for(0.5)
    assert stage.base.speed_mps == pytest.approx(0.0, abs=0.001)


def test_a_server_that_does_not_answer_is_an_error_of_its_own_and_its_late_goal_is_canceled(stage: Stage) -> None:
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
import time, rclpy
from canbase.action import DriveDistance
from rclpy.action import ActionClient
from rclpy.node import Node
rclpy.init()
node = rclpy.create_node("deaf")
client = ActionClient(node, DriveDistance, "drive_distance")
client.wait_for_server()
print("found", flush=True)
time.sleep(3.0)
client.send_goal_async(DriveDistance.Goal(distance_m=1.0, max_speed_mps=0.3))
print("sent", flush=True)
time.sleep(60.0)
"""


def test_a_goal_that_waited_in_a_server_that_stood_still_never_starts(stage: Stage) -> None:
    client = stage.spawn(DEAF_CLIENT)
    stage.node.wait_for(lambda: "found" in client.log(), 20.0, "the client to find the server")
    stage.node.spin_for(1.5)  # and the server the client: else its request is never delivered
    stage.server.stop()
    stage.node.wait_for(lambda: "sent" in client.log(), 10.0, "the goal to be sent")
    stage.node.spin_for(3.0)
    resumed_s = time.monotonic()
    stage.server.resume()
    stage.node.wait_for(lambda: '"step": "rejected"' in stage.server.log(), 10.0, "its rejection")
    assert "did not run before it" in stage.server.log()
    stage.node.spin_for(4.0)  # RESENT_S: until then no goal is taken for a new one
    assert set(stage.base.orders_since(resumed_s)) <= {0.0}
    again = stage.canbase_drive("0.1", "--speed", "0.1")  # the server is well
    assert stage.exit_code(again) == 0, again.log()


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


def test_a_client_that_ends_before_the_acceptance_leaves_its_cancel_behind(test_node: TestNode, spawn: Spawn) -> None:
    server = spawn(SLOW_SERVER)
    drive = spawn([*CANBASE, "drive", "1.0"])
    test_node.wait_for(lambda: "asked" in server.log(), 20.0, "the goal to arrive")
    drive.interrupt()
    test_node.wait_for(lambda: drive.exit_code is not None, 1.5, f"its end:\n{drive.log()}")
    assert drive.wait(1.0) == 3
    assert "accepted" not in server.log()
    test_node.wait_for(lambda: "cancel requested" in server.log(), 5.0, "the cancel, after the acceptance")
    assert server.log().index("accepted") < server.log().index("cancel requested")


def test_clients_share_the_executor_of_their_node(stage: Stage) -> None:
    drive, rotate, other = (kind(stage.node.node) for kind in (DriveClient, RotateClient, DriveClient))
    for client in (drive, other):
        result = client.send(0.2, 0.3).wait(20.0)
        assert result is not None
        assert result.status is Status.SUCCEEDED
    with pytest.raises(RejectedError):
        rotate.send(1.0, 99.0)


def test_clients_on_a_node_without_an_executor_share_one(test_node: TestNode) -> None:
    node = Node("application", context=test_node.node.context)
    first, second = DriveClient(node), RotateClient(node)
    assert node.executor is not None
    assert first._executor is second._executor is node.executor
    node.destroy_node()


def test_no_server_is_an_error_of_its_own(test_node: TestNode) -> None:
    with pytest.raises(NoServerError, match="drive_distance"):
        DriveClient(test_node.node, test_node.executor).wait_for_server(0.5)


def test_a_namespace_is_another_robot(test_node: TestNode, spawn: Spawn, make_robot: MakeRobot) -> None:
    spawn([sys.executable, "-c", server_code(make_robot({})), "--ros-args", "-r", "__ns:=/robot1"])
    there = ActionClient(test_node.node, DriveDistance, "/robot1/drive_distance")
    here = ActionClient(test_node.node, DriveDistance, "drive_distance")
    test_node.wait_for(there.server_is_ready, 20.0, "the server in /robot1")
    assert not here.server_is_ready()


def test_remaps_of_the_action_on_both_sides_meet(test_node: TestNode, spawn: Spawn, make_robot: MakeRobot) -> None:
    lease = {"timeouts": {"odometry_s": 0.5}, "action": {"require_client_lease": True}}
    spawn([sys.executable, "-c", server_code(make_robot(lease)), "--ros-args", "-r", "drive_distance:=go"])
    base = FakeBase(test_node)
    test_node.wait_for(lambda: base.heard, 20.0, "the server to listen")
    remap = ("--namespace", "elsewhere", "--ros-args", "-r", "drive_distance:=/go")
    drive = spawn([*CANBASE, "drive", "0.5", "--speed", "0.3", *remap])
    test_node.wait_for(lambda: drive.exit_code is not None, 20.0, "its end")
    assert drive.exit_code == 0, drive.log()  # a lease that is not kept beside the action would have ended it
    assert base.x_m == pytest.approx(0.5, abs=0.005)


PARTS = ("send_goal", "cancel_goal", "get_result", "feedback", "status")


def test_the_server_with_another_node_name_and_all_five_parts_remapped_serves_under_the_new_name(
    test_node: TestNode, spawn: Spawn, make_robot: MakeRobot
) -> None:
    parts = [("-r", f"drive_distance/_action/{part}:=/far/go/_action/{part}") for part in PARTS]
    rules = ("-r", "__node:=goals", "-r", "goals:rotate_angle:=turn", *(word for rule in parts for word in rule))
    robot = make_robot({"timeouts": {"odometry_s": 0.5}})
    spawn([sys.executable, "-c", server_code(robot), "--ros-args", *rules])
    base = FakeBase(test_node)
    test_node.wait_for(lambda: base.heard, 20.0, "the server to listen")
    expected = {"/far/go", "/turn"}
    test_node.wait_for(lambda: actions_of(test_node.node, "goals", "/") == expected, 20.0, "both names")
    services = {name for name, _types in test_node.node.get_service_names_and_types_by_node("goals", "/")}
    assert "/drive_distance_server/cancel_goals" in services
    assert actions_of(test_node.node, "nobody", "/") == set()  # a node that has just ended is no error
    goals = (("drive", "0.2", "drive_distance:=/far/go"), ("rotate", "0.5", "rotate_angle:=turn"))
    for command, goal, remap in goals:
        sent = spawn([*CANBASE, command, goal, "--wait", "20", "--ros-args", "-r", remap])
        test_node.wait_for(partial(_has_ended, sent), 40.0, "its end")
        assert sent.exit_code == 0, sent.log()


def _has_ended(process: Process) -> bool:
    return process.exit_code is not None


def test_rules_that_would_tear_an_action_apart_end_server_and_client_with_a_message(
    spawn: Spawn, make_robot: MakeRobot
) -> None:
    config = str(make_robot({}))
    one, half = "drive_distance/_action/status:=state", "rosservice://drive_distance:=go"
    for rule, words in ((one, "/drive_distance/_action/status to /state"), (half, "one rule for both")):
        for command in (("action-server", "--config", config), ("drive", "1")):
            process = spawn([*CANBASE, *command, "--ros-args", "-r", rule])
            assert process.wait(40.0) == 2, process.log()
            assert words in process.log()
            assert "Traceback" not in process.log()


def test_the_flow_of_a_client_with_callbacks(stage: Stage) -> None:
    # send_goal_async → done callback → get_result_async → done callback, as in every rclpy tutorial.
    told: dict[str, Any] = {"feedback": []}
    client = ActionClient(stage.node.node, DriveDistance, "drive_distance")

    def on_response(future: Any) -> None:
        told["handle"] = future.result()
        told["handle"].get_result_async().add_done_callback(on_result)

    def on_result(future: Any) -> None:
        told["result"] = future.result()

    assert client.wait_for_server(timeout_sec=5.0)
    goal = DriveDistance.Goal(distance_m=0.5, max_speed_mps=0.4)
    future = client.send_goal_async(goal, feedback_callback=lambda message: told["feedback"].append(message.feedback))
    future.add_done_callback(on_response)
    stage.node.wait_for(lambda: "result" in told, 15.0, "the result")
    assert told["handle"].accepted
    assert told["result"].status == 4
    assert told["result"].result.traveled_m == pytest.approx(0.5, abs=0.005)
    remaining = [feedback.remaining_m for feedback in told["feedback"]]
    assert remaining[0] > remaining[-1]
