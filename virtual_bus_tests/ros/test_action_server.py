"""The action server as a process, over DDS, before a base of the test: what arrives, what is answered, how it ends.

Which code a goal ends with: unit/action_server, unit/chain/test_goal_codes.py; on a whole robot: test_stack_topics.py.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

import pytest
from canbase.action import DriveDistance
from canbase.msg import DriverStatus, SafetyState
from nav_msgs.msg import Odometry
from rclpy.action import ActionClient
from rclpy.serialization import serialize_message

from canbase_action_server.client import Drive, DriveFeedback, RejectedError
from canbase_action_server.goal_client import SERVICE_QOS
from canbase_action_server.outcome import ErrorCode, Status
from canbase_action_server.rotate_client import RotateClient, RotateFeedback
from support.fake_base import FakeBase
from support.goal_stage import PATIENT_S, GoalStage, goal_stage

pytestmark = pytest.mark.ros

TOLERANCE_M = 0.005
LEVER_M = 0.2
"""Half the track of the tests' robot."""
TOLERANCE_RAD = TOLERANCE_M / LEVER_M


@pytest.fixture(scope="module")
def running() -> Iterator[GoalStage]:
    with goal_stage() as stage:
        yield stage


@pytest.fixture
def stage(running: GoalStage) -> Iterator[GoalStage]:
    yield running.recovered()
    print(running.server.log()[-3000:])


def test_by_default_nav2_has_its_names_for_itself(stage: GoalStage) -> None:
    stage.client.wait_for_server(PATIENT_S)
    names = ("drive_distance", "rotate_angle", "drive_on_heading", "backup", "spin")
    assert [stage.node.node.count_services(f"{name}/_action/send_goal") for name in names] == [1, 1, 0, 0, 0]


def test_the_base_of_the_tests_goes_on_while_its_test_is_busy(stage: GoalStage) -> None:
    drive = stage.client.send(0.3, 0.3)
    time.sleep(0.8)  # longer than any state may be old
    assert stage.end_of(drive).code is ErrorCode.OK


def test_a_pose_that_is_set_anew_by_less_than_a_jump_ends_the_goal(stage: GoalStage) -> None:
    drive = stage.drive_until_moving()
    with stage.base.lock:
        stage.base.x_m -= 0.09
        stage.base.driver.pose_resets += 1
    result = stage.end_of(drive)
    assert result.code is ErrorCode.ODOMETRY_LOST
    assert "was reset" in result.message


def test_a_base_that_turns_away_ends_the_goal_and_the_message_has_offset_angle_and_wheel(stage: GoalStage) -> None:
    drive = stage.drive_until_moving()
    with stage.base.lock:
        stage.base.yaw_rad += 0.25
    result = stage.end_of(drive)
    assert result.code is ErrorCode.DRIVE_FAULT
    assert "turned away by +0.2" in result.message
    assert "left wheel" in result.message


def test_where_the_mux_does_not_hear_the_server_goals_are_rejected_and_it_lives_on() -> None:
    sources = {"joystick": {"topic": "cmd_vel_joy", "priority": 1, "timeout_s": 0.3}}
    with goal_stage({"mux": {"sources": sources}}) as stage:
        for _ in range(2):
            assert "cmd_vel_action" in stage.rejection(1.0, 0.2)
        assert stage.server.exit_code is None


def test_bytes_on_odom_that_are_no_message_are_no_odometry_and_the_goal_goes_on(stage: GoalStage) -> None:
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
    stage.node.node.destroy_publisher(publisher)
    assert (result.status, result.code) == (Status.SUCCEEDED, ErrorCode.OK)
    assert stage.server.exit_code is None


def test_a_goal_ends_at_its_distance_with_feedback_and_a_structured_line_for_each_step(stage: GoalStage) -> None:
    began_s, seen = time.monotonic(), list[DriveFeedback]()
    drive = stage.client.send(-0.6, 0.2, on_feedback=seen.append)
    result = stage.end_of(drive)
    assert (result.status, result.code) == (Status.SUCCEEDED, ErrorCode.OK)
    assert result.traveled_m == pytest.approx(-0.6, abs=TOLERANCE_M)
    assert result.traveled_m == pytest.approx(stage.base.x_m, abs=0.001)
    assert 0.0 <= result.overshoot_m <= TOLERANCE_M
    assert max(abs(mps) for mps in stage.base.orders_since(began_s)) <= 0.2 + 1e-6
    assert len(seen) >= 5
    assert len(seen) <= 12.0 * (time.monotonic() - began_s)  # action.feedback_hz is 10

    mine = [step for step in stage.steps() if step["uuid"] == drive.uuid]
    feedback = [step for step in mine if step["step"] == "feedback"]
    others = [step for step in mine if step not in feedback]
    assert [step["step"] for step in others] == ["accepted", "started", "stopping", "standstill", "ended"]
    assert (mine[-1]["status"], mine[-1]["error_code"]) == ("SUCCEEDED", "OK")
    assert mine[-1]["traveled_m"] == pytest.approx(-0.6, abs=TOLERANCE_M)
    assert 3.0 < mine[-1]["duration_s"] < 15.0
    assert 2 <= len(feedback) <= mine[-1]["duration_s"]  # the client gets ten times as many
    for step in (*feedback, others[2]):
        assert step["remaining_m"] - step["traveled_m"] == pytest.approx(0.6, abs=0.001)
    traveled = [step["traveled_m"] for step in feedback]
    assert traveled == sorted(traveled, reverse=True)


