"""The action server as a process, over DDS, before a base of the test: every way into a goal and out of it."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from typing import Any

import pytest
from canbase.action import DriveDistance
from canbase.msg import DriverStatus, MuxSource, SafetyState
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient
from rclpy.serialization import serialize_message

from canbase_action_server.client import Drive, DriveClient, DriveFeedback, DriveResult, RejectedError
from canbase_action_server.goal_client import SERVICE_QOS
from canbase_action_server.outcome import ErrorCode, Status
from ros.conftest import MakeRobot, Spawn
from support.fake_base import FakeBase, server_code
from support.ros_harness import Process, TestNode

pytestmark = pytest.mark.ros

TOLERANCE_M = 0.005


class Stage:
    """A running server, its base, and a client."""

    def __init__(self, test_node: TestNode, server: Process) -> None:
        self.node = test_node
        self.server = server
        self.base = FakeBase(test_node)
        self.client = DriveClient(test_node.node, test_node.executor)
        self.client.wait_for_server(20.0)
        test_node.wait_for(lambda: test_node.node.count_subscribers("odom") > 0, 10.0, "the server to listen to odom")
        test_node.spin_for(0.5)

    def rejection(self, distance_m: float, speed_mps: float) -> str:
        """The reason for the rejection of this goal: in the log, and with the client."""
        before = len(self.steps())
        with pytest.raises(RejectedError) as told:
            self.client.send(distance_m, speed_mps)
        self.node.wait_for(lambda: len(self.steps()) > before, 2.0, "the log line")
        assert self.steps()[-1]["step"] == "rejected"
        assert told.value.reason == self.steps()[-1]["reason"]
        return str(told.value.reason)

    def steps(self) -> list[dict[str, Any]]:
        """The structured lines of the server's log."""
        lines = (line for line in self.server.log().splitlines() if '{"uuid"' in line)
        return [json.loads(line[line.index("{") :]) for line in lines]

    def drive_until_moving(self, distance_m: float = 2.0, speed_mps: float = 0.3) -> Drive:
        """A goal whose base is on its way."""
        drive = self.client.send(distance_m, speed_mps)
        self.node.wait_for(lambda: abs(self.base.speed_mps) > 0.15, 5.0, "the base to move")
        return drive

    def end_of(self, drive: Drive, timeout_s: float = 10.0) -> DriveResult:
        """Its result; the base stands by then, and neither moves nor gets an order to move afterwards."""
        result = drive.wait(timeout_s)
        assert result is not None
        stood_at_m, ended_s = self.base.x_m, time.monotonic()
        assert abs(self.base.speed_mps) < 0.02
        self.node.spin_for(0.6)
        assert self.base.x_m == pytest.approx(stood_at_m, abs=0.0005)
        assert [mps for mps in self.base.orders_since(ended_s) if mps != 0.0] == []
        return result


@pytest.fixture
def stage(test_node: TestNode, spawn: Spawn, make_robot: MakeRobot) -> Stage:
    # A loaded test machine may hold the test's base up for longer than the 0.2 s of a robot.
    path = make_robot({"timeouts": {"odometry_s": 0.5}, "action": {"progress_timeout_s": 1.0}})
    return Stage(test_node, spawn(server_code(path)))


def test_a_pose_that_is_set_anew_by_less_than_a_jump_ends_the_goal(stage: Stage) -> None:
    drive = stage.drive_until_moving()
    stage.base.x_m -= 0.09
    stage.base.driver.pose_resets += 1
    result = stage.end_of(drive)
    assert result.code is ErrorCode.ODOMETRY_LOST
    assert "was reset" in result.message


def test_a_base_that_turns_away_ends_the_goal_and_the_message_has_offset_angle_and_wheel(stage: Stage) -> None:
    drive = stage.drive_until_moving()
    stage.base.yaw_rad += 0.25
    result = stage.end_of(drive)
    assert result.code is ErrorCode.DRIVE_FAULT
    assert "turned away by +0.2" in result.message
    assert "left wheel" in result.message


def test_where_the_mux_does_not_hear_the_server_goals_are_rejected_and_it_lives_on(
    test_node: TestNode, spawn: Spawn, make_robot: MakeRobot
) -> None:
    robot = make_robot({"mux": {"sources": {"joystick": {"topic": "cmd_vel_joy", "priority": 1, "timeout_s": 0.3}}}})
    stage = Stage(test_node, spawn(server_code(robot)))
    for _ in range(2):
        assert "cmd_vel_action" in stage.rejection(1.0, 0.2)
    assert stage.server.exit_code is None


