"""Real ROS messages from a snapshot: every field arrives, in the units, frames and words that the interfaces name."""

import dataclasses
import math
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from canbase.msg import DriverStatus, DriveStatus
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import deserialize_message, serialize_message

from canbase_driver import messages
from canbase_driver.odometry import Odometry
from canbase_driver.snapshot import DriverSnapshot, DriverState, DriveSnapshot, WatchdogView

STAMP = Time(sec=1_700_000_000, nanosec=250_000_000)
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR

LEFT = DriveSnapshot(
    joint="left_wheel_joint",
    node_id=1,
    axis=0,
    nmt_state="operational",
    state="operation enabled",
    statusword=0x0637,
    error_code=0,
    error_text="",
    target_radps=5.0,
    velocity_radps=4.9,
    position_rad=123.5,
    feedback_age_s=0.004,
    heartbeat_age_s=0.05,
    stops_by_itself=True,
)
RIGHT = dataclasses.replace(LEFT, joint="right_wheel_joint", node_id=2, axis=1, position_rad=-7.25)
SNAPSHOT = DriverSnapshot(
    time_s=1000.0,
    state=DriverState.ENABLED,
    cause="none",
    detail="",
    clears_on="",
    watchdog=WatchdogView.OK,
    watchdog_cause="none",
    watchdog_age_s=0.03,
    standstill=False,
    command_age_s=0.015,
    command_fresh=True,
    commands_refused=1,
    cycles=12_345,
    overruns=2,
    cycle_lateness_max_s=0.0004,
    frames_dropped=3,
    send_errors=4,
    drives=(LEFT, RIGHT),
    x_m=1.5,
    y_m=-0.5,
    yaw_rad=math.pi / 3.0,
    linear_mps=0.4,
    angular_radps=-0.2,
    pose_covariance=tuple(float(k) for k in range(36)),
    twist_covariance=tuple(float(100 + k) for k in range(36)),
    odometry_valid=True,
)


def with_left(**changes: Any) -> DriverSnapshot:
    """The snapshot with another left drive."""
    return dataclasses.replace(SNAPSHOT, drives=(dataclasses.replace(LEFT, **changes), RIGHT))


def with_driver(**changes: Any) -> DriverSnapshot:
    """The snapshot with another driver."""
    return dataclasses.replace(SNAPSHOT, **changes)


def entry(message: DiagnosticArray, name: str) -> DiagnosticStatus:
    """The only diagnostic entry with this name."""
    (found,) = (status for status in message.status if status.name == name)
    return found


# odom and tf


def test_odometry_has_rep_105_frames_si_units_and_both_covariances() -> None:
    message = messages.odometry_message(SNAPSHOT, STAMP)
    assert message.header.stamp == STAMP
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
    position, turn = message.pose.pose.position, message.pose.pose.orientation
    assert (position.x, position.y, position.z) == (1.5, -0.5, 0.0)
    assert (turn.x, turn.y, turn.z, turn.w) == pytest.approx((0.0, 0.0, 0.5, math.sqrt(3.0) / 2.0))  # 60° about z
    linear, angular = message.twist.twist.linear, message.twist.twist.angular
    assert (linear.x, linear.y, linear.z, angular.x, angular.y, angular.z) == (0.4, 0.0, 0.0, 0.0, 0.0, -0.2)
    assert list(message.pose.covariance) == list(range(36))
    assert list(message.twist.covariance) == list(range(100, 136))


def test_the_covariances_of_the_odometry_fit_into_the_message() -> None:
    odometry = Odometry(0.4)
    snapshot = with_driver(pose_covariance=odometry.pose_covariance(), twist_covariance=odometry.twist_covariance())
    message = messages.odometry_message(snapshot, STAMP)
    assert tuple(message.pose.covariance) == odometry.pose_covariance()
    assert tuple(message.twist.covariance) == odometry.twist_covariance()