def test_a_turn_may_be_more_than_one_turn_shares_the_base_and_ends_at_its_angle(stage: GoalStage) -> None:
    turns = RotateClient(stage.node.node, stage.node.executor)
    turns.wait_for_server(PATIENT_S)
    for angle_rad, speed_radps in ((0.0, 0.5), (100.0, 0.5), (math.nan, 0.5), (1.0, 9.0), (1.0, -0.5)):
        with pytest.raises(RejectedError):
            turns.send(angle_rad, speed_radps)
    seen = list[RotateFeedback]()
    turn = turns.send(-6.5, 1.5, on_feedback=seen.append)
    assert "busy" in stage.rejection(0.1, 0.2)
    result = turn.wait(20.0)
    turns.close()
    assert result is not None
    assert (result.status, result.code) == (Status.SUCCEEDED, ErrorCode.OK), result.message
    assert result.turned_rad == pytest.approx(-6.5, abs=TOLERANCE_RAD)
    assert stage.base.yaw_rad == pytest.approx(-6.5, abs=TOLERANCE_RAD)
    assert 0.0 <= result.overshoot_rad <= TOLERANCE_RAD
    assert seen[-1].turned_rad < 0.0
    assert math.hypot(stage.base.x_m, stage.base.y_m) < 1e-6


def test_goals_out_of_range_are_rejected_and_nothing_is_ordered(stage: GoalStage) -> None:
    began_s = time.monotonic()
    for distance_m in (100.0, 5.001, 0.0, 0.009, -5.001):
        assert "|distance_m| is" in stage.rejection(distance_m, 0.2)
    for speed_mps in (9.0, 0.501, 0.019, 0.0, -0.2):
        assert "max_speed_mps is" in stage.rejection(1.0, speed_mps)
    for number in (math.nan, math.inf, -math.inf):
        assert "expected a finite number" in stage.rejection(number, 0.2)
        assert "expected a finite number" in stage.rejection(1.0, number)
    stage.node.spin_for(0.2)
    assert stage.base.orders_since(began_s) == []


def estop(base: FakeBase) -> None:
    base.safety = SafetyState(action=SafetyState.STOP, cause=SafetyState.CAUSE_ESTOP, detail="pressed", estop=True)


def trip(base: FakeBase) -> None:
    base.driver.state, base.driver.cause, base.driver.detail = DriverStatus.LATCHED, "drive_fault", "left: 0x2310"
    base.driver.watchdog, base.driver.watchdog_cause = DriverStatus.WATCHDOG_TRIPPED, "lease lost"


def joystick(base: FakeBase) -> None:
    base.mux.active = "joystick"


@pytest.mark.parametrize(
    ("change", "reason"),
    [(estop, "emergency stop"), (trip, "watchdog"), (joystick, "joystick")],
    ids=["estop", "trip", "joystick"],
)
def test_a_robot_that_cannot_drive_rejects_a_goal(
    stage: GoalStage, change: Callable[[FakeBase], None], reason: str
) -> None:
    began_s = time.monotonic()
    change(stage.base)
    stage.node.spin_for(0.2)
    assert reason in stage.rejection(1.0, 0.2)
    assert stage.base.orders_since(began_s) == []


@pytest.mark.parametrize(
    ("name", "topic", "code", "timeout_s"),
    [
        ("mux", "velocity_mux/state", ErrorCode.TAKEN_OVER, 0.3),
        ("safety", "safety_filter/state", ErrorCode.ESTOP, 0.3),
        ("driver", "motor_driver/status", ErrorCode.DRIVE_FAULT, 0.3),
        ("odom", "odom", ErrorCode.ODOMETRY_LOST, 0.5),
    ],
)
def test_a_state_that_is_lost_ends_the_goal(
    stage: GoalStage, name: str, topic: str, code: ErrorCode, timeout_s: float
) -> None:
    drive = stage.drive_until_moving()
    stage.base.silent.add(name)
    lost_s = time.monotonic()
    result = stage.end_of(drive)
    assert (result.status, result.code) == (Status.ABORTED, code), result.message
    missing = "no odometry" if name == "odom" else f"no message on {topic}"
    assert f"{missing} for {timeout_s}" in result.message
    assert set(stage.base.orders_since(lost_s + timeout_s + 0.2)) <= {0.0}
    assert topic in stage.rejection(1.0, 0.2)


