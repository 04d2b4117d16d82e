"""Real ROS messages from a snapshot: every field arrives, in the units, frames and words that the interfaces name."""

import dataclasses
import math
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from canbase.msg import DriverStatus, DriveStatus
from geometry_msgs.msg import Point, Pose, Quaternion
from rclpy.serialization import deserialize_message, serialize_message

from canbase_config.odometry import OdometrySettings
from canbase_driver.causes import DriverCause, Finding
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.odometry import Odometry, Pose2D
from canbase_driver.motion.pose_error import TwistError
from canbase_driver.ros import messages
from canbase_driver.ros.diagnostics import diagnostics_message
from canbase_driver.supervision.bus_health import BusReport, ControllerState
from canbase_driver.supervision.stop_history import StopRecord, StopReport
from canbase_driver.supervision.watchdog_link import WatchdogCounters, WatchdogReport
from canbase_runtime.driver_state import DriverState
from canbase_runtime.watchdog_view import WatchdogView
from support.snapshots import LEFT, RIGHT, SNAPSHOT, with_driver, with_left

STAMP = Time(sec=1_700_000_000, nanosec=250_000_000)
VALUES: Any = {"voltage_v": 48.0, "current_a": 1.5, "temperature_c": 40.0, "torque_share": 0.25, "effort_nm": 2.5}
MEASURED = with_driver(drives=tuple(dataclasses.replace(drive, **VALUES) for drive in (LEFT, RIGHT)))
RECORD = StopRecord("watchdog", "watchdog tripped", "overspeed", latched=True, clears_on="reset", at_s=999.0)
STOP = StopReport(RECORD, standstill=True, standstill_s=0.31, distance_m=0.05, turned_rad=-0.01)


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
    pose = Odometry(0.4, OdometrySettings()).pose_covariance()
    twist = TwistError(OdometrySettings(), 0.4, 0.02).covariance(Twist2D(0.3, 0.2))
    message = messages.odometry_message(
        with_driver(odometry={"pose_covariance": pose, "twist_covariance": twist}), STAMP
    )
    assert tuple(message.pose.covariance) == pose
    assert tuple(message.twist.covariance) == twist


@pytest.mark.parametrize("turns", [-3, -1, 0, 1, 1000])
def test_however_often_the_base_has_turned_the_orientation_is_the_same(turns: int) -> None:
    message = messages.odometry_message(with_driver(odometry={"pose": Pose2D(0.0, 0.0, 0.5 + turns * math.tau)}), STAMP)
    turn = message.pose.pose.orientation
    assert (turn.z, turn.w) == pytest.approx((math.sin(0.25), math.cos(0.25)))


def test_the_transform_is_the_pose_of_the_odometry() -> None:
    snapshot = with_driver(odometry={"odom_frame": "r1/odom", "base_frame": "r1/base_link"})
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
    assert {view.name: view.value for view in WatchdogView if view is not WatchdogView.UNKNOWN} == {
        "OK": DriverStatus.WATCHDOG_OK,
        "MISSING": DriverStatus.WATCHDOG_MISSING,
        "TRIPPED": DriverStatus.WATCHDOG_TRIPPED,
    }


def test_the_status_carries_every_field_of_the_snapshot_that_the_interface_has() -> None:
    watchdog = WatchdogReport(
        view=WatchdogView.TRIPPED, cause="overspeed", age_s=0.03, rung=2, lease_age_s=0.5,
        counters=WatchdogCounters(leases_refused=11, frames_dropped=12, bus_errors=13, trips=14, pause_max_ms=15),
    )  # fmt: skip
    bus = BusReport(ControllerState.ERROR_WARNING, 21, 22, 23, 24, 25, "network is down")
    message = messages.status_message(
        with_driver(
            finding=Finding(DriverCause.DRIVE_FAULT, "left_wheel_joint is in fault", "reset"),
            state=DriverState.LATCHED, watchdog=watchdog, bus=bus,
            odometry={"travel_losses": 31, "pose_resets": 32}, standstill=True,
        ),
        STAMP,
        bus_load=0.27,
    )  # fmt: skip
    fields = set(message.get_fields_and_field_types()) - {"stamp", "drives"}
    assert {name: getattr(message, name) for name in fields} == {
        "state": DriverStatus.LATCHED, "cause": "drive fault", "detail": "left_wheel_joint is in fault",
        "clears_on": "reset", "watchdog": DriverStatus.WATCHDOG_TRIPPED, "watchdog_cause": "overspeed",
        "watchdog_age_s": 0.03, "watchdog_rung": 2, "watchdog_lease_age_s": 0.5, "watchdog_leases_refused": 11,
        "watchdog_frames_dropped": 12, "watchdog_bus_errors": 13, "watchdog_trips": 14, "watchdog_pause_max_s": 0.015,
        "pose_resets": 32, "standstill": True, "command_age_s": 0.015, "command_fresh": True, "commands_refused": 1,
        "cycles": 12_345, "overruns": 2, "cycle_lateness_max_s": 0.0004, "bus_problem": "network is down",
        "bus_load": 0.27, "controller": "error warning", "send_errors": 21, "receive_errors": 22, "error_frames": 23,
        "frames_dropped": 24, "bus_failures": 25,
    }  # fmt: skip
    assert message.stamp == STAMP