def test_bytes_on_odom_that_are_no_message_are_no_odometry_and_the_goal_goes_on(stage: Stage) -> None:
    drive = stage.drive_until_moving(0.6)
    publisher = stage.node.node.create_publisher(Odometry, "odom", 10)
    stage.node.wait_for(lambda: publisher.get_subscription_count() > 0, 5.0, "the server to listen")
    stage.node.wait_for(lambda: stage.base.x_m > 0.2, 5.0, "a place from which a message of zeros is a jump")
    whole = bytes(serialize_message(Odometry()))
    for length in (0, 4, len(whole) - 4):  # DDS pads to four bytes: without its last byte it arrives whole
        stage.base.silent.add("odom")  # else its next message may replace this one before the server looks at it
        publisher.publish(whole[:length])
        stage.node.spin_for(0.06)
        stage.base.silent.clear()
        stage.node.spin_for(0.1)
    result = stage.end_of(drive)
    assert (result.status, result.code) == (Status.SUCCEEDED, ErrorCode.OK)
    assert stage.server.exit_code is None


def test_goals_end_at_their_distance_and_stand(stage: Stage) -> None:
    for distance_m in (0.5, -0.3, 0.01):
        ends_at_its_distance(stage, distance_m)


def ends_at_its_distance(stage: Stage, distance_m: float) -> None:
    start_m = stage.base.x_m
    seen: list[DriveFeedback] = []
    began_s = time.monotonic()
    result = stage.end_of(stage.client.send(distance_m, 0.3, on_feedback=seen.append))
    assert (result.status, result.code) == (Status.SUCCEEDED, ErrorCode.OK)
    assert result.traveled_m == pytest.approx(distance_m, abs=TOLERANCE_M)
    assert result.traveled_m == pytest.approx(stage.base.x_m - start_m, abs=0.001)
    assert 0.0 <= result.overshoot_m <= TOLERANCE_M
    assert max(abs(mps) for mps in stage.base.orders_since(began_s)) <= 0.3 + 1e-6
    assert len(seen) >= 5
    assert len(seen) <= 12.0 * (time.monotonic() - began_s)  # action.feedback_hz is 10


def test_each_step_of_a_goal_is_one_structured_line(stage: Stage) -> None:
    drive = stage.client.send(1.0, 0.3)
    stage.end_of(drive, 20.0)
    mine = [step for step in stage.steps() if step["uuid"] == drive.uuid]
    feedback = [step for step in mine if step["step"] == "feedback"]
    others = [step for step in mine if step not in feedback]
    assert [step["step"] for step in others] == ["accepted", "started", "stopping", "standstill", "ended"]
    assert (mine[-1]["status"], mine[-1]["error_code"]) == ("SUCCEEDED", "OK")
    assert mine[-1]["traveled_m"] == pytest.approx(1.0, abs=TOLERANCE_M)
    assert 3.0 < mine[-1]["duration_s"] < 15.0
    assert 2 <= len(feedback) <= mine[-1]["duration_s"]  # the client gets ten times as many
    for step in (*feedback, others[2]):
        assert step["traveled_m"] + step["remaining_m"] == pytest.approx(1.0, abs=0.001)
    traveled = [step["traveled_m"] for step in feedback]
    assert traveled == sorted(traveled)


def test_goals_out_of_range_are_rejected_and_nothing_is_ordered(stage: Stage) -> None:
    for distance_m in (100.0, 5.001, 0.0, 0.009, -5.001):
        assert "|distance_m| is" in stage.rejection(distance_m, 0.2)
    for speed_mps in (9.0, 0.501, 0.019, 0.0, -0.2):
        assert "max_speed_mps is" in stage.rejection(1.0, speed_mps)
    for number in (math.nan, math.inf, -math.inf):
        assert "expected a finite number" in stage.rejection(number, 0.2)
        assert "expected a finite number" in stage.rejection(1.0, number)
    stage.node.spin_for(0.2)
    assert stage.base.orders == []


def estop(base: FakeBase) -> None:
    base.safety = SafetyState(action=SafetyState.STOP, cause=SafetyState.CAUSE_ESTOP, detail="pressed", estop=True)


