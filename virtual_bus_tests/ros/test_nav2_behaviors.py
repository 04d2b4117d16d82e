"""The actions drive_on_heading, backup and spin over DDS, as a behaviour tree of Nav2 calls them."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from canbase.msg import SafetyState
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point
from nav2_msgs.action import BackUp, DriveOnHeading, Spin
from rclpy.action import ActionClient, ActionServer

from canbase_action_server.goal_client import REJECTION_QOS
from support.goal_stage import PATIENT_S, GoalStage, goal_stage
from support.ros_harness import TestNode
from support.sros2_policy import allowed, present

pytestmark = [pytest.mark.ros, pytest.mark.timeout(90)]

KINDS: dict[str, Any] = {"drive_on_heading": DriveOnHeading, "backup": BackUp, "spin": Spin}
TOLERANCE_M = 0.005
TOLERANCE_RAD = 0.005 / 0.2


class Behaviors:
    """A client of each behaviour."""

    def __init__(self, stage: GoalStage) -> None:
        self.goals, self.node, self.base = stage, stage.node, stage.base
        self.clients = {kind: ActionClient(stage.node.node, KINDS[kind], kind) for kind in KINDS}
        ready = lambda: all(each.server_is_ready() for each in self.clients.values())  # noqa: E731
        stage.node.wait_for(ready, PATIENT_S, "the servers")
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
        return self.goals.last_reason()


@pytest.fixture(scope="module")
def running() -> Iterator[Behaviors]:
    with goal_stage({"action": {"nav2_behaviors": True}}) as stage:
        yield Behaviors(stage)


@pytest.fixture
def stage(running: Behaviors) -> Iterator[Behaviors]:
    running.goals.recovered()
    yield running
    print(running.goals.server.log()[-3000:])


def test_each_behaviour_ends_at_its_goal_with_feedback_and_time(stage: Behaviors) -> None:
    for kind, goal, way_m, turn_rad in (
        ("drive_on_heading", {"target": Point(x=0.3), "speed": 0.3}, 0.3, 0.0),
        ("backup", {"target": Point(x=0.2), "speed": 0.3}, -0.2, 0.0),
        ("spin", {"target_yaw": -1.57}, 0.0, -1.57),
    ):
        stage.goals.recovered()
        handle = stage.send(kind, time_allowance=Duration(sec=15), **goal)
        wrapped = stage.result(handle)
        kind_of = KINDS[kind].Result
        assert (wrapped.status, wrapped.result.error_code) == (GoalStatus.STATUS_SUCCEEDED, kind_of.NONE)
        driven_m = math.hypot(stage.base.x_m, stage.base.y_m)
        assert driven_m == pytest.approx(abs(way_m), abs=TOLERANCE_M)
        assert stage.base.yaw_rad == pytest.approx(turn_rad, abs=TOLERANCE_RAD)
        elapsed = wrapped.result.total_elapsed_time
        assert 0.5 < elapsed.sec + 1e-9 * elapsed.nanosec < 15.0
        last = stage.feedback[-1]
        if kind == "spin":
            assert last.angular_distance_traveled == pytest.approx(-1.57, abs=0.1)
        else:
            assert last.distance_traveled == pytest.approx(abs(way_m), abs=0.05)


def test_what_ends_a_goal_has_the_code_of_nav2_and_the_reason_in_words(stage: Behaviors) -> None:
    aborted, began_s = GoalStatus.STATUS_ABORTED, time.monotonic()
    status, code, text = stage.end("drive_on_heading", target=Point(x=0.3), speed=-0.3)
    assert (status, code) == (aborted, DriveOnHeading.Result.INVALID_INPUT)
    assert "same sign" in text
    status, code, text = stage.end("backup", target=Point(x=0.3, y=0.1), speed=0.3)
    assert (status, code) == (aborted, BackUp.Result.INVALID_INPUT)
    status, code, text = stage.end("spin", target_yaw=0.0)
    assert (status, code) == (aborted, Spin.Result.UNKNOWN)
    assert text.startswith("INVALID_GOAL: |angle_rad| is 0")
    assert set(stage.base.orders_since(began_s)) <= {0.0}
    status, code, text = stage.end("backup", target=Point(x=2.0), speed=0.2, time_allowance=Duration(sec=1))
    assert (status, code) == (aborted, BackUp.Result.TIMEOUT)
    assert "1.0 s" in text


def test_an_obstacle_is_a_collision_ahead_lost_odometry_a_tf_error_and_a_stop_unknown(stage: Behaviors) -> None:
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
        stage.goals.recovered()


def _stop(cause: str) -> SafetyState:
    return SafetyState(action=SafetyState.STOP, cause=cause, detail="as the test says")


def test_a_cancel_ends_canceled_when_the_base_is_at_standstill(stage: Behaviors) -> None:
    handle = stage.send("drive_on_heading", target=Point(x=3.0), speed=0.4)
    stage.node.wait_for(lambda: stage.base.speed_mps > 0.2, 5.0, "the base to move")
    handle.cancel_goal_async()
    wrapped = stage.result(handle)
    assert wrapped.status == GoalStatus.STATUS_CANCELED
    assert wrapped.result.error_code == DriveOnHeading.Result.NONE
    assert abs(stage.base.speed_mps) < 0.02
    assert 0.02 < stage.base.x_m < 2.0


def test_the_shipped_sros2_policy_allows_all_that_the_server_has(stage: Behaviors) -> None:
    has, may = present(stage.node.node, "drive_distance_server"), allowed("drive_distance_server")
    assert "/spin/_action/send_goal" in has["reply"]
    assert {way: names - may[way] for way, names in has.items()} == {way: set() for way in has}


def test_while_another_node_serves_the_same_name_no_goal_is_driven(stage: Behaviors) -> None:
    with TestNode("behavior_server", domain_id=stage.goals.domain) as nav2:
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
        assert "serves /spin too" in stage.goals.last_reason()
        stage.node.wait_for(lambda: "/behavior_server serves" in stage.rejection("spin"), 10.0, "the other one's name")
        assert stage.base.yaw_rad == 0.0
        server.destroy()
    stage.node.wait_for(lambda: stage.node.node.count_services("spin/_action/send_goal") == 1, 10.0, "its end")
    stage.node.spin_for(1.0)
    assert stage.end("spin", target_yaw=0.5)[0] == GoalStatus.STATUS_SUCCEEDED
