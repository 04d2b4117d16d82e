"""The actions drive_on_heading, backup and spin over DDS, as a behaviour tree of Nav2 calls them."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from canbase.msg import SafetyState
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point
from nav2_msgs.action import BackUp, DriveOnHeading, Spin
from rclpy.action import ActionClient, ActionServer

from canbase_action_server.client import DriveClient
from canbase_action_server.goal_client import REJECTION_QOS
from ros.conftest import MakeRobot, Spawn
from support.fake_base import FakeBase, server_code
from support.ros_harness import Process, TestNode
from support.sros2_policy import allowed, present

pytestmark = [pytest.mark.ros, pytest.mark.timeout(90)]

KINDS: dict[str, Any] = {"drive_on_heading": DriveOnHeading, "backup": BackUp, "spin": Spin}
TOLERANCE_M = 0.005
TOLERANCE_RAD = 0.005 / 0.2


class Stage:
    """A running server before a base, and a client of each behaviour."""

    def __init__(self, node: TestNode, server: Process, names: dict[str, str]) -> None:
        """`names`: of the actions, where they are not Nav2's."""
        self.node, self.server = node, server
        self.base = FakeBase(node)
        self.clients = {kind: ActionClient(node.node, KINDS[kind], names.get(kind, kind)) for kind in KINDS}
        node.wait_for(lambda: all(each.server_is_ready() for each in self.clients.values()), 20.0, "the servers")
        node.wait_for(lambda: self.base.heard, 20.0, "the server to listen")
        node.spin_for(1.0)
        self.feedback: list[Any] = []

    def send(self, kind: str, **goal: Any) -> Any:
        """The handle of a goal, accepted or not."""
        message = KINDS[kind].Goal(**goal)
        self.feedback.clear()
        answer = self.clients[kind].send_goal_async(message, lambda each: self.feedback.append(each.feedback))
        self.node.wait_for(answer.done, 5.0, "the answer")
        return answer.result()

    def result(self, handle: Any, timeout_s: float = 15.0) -> Any:
        """Status and result."""
        result = handle.get_result_async()
        self.node.wait_for(result.done, timeout_s, "the result")
        return result.result()

    def end(self, kind: str, **goal: Any) -> tuple[int, int, str]:
        """Status, error code and message of a goal that is accepted."""
        handle = self.send(kind, **goal)
        assert handle.accepted
        wrapped = self.result(handle)
        assert abs(self.base.speed_mps) < 0.02
        return wrapped.status, wrapped.result.error_code, wrapped.result.error_msg

    def rejection(self, kind: str) -> str:
        """Why a goal is rejected now."""
        assert not self.send(kind).accepted
        return self.log_reason()

    def log_reason(self) -> str:
        """Of the newest rejection."""
        lines = [line for line in self.server.log().splitlines() if '"step": "rejected"' in line]
        return str(json.loads(lines[-1][lines[-1].index("{") :])["reason"])


def robot_yaml(make_robot: MakeRobot) -> Any:
    # A loaded test machine may hold the test's base up for longer than the 0.2 s of a robot.
    return make_robot({"timeouts": {"odometry_s": 1.0}, "action": {"nav2_behaviors": True}})


@pytest.fixture
def stage(test_node: TestNode, spawn: Spawn, make_robot: MakeRobot) -> Stage:
    return Stage(test_node, spawn(server_code(robot_yaml(make_robot))), {})


