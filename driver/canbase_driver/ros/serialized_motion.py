"""odom, tf and joint_states of each snapshot as bytes: what `messages.py` makes of it, without its ROS objects."""

from __future__ import annotations

import math

from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message

from canbase_driver.ros import messages
from canbase_driver.snapshot import DriverSnapshot
from canbase_runtime.serialized_message import SerializedMessage

_STAMP = ("header.stamp.sec", "header.stamp.nanosec")
_ODOMETRY = (
    *_STAMP,
    "pose.pose.position.x",
    "pose.pose.position.y",
    "pose.pose.orientation.z",
    "pose.pose.orientation.w",
    "pose.covariance",
    "twist.twist.linear.x",
    "twist.twist.angular.z",
    "twist.covariance",
)
_TRANSFORM = tuple(
    f"transforms.0.{name}"
    for name in (
        *_STAMP,
        "transform.translation.x",
        "transform.translation.y",
        "transform.rotation.z",
        "transform.rotation.w",
    )
)
_JOINTS = (*_STAMP, "position", "velocity")


class SerializedMotion:
    """Of one robot: its frames do not change. Joints may come, and their effort, with the first message of a drive."""

    def __init__(self) -> None:
        self._odometry: SerializedMessage | None = None
        self._transform: SerializedMessage | None = None
        self._joints: SerializedMessage | None = None
        self._layout: tuple[list[str], bool] = ([], False)
        """Of joint_states: the joints, and whether they have an effort."""

    def odometry(self, snapshot: DriverSnapshot, stamp: Time) -> bytes:
        """`messages.odometry_message`."""
        if self._odometry is None:
            self._odometry = SerializedMessage(messages.odometry_message(snapshot, stamp), *_ODOMETRY)
        odometry = snapshot.odometry
        half_rad = messages.half_turn(odometry.pose.yaw_rad)
        return self._odometry.pack(
            stamp.sec,
            stamp.nanosec,
            odometry.pose.x_m,
            odometry.pose.y_m,
            math.sin(half_rad),
            math.cos(half_rad),
            *odometry.pose_covariance,
            odometry.twist.linear_mps,
            odometry.twist.angular_radps,
            *odometry.twist_covariance,
        )

    def transform(self, snapshot: DriverSnapshot, stamp: Time) -> bytes:
        """`messages.tf_message`, where there is tf2_msgs."""
        if self._transform is None:
            self._transform = SerializedMessage(messages.tf_message(snapshot, stamp), *_TRANSFORM)
        pose = snapshot.odometry.pose
        half_rad = messages.half_turn(pose.yaw_rad)
        return self._transform.pack(
            stamp.sec, stamp.nanosec, pose.x_m, pose.y_m, math.sin(half_rad), math.cos(half_rad)
        )

    def joint_state(self, snapshot: DriverSnapshot, stamp: Time) -> bytes:
        """`messages.joint_state_message`."""
        drives = messages.reporting_drives(snapshot)
        efforts_nm = messages.efforts_nm(drives)
        layout = ([drive.joint for drive in drives], bool(efforts_nm))
        if self._joints is None or layout != self._layout:
            message = messages.joint_state_message(snapshot, stamp)
            if not drives:
                return bytes(serialize_message(message))
            fields = (*_JOINTS, "effort") if efforts_nm else _JOINTS
            self._joints, self._layout = SerializedMessage(message, *fields), layout
        return self._joints.pack(
            stamp.sec,
            stamp.nanosec,
            *[drive.position_rad for drive in drives],
            *[drive.velocity_radps for drive in drives],
            *efforts_nm,
        )