DIAGNOSTICS_ALONE = {
    *("self_stop", "warning", "internal_limit", "boot_notes", "boot_changes", "configured", "effort_nm", "values"),
}
"""What is in /diagnostics and not in the status."""


def test_each_drive_is_in_the_status_with_every_field_in_the_order_of_the_configuration() -> None:
    message = messages.status_message(MEASURED, STAMP)
    assert len(message.drives) == 2
    for sent, drive in zip(message.drives, MEASURED.drives, strict=True):
        names = DriveStatus.get_fields_and_field_types()
        known = dataclasses.asdict(drive) | {"state": "operation enabled", "nmt_state": "operational", "health": ""}
        assert {name: getattr(sent, name) for name in names} == {name: known[name] for name in names}
        assert known.keys() - names.keys() == DIAGNOSTICS_ALONE


def test_a_drive_whose_states_nobody_knows_is_told_as_unknown() -> None:
    sent = messages.status_message(with_left(state=None, nmt_state=None), STAMP).drives[0]
    assert (sent.state, sent.nmt_state) == ("unknown", "unknown")


def test_before_anything_was_heard_the_ages_are_nan() -> None:
    snapshot = with_driver(
        command={"age_s": math.nan},
        watchdog={"age_s": math.nan},
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
    message = messages.status_message(
        with_driver(cycle={"cycles": count}, bus={"dropped": count, "send_errors": count}), STAMP
    )
    assert (message.cycles, message.frames_dropped, message.send_errors) == (sent, sent, sent)


# stop_events


def test_a_stop_is_told_with_its_cause_and_what_ends_it() -> None:
    message = messages.stop_event_message(STOP, STAMP, "/state/stop.asc")
    assert message.stamp == STAMP
    told = dataclasses.asdict(RECORD) | dataclasses.asdict(STOP) | {"black_box": "/state/stop.asc"}
    names = set(message.get_fields_and_field_types()) - {"stamp"}
    assert {name: getattr(message, name) for name in names} == {name: told[name] for name in names}


# All of them


def test_every_message_survives_the_wire() -> None:
    for message in (
        messages.odometry_message(SNAPSHOT, STAMP),
        messages.transform_message(SNAPSHOT, STAMP),
        messages.joint_state_message(SNAPSHOT, STAMP),
        messages.status_message(MEASURED, STAMP, bus_load=0.27),
        messages.stop_event_message(STOP, STAMP, "/state/stop.asc"),
        diagnostics_message(SNAPSHOT, STAMP, bus_load=0.27),
    ):
        assert deserialize_message(serialize_message(message), type(message)) == message


@pytest.mark.parametrize(("z", "w", "yaw_rad"), [(0.0, 1.0, 0.0), (0.6, 0.8, 1.2870022), (-1.0, 0.0, math.pi)])
def test_a_pose_is_taken_from_its_quaternion(z: float, w: float, yaw_rad: float) -> None:
    pose = messages.pose_of(Pose(position=Point(x=1.0, y=-2.0), orientation=Quaternion(z=z, w=w)))
    assert (pose.x_m, pose.y_m) == (1.0, -2.0)
    assert math.cos(pose.yaw_rad) == pytest.approx(math.cos(yaw_rad))
    assert math.sin(pose.yaw_rad) == pytest.approx(math.sin(yaw_rad), abs=1e-6)


@pytest.mark.parametrize(("z", "w"), [(0.0, 0.0), (math.nan, 1.0), (0.0, math.inf)])
def test_a_pose_without_a_rotation_has_no_yaw(z: float, w: float) -> None:
    assert math.isnan(messages.pose_of(Pose(orientation=Quaternion(z=z, w=w))).yaw_rad)