def stop_for(cause: str) -> Callable[[FakeBase], None]:
    def change(base: FakeBase) -> None:
        base.safety = SafetyState(action=SafetyState.STOP, cause=cause, detail="as the test says")

    return change


def fault(base: FakeBase) -> None:
    base.driver.state, base.driver.cause, base.driver.detail = DriverStatus.LATCHED, "drive_fault", "left: 0x2310"


def trip(base: FakeBase) -> None:
    fault(base)  # a tripped watchdog disables the drives: the goal must name the watchdog
    base.driver.watchdog, base.driver.watchdog_cause = DriverStatus.WATCHDOG_TRIPPED, "lease lost"


def joystick(base: FakeBase) -> None:
    base.mux.active = "joystick"


def lock(base: FakeBase) -> None:
    base.mux.sources = [MuxSource(name="action", locked=True, reason="locked: pause holds")]


def no_odometry(base: FakeBase) -> None:
    base.silent.add("odom")


def stick(base: FakeBase) -> None:
    base.stuck = True


def jump(base: FakeBase) -> None:
    base.x_m += 10.0


def test_a_robot_that_cannot_drive_rejects_a_goal(stage: Stage) -> None:
    for change, reason in (
        (estop, "emergency stop"),
        (fault, "not enabled"),
        (trip, "watchdog"),
        (joystick, "joystick"),
        (stop_for(SafetyState.CAUSE_SCAN_STALE), "laser scan lost: as the test says"),
        (stop_for(SafetyState.CAUSE_COMMAND_STALE), "stops the base (command_stale)"),
        (lock, "velocity_mux holds action back: locked: pause holds; unlock it first"),
        (no_odometry, "no message on odom"),
    ):
        change(stage.base)
        stage.node.spin_for(0.7)
        assert reason in stage.rejection(1.0, 0.2)
        stage.base.heal()
        stage.node.spin_for(0.2)
    assert stage.base.orders == []


def test_what_goes_wrong_on_the_way_aborts_the_goal_with_its_own_code_and_the_next_goal_runs(stage: Stage) -> None:
    for change, code in (
        (estop, ErrorCode.ESTOP),
        (stop_for(SafetyState.CAUSE_ESTOP_STALE), ErrorCode.ESTOP),
        (stop_for(SafetyState.CAUSE_OBSTACLE), ErrorCode.BLOCKED),
        (stop_for(SafetyState.CAUSE_SCAN_STALE), ErrorCode.SCAN_LOST),
        (fault, ErrorCode.DRIVE_FAULT),
        (trip, ErrorCode.WATCHDOG),
        (no_odometry, ErrorCode.ODOMETRY_LOST),
        (jump, ErrorCode.ODOMETRY_LOST),
        (stick, ErrorCode.NO_PROGRESS),
    ):
        drive = stage.drive_until_moving()
        change(stage.base)
        result = stage.end_of(drive)
        assert (result.status, result.code) == (Status.ABORTED, code), result.message
        assert stage.steps()[-1]["error_code"] == code.name
        stage.base.heal()
        stage.node.spin_for(0.2)


@pytest.mark.parametrize(
    ("name", "topic", "code"),
    [
        ("mux", "velocity_mux/state", ErrorCode.TAKEN_OVER),
        ("safety", "safety_filter/state", ErrorCode.ESTOP),
        ("driver", "motor_driver/status", ErrorCode.DRIVE_FAULT),
    ],
)
def test_a_state_that_is_lost_ends_the_goal(stage: Stage, name: str, topic: str, code: ErrorCode) -> None:
    drive = stage.drive_until_moving()
    stage.base.silent.add(name)
    lost_s = time.monotonic()
    result = stage.end_of(drive)
    assert (result.status, result.code) == (Status.ABORTED, code), result.message
    assert f"no message on {topic} for 0.3" in result.message
    assert set(stage.base.orders_since(lost_s + 0.5)) <= {0.0}
    assert topic in stage.rejection(1.0, 0.2)


def test_a_base_that_rolls_over_its_goal_stands_there_and_is_told_so(stage: Stage) -> None:
    drive = stage.drive_until_moving(0.5, 0.4)
    stage.base.ramp_mps2 = 0.2
    result = stage.end_of(drive)
    assert (result.status, result.code) == (Status.ABORTED, ErrorCode.OVERSHOOT), result.message
    assert result.overshoot_m > 0.01
    assert result.traveled_m == pytest.approx(0.5 + result.overshoot_m, abs=0.001)