@pytest.mark.parametrize("turns", [-3, -1, 0, 1, 1000])
def test_however_often_the_base_has_turned_the_orientation_is_the_same(turns: int) -> None:
    message = messages.odometry_message(with_driver(yaw_rad=0.5 + turns * math.tau), STAMP)
    turn = message.pose.pose.orientation
    assert (turn.z, turn.w) == pytest.approx((math.sin(0.25), math.cos(0.25)))


def test_the_transform_is_the_pose_of_the_odometry() -> None:
    snapshot = with_driver(odom_frame="r1/odom", base_frame="r1/base_link")
    transform = messages.transform_message(snapshot, STAMP)
    pose = messages.odometry_message(snapshot, STAMP)
    assert transform.header == pose.header
    assert transform.header.frame_id == "r1/odom"
    assert transform.child_frame_id == pose.child_frame_id == "r1/base_link"
    assert transform.transform.translation.x == pose.pose.pose.position.x
    assert transform.transform.translation.y == pose.pose.pose.position.y
    assert transform.transform.rotation == pose.pose.pose.orientation


def test_without_tf2_msgs_there_is_no_tf_message(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(messages, "TFMessage", None)
    assert messages.tf_message(SNAPSHOT, STAMP) is None


def test_with_tf2_msgs_the_tf_message_holds_the_one_transform(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(messages, "TFMessage", lambda transforms: ("TFMessage", transforms))
    assert messages.tf_message(SNAPSHOT, STAMP) == ("TFMessage", [messages.transform_message(SNAPSHOT, STAMP)])


# joint_states


def test_joint_states_give_angle_and_speed_of_each_wheel() -> None:
    message = messages.joint_state_message(SNAPSHOT, STAMP)
    assert message.header.stamp == STAMP
    assert message.name == ["left_wheel_joint", "right_wheel_joint"]
    assert list(message.position) == [123.5, -7.25]
    assert list(message.velocity) == [4.9, 4.9]
    assert list(message.effort) == []


def test_a_wheel_that_was_never_heard_has_no_angle() -> None:
    message = messages.joint_state_message(with_left(feedback_age_s=math.nan), STAMP)
    assert message.name == ["right_wheel_joint"]
    assert list(message.position) == [-7.25]
    assert list(message.velocity) == [4.9]


# motor_driver/status


def test_states_and_words_are_those_of_the_interface() -> None:
    assert {state.name: int(state) for state in DriverState} == {
        name: getattr(DriverStatus, name)
        for name in ("OFFLINE", "BOOTING", "DISARMED", "ENABLING", "ENABLED", "STOPPING", "LATCHED")
    }
    assert {view.name: view.value for view in WatchdogView} == {
        "OK": DriverStatus.WATCHDOG_OK,
        "MISSING": DriverStatus.WATCHDOG_MISSING,
        "TRIPPED": DriverStatus.WATCHDOG_TRIPPED,
    }


def test_the_status_carries_every_field_of_the_snapshot_that_the_interface_has() -> None:
    latched = with_driver(
        state=DriverState.LATCHED,
        cause="drive fault",
        detail="left_wheel_joint is in fault",
        clears_on="reset",
        watchdog=WatchdogView.TRIPPED,
        watchdog_cause="overspeed",
        standstill=True,
    )
    message = messages.status_message(latched, STAMP)
    assert message.stamp == STAMP
    assert message.state == DriverStatus.LATCHED
    assert message.watchdog == DriverStatus.WATCHDOG_TRIPPED
    plain = set(message.get_fields_and_field_types()) - {"stamp", "state", "watchdog", "drives"}
    assert {name: getattr(message, name) for name in plain} == {name: getattr(latched, name) for name in plain}


def test_each_drive_is_in_the_status_with_every_field_in_the_order_of_the_configuration() -> None:
    message = messages.status_message(SNAPSHOT, STAMP)
    assert len(message.drives) == 2
    for sent, drive in zip(message.drives, (LEFT, RIGHT), strict=True):
        names = DriveStatus.get_fields_and_field_types()
        assert {name: getattr(sent, name) for name in names} == dataclasses.asdict(drive)


def test_before_anything_was_heard_the_ages_are_nan() -> None:
    snapshot = with_driver(
        command_age_s=math.nan,
        watchdog_age_s=math.nan,
        drives=(dataclasses.replace(LEFT, feedback_age_s=math.nan, heartbeat_age_s=math.nan),),
    )
    sent = deserialize_message(serialize_message(messages.status_message(snapshot, STAMP)), DriverStatus)
    ages = [
        sent.command_age_s,
        sent.watchdog_age_s,
        sent.drives[0].feedback_age_s,
        sent.drives[0].heartbeat_age_s,
    ]
    assert [math.isnan(age) for age in ages] == [True] * 4


@pytest.mark.parametrize(("count", "sent"), [(2**32 - 1, 2**32 - 1), (2**32, 0), (2**32 + 5, 5)])
def test_counters_go_round_like_their_type_after_497_days(count: int, sent: int) -> None:
    message = messages.status_message(with_driver(cycles=count, frames_dropped=count, send_errors=count), STAMP)
    assert (message.cycles, message.frames_dropped, message.send_errors) == (sent, sent, sent)


# /diagnostics


def test_a_healthy_robot_is_ok_in_every_entry() -> None:
    message = messages.diagnostics_message(SNAPSHOT, STAMP, robot="r1")
    assert message.header.stamp == STAMP
    assert [(status.name, status.level) for status in message.status] == [
        ("r1: motor_driver", OK),
        ("r1: watchdog", OK),
        ("r1: drive left_wheel_joint", OK),
        ("r1: drive right_wheel_joint", OK),
    ]
    assert [status.message for status in message.status] == [
        "All drives are enabled.",
        "The watchdog watches.",
        "Operation enabled, operational.",
        "Operation enabled, operational.",
    ]
    assert entry(message, "r1: drive right_wheel_joint").hardware_id == "r1 node 2 axis 1"


def test_the_values_are_short_and_have_their_units() -> None:
    message = messages.diagnostics_message(with_left(feedback_age_s=math.nan, error_code=0x8611), STAMP)
    drive = {pair.key: pair.value for pair in entry(message, "robot: drive left_wheel_joint").values}
    assert drive == {
        "NMT state": "operational",
        "CiA 402 state": "operation enabled",
        "statusword": "0637h",
        "error code": "8611h",
        "target [rad/s]": "5",
        "velocity [rad/s]": "4.9",
        "position [rad]": "123.5",
        "last status TPDO": "never heard",
        "last heartbeat": "heard 0.050 s ago",
        "stops by itself": "True",
    }
    loop = {pair.key: pair.value for pair in entry(message, "robot: motor_driver").values}
    assert loop["cycles"] == "12345"
    assert loop["greatest lateness [s]"] == "0.0004"
    assert loop["send errors"] == "4"


@pytest.mark.parametrize(
    ("state", "level"),
    [
        (DriverState.OFFLINE, ERROR),
        (DriverState.BOOTING, WARN),
        (DriverState.DISARMED, WARN),
        (DriverState.ENABLING, WARN),
        (DriverState.ENABLED, OK),
        (DriverState.STOPPING, WARN),
        (DriverState.LATCHED, ERROR),
    ],
)
def test_the_level_of_the_driver_follows_its_state(state: DriverState, level: bytes) -> None:
    message = messages.diagnostics_message(with_driver(state=state, cause="x"), STAMP)
    assert entry(message, "robot: motor_driver").level == level


@pytest.mark.parametrize(
    ("detail", "clears_on", "sentence"),
    [
        ("left is in fault", "reset", "Latched (drive fault): left is in fault. It ends with: reset."),
        ("left is in fault.", "", "Latched (drive fault): left is in fault."),
        ("", "reset", "Latched (drive fault). It ends with: reset."),
    ],
)
def test_a_stopped_driver_says_why_and_what_ends_it(detail: str, clears_on: str, sentence: str) -> None:
    snapshot = with_driver(state=DriverState.LATCHED, cause="drive fault", detail=detail, clears_on=clears_on)
    assert entry(messages.diagnostics_message(snapshot, STAMP), "robot: motor_driver").message == sentence


def test_a_counter_is_a_warning_only_while_it_grows() -> None:
    grown = with_driver(overruns=5, send_errors=5)
    message = messages.diagnostics_message(grown, STAMP, previous=SNAPSHOT)
    loop = entry(message, "robot: motor_driver")
    assert loop.level == WARN
    assert loop.message == "All drives are enabled. Since the last report: 3 more overruns, 1 more send errors."
    later = messages.diagnostics_message(grown, STAMP, previous=grown)
    assert entry(later, "robot: motor_driver").level == OK


def test_a_growing_counter_does_not_make_an_error_a_warning() -> None:
    snapshot = with_driver(state=DriverState.LATCHED, cause="bus failed", send_errors=5)
    message = messages.diagnostics_message(snapshot, STAMP, previous=SNAPSHOT)
    assert entry(message, "robot: motor_driver").level == ERROR


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (
            {"watchdog": WatchdogView.MISSING, "watchdog_age_s": 0.25},
            "The watchdog is missing: its state frame was heard 0.250 s ago. Is its process running, and on this bus?",
        ),
        (
            {"watchdog": WatchdogView.MISSING, "watchdog_age_s": math.nan},
            "The watchdog is missing: its state frame was never heard. Is its process running, and on this bus?",
        ),
        (
            {"watchdog": WatchdogView.TRIPPED, "watchdog_cause": "lease lost"},
            "The watchdog has tripped: lease lost. Remove the cause, then reset.",
        ),
    ],
)
def test_a_watchdog_that_does_not_watch_is_an_error(changes: dict[str, Any], sentence: str) -> None:
    watchdog = entry(messages.diagnostics_message(with_driver(**changes), STAMP), "robot: watchdog")
    assert (watchdog.level, watchdog.message) == (ERROR, sentence)