def test_each_behaviour_ends_at_its_goal_with_feedback_and_time(stage: Stage) -> None:
    for kind, goal, way_m, turn_rad in (
        ("drive_on_heading", {"target": Point(x=0.3), "speed": 0.3}, 0.3, 0.0),
        ("backup", {"target": Point(x=0.2), "speed": 0.3}, -0.2, 0.0),
        ("spin", {"target_yaw": -1.57}, 0.0, -1.57),
    ):
        x_m, y_m, yaw_rad = stage.base.x_m, stage.base.y_m, stage.base.yaw_rad
        handle = stage.send(kind, time_allowance=Duration(sec=15), **goal)
        wrapped = stage.result(handle)
        kind_of = KINDS[kind].Result
        assert (wrapped.status, wrapped.result.error_code) == (GoalStatus.STATUS_SUCCEEDED, kind_of.NONE)
        driven_m = math.hypot(stage.base.x_m - x_m, stage.base.y_m - y_m)
        assert driven_m == pytest.approx(abs(way_m), abs=TOLERANCE_M)
        assert stage.base.yaw_rad - yaw_rad == pytest.approx(turn_rad, abs=TOLERANCE_RAD)
        elapsed = wrapped.result.total_elapsed_time
        assert 0.5 < elapsed.sec + 1e-9 * elapsed.nanosec < 15.0
        last = stage.feedback[-1]
        if kind == "spin":
            assert last.angular_distance_traveled == pytest.approx(-1.57, abs=0.1)
        else:
            assert last.distance_traveled == pytest.approx(abs(way_m), abs=0.05)


def test_what_ends_a_goal_has_the_code_of_nav2_and_the_reason_in_words(stage: Stage) -> None:
    aborted = GoalStatus.STATUS_ABORTED
    status, code, text = stage.end("drive_on_heading", target=Point(x=0.3), speed=-0.3)
    assert (status, code) == (aborted, DriveOnHeading.Result.INVALID_INPUT)
    assert "same sign" in text
    status, code, text = stage.end("backup", target=Point(x=0.3, y=0.1), speed=0.3)
    assert (status, code) == (aborted, BackUp.Result.INVALID_INPUT)
    status, code, text = stage.end("spin", target_yaw=0.0)
    assert (status, code) == (aborted, Spin.Result.UNKNOWN)
    assert text.startswith("INVALID_GOAL: |angle_rad| is 0")
    assert stage.base.orders == [] or set(stage.base.orders_since(0.0)) == {0.0}
    status, code, text = stage.end("backup", target=Point(x=2.0), speed=0.2, time_allowance=Duration(sec=1))
    assert (status, code) == (aborted, BackUp.Result.TIMEOUT)
    assert "1.0 s" in text


def test_an_obstacle_is_a_collision_ahead_lost_odometry_a_tf_error_and_a_stop_unknown(stage: Stage) -> None:
    for kind, change, name in (
        ("spin", lambda base: setattr(base, "safety", _stop(SafetyState.CAUSE_OBSTACLE)), "COLLISION_AHEAD"),
        ("backup", lambda base: base.silent.add("odom"), "TF_ERROR"),
        ("drive_on_heading", lambda base: setattr(base, "safety", _stop(SafetyState.CAUSE_ESTOP)), "UNKNOWN"),
    ):
        goal = {"target_yaw": 30.0} if kind == "spin" else {"target": Point(x=2.0), "speed": 0.3}
        handle = stage.send(kind, **goal)
        stage.node.wait_for(lambda: len(stage.feedback) > 5, 5.0, "the goal to run")
        change(stage.base)
        wrapped = stage.result(handle)
        assert wrapped.status == GoalStatus.STATUS_ABORTED
        assert wrapped.result.error_code == getattr(KINDS[kind].Result, name), wrapped.result.error_msg
        stage.base.heal()
        stage.node.spin_for(0.5)


def _stop(cause: str) -> SafetyState:
    return SafetyState(action=SafetyState.STOP, cause=cause, detail="as the test says")


def test_a_cancel_ends_canceled_when_the_base_is_at_standstill(stage: Stage) -> None:
    handle = stage.send("drive_on_heading", target=Point(x=3.0), speed=0.4)
    stage.node.wait_for(lambda: stage.base.speed_mps > 0.2, 5.0, "the base to move")
    handle.cancel_goal_async()
    wrapped = stage.result(handle)
    assert wrapped.status == GoalStatus.STATUS_CANCELED
    assert wrapped.result.error_code == DriveOnHeading.Result.NONE
    assert abs(stage.base.speed_mps) < 0.02
    assert 0.02 < stage.base.x_m < 2.0