def test_a_joystick_takes_the_base_over_at_once(stage: Stage) -> None:
    drive = stage.drive_until_moving()
    joystick(stage.base)
    changed_s = time.monotonic()
    result = drive.wait(5.0)
    assert result is not None
    assert (result.status, result.code) == (Status.ABORTED, ErrorCode.TAKEN_OVER)
    assert time.monotonic() - changed_s < 0.5
    stage.node.spin_for(0.5)
    assert set(stage.base.orders_since(changed_s + 0.3)) <= {0.0}


def test_the_overall_time_ends_a_base_that_creeps(test_node: TestNode, spawn: Spawn, make_robot: MakeRobot) -> None:
    changes = {"action": {"overall_factor": 1.1, "overall_extra_s": 0.5}, "timeouts": {"odometry_s": 0.5}}
    stage = Stage(test_node, spawn(server_code(make_robot(changes))))
    drive = stage.client.send(0.3, 0.5)
    deadline_s = time.monotonic() + 10.0
    while drive.result is None and time.monotonic() < deadline_s:
        stage.base.speed_mps = min(stage.base.speed_mps, 0.02)
        stage.node.spin_for(0.02)
    assert drive.result is not None
    assert (drive.result.status, drive.result.code) == (Status.ABORTED, ErrorCode.TIMEOUT)


def test_a_cancel_ends_canceled_only_when_the_base_stands(stage: Stage) -> None:
    drive = stage.drive_until_moving(2.0, 0.4)
    asked_s = time.monotonic()
    assert drive.cancel()
    assert time.monotonic() - asked_s < 0.5
    assert drive.result is None  # accepted, but the base still moves
    result = stage.end_of(drive)
    assert (result.status, result.code) == (Status.CANCELED, ErrorCode.CANCELED)
    assert 0.0 < result.traveled_m < 2.0
    assert "cancel requested" in [step["step"] for step in stage.steps()]


def test_a_fault_during_the_stop_of_a_cancel_is_not_called_canceled(stage: Stage) -> None:
    drive = stage.drive_until_moving(2.0, 0.5)
    assert drive.cancel()
    fault(stage.base)
    assert stage.end_of(drive).code is ErrorCode.DRIVE_FAULT


def test_a_second_goal_is_rejected_while_one_runs_and_accepted_afterwards(stage: Stage) -> None:
    first = stage.drive_until_moving(0.5)
    with pytest.raises(RejectedError):
        stage.client.send(0.1, 0.2)
    assert "busy" in next(step for step in stage.steps() if step["step"] == "rejected")["reason"]
    assert stage.end_of(first).code is ErrorCode.OK
    assert stage.end_of(stage.client.send(-0.1, 0.2)).code is ErrorCode.OK


def test_many_goals_at_once_find_exactly_one_owner(stage: Stage) -> None:
    goal = DriveDistance.Goal(distance_m=0.2, max_speed_mps=0.3)
    deep = {"goal_service_qos_profile": SERVICE_QOS}
    clients = [ActionClient(stage.node.node, DriveDistance, "drive_distance", **deep) for _ in range(4)]
    stage.node.wait_for(lambda: all(client.server_is_ready() for client in clients), 5.0, "all clients")
    answers = [client.send_goal_async(goal) for client in clients for _ in range(5)]
    stage.node.wait_for(lambda: all(answer.done() for answer in answers), 5.0, "all answers")
    assert [answer.result().accepted for answer in answers].count(True) == 1
    stage.node.wait_for(lambda: "ended" in [step["step"] for step in stage.steps()], 10.0, "the end")


@pytest.mark.parametrize("end", [Process.terminate, Process.interrupt])
def test_a_server_that_is_told_to_end_stops_the_base_and_delivers_the_result(
    stage: Stage, end: Callable[[Process], None]
) -> None:
    drive = stage.drive_until_moving()
    end(stage.server)
    result = stage.end_of(drive)
    assert (result.status, result.code) == (Status.ABORTED, ErrorCode.SHUTDOWN)
    assert stage.server.wait(5.0) == 0


def test_a_server_without_a_goal_ends_at_once(stage: Stage) -> None:
    stage.server.terminate()
    assert stage.server.wait(3.0) == 0