@pytest.mark.parametrize(
    ("changes", "level", "sentence"),
    [
        (
            {"state": "fault", "error_code": 0x8611, "error_text": "following error"},
            ERROR,
            "Error 8611h: following error.",
        ),
        ({"state": "fault reaction active"}, ERROR, "Error 0000h: fault reaction active."),
        ({"error_code": 0x3210, "error_text": ""}, ERROR, "Error 3210h: operation enabled."),
        ({"feedback_age_s": math.nan}, ERROR, "No feedback yet; its heartbeat was heard 0.050 s ago."),
        (
            {"stops_by_itself": False},
            WARN,
            "Operation enabled, but it would not stop by itself without us (1016h).",
        ),
        ({"state": "switch on disabled"}, OK, "Switch on disabled, operational."),
    ],
)
def test_what_a_drive_says(changes: dict[str, Any], level: bytes, sentence: str) -> None:
    message = messages.diagnostics_message(with_left(**changes), STAMP)
    drive = entry(message, "robot: drive left_wheel_joint")
    assert (drive.level, drive.message) == (level, sentence)
    assert entry(message, "robot: drive right_wheel_joint").level == OK


# All of them


def test_every_message_survives_the_wire() -> None:
    for message in (
        messages.odometry_message(SNAPSHOT, STAMP),
        messages.transform_message(SNAPSHOT, STAMP),
        messages.joint_state_message(SNAPSHOT, STAMP),
        messages.status_message(SNAPSHOT, STAMP),
        messages.diagnostics_message(SNAPSHOT, STAMP),
    ):
        assert deserialize_message(serialize_message(message), type(message)) == message