def test_a_goal_right_after_the_controller_waits_for_it_and_one_under_the_joystick_is_rejected(stage: Stage) -> None:
    stage.base.mux.active = "navigation"
    stage.node.spin_for(0.2)
    handle = stage.send("backup", target=Point(x=0.2), speed=0.3)
    assert handle.accepted
    stage.node.spin_for(0.7)
    assert stage.base.x_m == 0.0
    stage.base.mux.active = ""
    assert stage.result(handle).status == GoalStatus.STATUS_SUCCEEDED
    stage.base.mux.active = "joystick"
    stage.node.spin_for(0.2)
    assert not stage.send("spin", target_yaw=1.0).accepted
    assert "joystick" in stage.log_reason()


def test_all_actions_share_one_base(stage: Stage) -> None:
    drives = DriveClient(stage.node.node, stage.node.executor)
    drives.wait_for_server(5.0)
    handle = stage.send("spin", target_yaw=2.0)
    assert not stage.send("backup", target=Point(x=0.2), speed=0.3).accepted
    assert "busy" in stage.log_reason()
    assert stage.result(handle).status == GoalStatus.STATUS_SUCCEEDED
    drive = drives.send(0.1, 0.2).wait(10.0)
    assert drive is not None
    assert drive.status == GoalStatus.STATUS_SUCCEEDED


def test_the_shipped_sros2_policy_allows_all_that_the_server_has(stage: Stage) -> None:
    has, may = present(stage.node.node, "drive_distance_server"), allowed("drive_distance_server")
    assert "/spin/_action/send_goal" in has["reply"]
    assert {way: names - may[way] for way, names in has.items()} == {way: set() for way in has}


def test_while_another_node_serves_the_same_name_no_goal_is_driven(stage: Stage) -> None:
    with TestNode("behavior_server") as nav2:
        server = ActionServer(nav2.node, Spin, "spin", lambda _: None)  # it does not spin, and answers nothing
        rejections: list[Any] = []
        nav2.node.create_subscription(DiagnosticStatus, "spin/rejection", rejections.append, REJECTION_QOS)
        stage.base.mux.active = "joystick"  # until our server knows the other one: its rejection arrives there
        stage.node.spin_for(0.2)
        while not rejections:
            assert not stage.send("spin", target_yaw=1.0).accepted
            nav2.spin_for(0.1)
        stage.base.mux.active = ""
        stage.node.spin_for(0.2)
        assert not stage.send("spin", target_yaw=1.0).accepted
        assert "serves /spin too" in stage.log_reason()
        stage.node.wait_for(lambda: "/behavior_server serves" in stage.rejection("spin"), 10.0, "the other one's name")
        assert stage.base.yaw_rad == 0.0
        server.destroy()
    stage.node.wait_for(lambda: stage.node.node.count_services("spin/_action/send_goal") == 1, 10.0, "its end")
    stage.node.spin_for(1.0)
    assert stage.end("spin", target_yaw=0.5)[0] == GoalStatus.STATUS_SUCCEEDED


def test_the_names_can_be_remapped(test_node: TestNode, spawn: Spawn, make_robot: MakeRobot) -> None:
    code = server_code(robot_yaml(make_robot)).replace("sys.argv[1:]", "['--ros-args', '-r', 'spin:=exact/spin']")
    stage = Stage(test_node, spawn(code), {"spin": "exact/spin"})
    assert stage.end("spin", target_yaw=0.5)[0] == GoalStatus.STATUS_SUCCEEDED


def test_by_default_nav2_has_these_names_for_itself(test_node: TestNode, spawn: Spawn, make_robot: MakeRobot) -> None:
    spawn(server_code(make_robot({})))
    DriveClient(test_node.node, test_node.executor).wait_for_server(20.0)
    test_node.spin_for(1.0)
    assert [test_node.node.count_services(f"{kind}/_action/send_goal") for kind in KINDS] == [0, 0, 0]