def test_a_defect_stops_the_base_ends_the_goal_and_the_process(
    test_node: TestNode, spawn: Spawn, make_robot: MakeRobot
) -> None:
    broken = (
        "from canbase_action_server import goal\n"
        "sound = goal.GoalRun.tick\n"
        "def tick(self, inputs, now):\n"
        "    if self.traveled_m > 0.1: raise ZeroDivisionError('a defect')\n"
        "    return sound(self, inputs, now)\n"
        "goal.GoalRun.tick = tick\n"
    )
    stage = Stage(test_node, spawn(broken + server_code(make_robot({"timeouts": {"odometry_s": 0.5}}))))
    result = stage.end_of(stage.drive_until_moving())
    assert (result.status, result.code) == (Status.ABORTED, ErrorCode.INTERNAL)
    assert "ZeroDivisionError" in result.message
    assert stage.server.wait(5.0) == 1
    assert "a defect" in stage.server.log()


def test_a_defect_in_the_callback_of_a_goal_stops_the_base_too(
    test_node: TestNode, spawn: Spawn, make_robot: MakeRobot
) -> None:
    """A second goal comes, and what judges it breaks: it is rejected, and the first one ends as it must."""
    broken = (
        "from canbase_action_server.goal_queue import GoalQueue\n"
        "sound = GoalQueue.refusal\n"
        "def refusal(self, request, inputs, now):\n"
        "    if self.busy: raise ZeroDivisionError('a defect')\n"
        "    return sound(self, request, inputs, now)\n"
        "GoalQueue.refusal = refusal\n"
    )
    stage = Stage(test_node, spawn(broken + server_code(make_robot({"timeouts": {"odometry_s": 0.5}}))))
    drive = stage.drive_until_moving()
    with pytest.raises(RejectedError):
        stage.client.send(0.7, 0.2)
    result = stage.end_of(drive)
    assert (result.status, result.code) == (Status.ABORTED, ErrorCode.INTERNAL)
    assert stage.server.wait(5.0) == 1
    assert "a defect" in stage.server.log()


def test_a_defect_in_the_callback_of_a_cancel_stops_the_base_too(
    test_node: TestNode, spawn: Spawn, make_robot: MakeRobot
) -> None:
    broken = (
        "from canbase_action_server.node import DriveDistanceServer\n"
        "def broken(self, handle): raise ZeroDivisionError('a defect')\n"
        "DriveDistanceServer._on_cancel = broken\n"
    )
    stage = Stage(test_node, spawn(broken + server_code(make_robot({"timeouts": {"odometry_s": 0.5}}))))
    drive = stage.drive_until_moving()
    assert not drive.cancel()
    result = stage.end_of(drive)
    assert (result.status, result.code) == (Status.ABORTED, ErrorCode.INTERNAL)
    assert stage.server.wait(5.0) == 1


def test_a_defect_in_taking_on_a_goal_ends_the_process_in_order(
    test_node: TestNode, spawn: Spawn, make_robot: MakeRobot
) -> None:
    broken = (
        "from canbase_action_server.goal_queue import GoalQueue\n"
        "def broken(self, key, request, now): raise ZeroDivisionError('a defect')\n"
        "GoalQueue.admit = broken\n"
    )
    stage = Stage(test_node, spawn(broken + server_code(make_robot({"timeouts": {"odometry_s": 0.5}}))))
    stage.client.send(0.7, 0.2)
    assert stage.server.wait(5.0) == 1
    assert "a defect" in stage.server.log()
    assert stage.base.speed_mps == 0.0


def test_a_defect_in_making_the_result_is_no_success_with_code_ok(
    test_node: TestNode, spawn: Spawn, make_robot: MakeRobot
) -> None:
    """Its status would be out already, and rclpy would send a result of zeros, whose error code is OK."""
    broken = (
        "from canbase_action_server import drive_messages\n"
        "def broken(outcome): raise ZeroDivisionError('a defect')\n"
        "drive_messages._result = broken\n"
    )
    stage = Stage(test_node, spawn(broken + server_code(make_robot({"timeouts": {"odometry_s": 0.5}}))))
    result = stage.end_of(stage.client.send(0.05, 0.3))
    assert (result.status, result.code) == (Status.ABORTED, ErrorCode.INTERNAL)
    assert stage.server.wait(5.0) == 1
    assert "a defect" in stage.server.log()