def test_a_cancel_ends_canceled_only_when_the_base_stands(stage: GoalStage) -> None:
    drive = stage.drive_until_moving(2.0, 0.4)
    asked_s = time.monotonic()
    assert drive.cancel()
    assert time.monotonic() - asked_s < 0.5
    assert drive.result is None  # accepted, but the base still moves
    result = stage.end_of(drive)
    assert (result.status, result.code) == (Status.CANCELED, ErrorCode.CANCELED)
    assert 0.0 < result.traveled_m < 2.0
    assert "cancel requested" in [step["step"] for step in stage.steps() if step["uuid"] == drive.uuid]


def test_of_many_goals_at_once_one_is_accepted_the_others_find_it_busy_and_the_next_one_runs(stage: GoalStage) -> None:
    goal = DriveDistance.Goal(distance_m=0.2, max_speed_mps=0.3)
    deep = {"goal_service_qos_profile": SERVICE_QOS}
    clients = [ActionClient(stage.node.node, DriveDistance, "drive_distance", **deep) for _ in range(4)]
    stage.node.wait_for(lambda: all(client.server_is_ready() for client in clients), 5.0, "all clients")
    answers = [client.send_goal_async(goal) for client in clients for _ in range(5)]
    stage.node.wait_for(lambda: all(answer.done() for answer in answers), 5.0, "all answers")
    (owner,) = [answer.result() for answer in answers if answer.result().accepted]
    assert "busy" in stage.last_reason()
    ended = owner.get_result_async()
    stage.node.wait_for(ended.done, 10.0, "the end")
    assert ended.result().status == Status.SUCCEEDED
    for client in clients:
        client.destroy()
    assert stage.end_of(stage.client.send(-0.1, 0.2)).code is ErrorCode.OK


def test_a_server_that_is_told_to_end_stops_the_base_and_delivers_the_result() -> None:
    with goal_stage() as stage:
        drive = stage.drive_until_moving()
        stage.server.terminate()
        result = stage.end_of(drive)
        assert (result.status, result.code) == (Status.ABORTED, ErrorCode.SHUTDOWN)
        assert stage.server.wait(5.0) == 0


def test_a_server_without_a_goal_that_is_interrupted_ends_at_once() -> None:
    with goal_stage() as stage:
        stage.server.interrupt()
        assert stage.server.wait(3.0) == 0


def drives(stage: GoalStage) -> Drive:
    return stage.drive_until_moving()


def second_goal(stage: GoalStage) -> Drive:
    """What judges it breaks: it is rejected, and the first one ends as it must."""
    drive = stage.drive_until_moving()
    with pytest.raises(RejectedError):
        stage.client.send(0.7, 0.2)
    return drive


def cancel(stage: GoalStage) -> Drive:
    drive = stage.drive_until_moving()
    assert not drive.cancel()
    return drive


def to_its_end(stage: GoalStage) -> Drive:
    """Its status would be out already, and rclpy would send a result of zeros, whose error code is OK."""
    return stage.client.send(0.05, 0.3)


RAISES = "def broken(*_args): raise ZeroDivisionError('a defect')\n"


@pytest.mark.parametrize(
    ("sabotage", "provoke"),
    [
        (
            "from canbase_action_server.goal import GoalRun\n"
            "sound = GoalRun.tick\n"
            "GoalRun.tick = lambda self, *args: broken() if self.traveled_m > 0.1 else sound(self, *args)\n",
            drives,
        ),
        (
            "from canbase_action_server.goal_queue import GoalQueue\n"
            "sound = GoalQueue.refusal\n"
            "GoalQueue.refusal = lambda self, *args: broken() if self.busy else sound(self, *args)\n",
            second_goal,
        ),
        (
            "from canbase_action_server.node import DriveDistanceServer\nDriveDistanceServer._on_cancel = broken\n",
            cancel,
        ),
        ("from canbase_action_server import drive_messages\ndrive_messages._result = broken\n", to_its_end),
    ],
    ids=["tick", "goal", "cancel", "result"],
)
def test_a_defect_in_a_callback_stops_the_base_ends_the_goal_as_internal_and_the_process(
    sabotage: str, provoke: Callable[[GoalStage], Drive]
) -> None:
    with goal_stage(sabotage=RAISES + sabotage) as stage:
        result = stage.end_of(provoke(stage))
        assert (result.status, result.code) == (Status.ABORTED, ErrorCode.INTERNAL)
        assert "ZeroDivisionError" in result.message or provoke is to_its_end
        assert stage.server.wait(5.0) == 1
        assert "a defect" in stage.server.log()


def test_a_defect_in_taking_on_a_goal_ends_the_process_in_order() -> None:
    sabotage = "from canbase_action_server.goal_queue import GoalQueue\nGoalQueue.admit = broken\n"
    with goal_stage(sabotage=RAISES + sabotage) as stage:
        stage.client.send(0.7, 0.2)
        assert stage.server.wait(5.0) == 1
        assert "a defect" in stage.server.log()
        assert stage.base.speed_mps == 0.0
