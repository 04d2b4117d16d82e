"""odom, tf and joint_states as bytes are what `messages.py` says of the same snapshot."""

import math

import pytest
from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.odometry import Pose2D
from canbase_driver.ros import messages
from canbase_driver.ros.serialized_motion import SerializedMotion
from canbase_driver.snapshot import DriverSnapshot
from support.snapshots import SNAPSHOT, with_driver, with_left

STAMP = Time(sec=1_700_000_000, nanosec=250_000_000)
LATER = with_driver(
    odometry={
        "pose": Pose2D(-2.25, 8.0, -3.0 + 2.0 * math.tau),
        "twist": Twist2D(-0.125, 0.75),
        "pose_covariance": tuple(float(2 * k) for k in range(36)),
        "twist_covariance": tuple(float(3 * k) for k in range(36)),
    }
)


@pytest.mark.parametrize("snapshot", [SNAPSHOT, LATER])
def test_odom_and_joint_states_of_one_snapshot_after_the_other(snapshot: DriverSnapshot) -> None:
    motion = SerializedMotion()
    for seen in (SNAPSHOT, snapshot, SNAPSHOT):
        odometry = deserialize_message(motion.odometry(seen, STAMP), Odometry)
        joints = deserialize_message(motion.joint_state(seen, STAMP), JointState)
        assert odometry == messages.odometry_message(seen, STAMP)
        assert joints == messages.joint_state_message(seen, STAMP)


@pytest.mark.skipif(messages.TFMessage is None, reason="no tf2_msgs")
@pytest.mark.parametrize("snapshot", [SNAPSHOT, LATER])
def test_tf_of_one_snapshot_after_the_other(snapshot: DriverSnapshot) -> None:
    motion = SerializedMotion()
    for seen in (SNAPSHOT, snapshot, SNAPSHOT):
        found = deserialize_message(motion.transform(seen, STAMP), messages.TFMessage)
        assert found == messages.tf_message(seen, STAMP)


def test_the_effort_comes_and_goes_with_the_drives_that_report_their_torque() -> None:
    motion = SerializedMotion()
    one, both = with_left(effort_nm=1.5), with_driver(drives=(with_left(effort_nm=-2.0).drives[0],) * 2)
    for seen in (SNAPSHOT, one, both, SNAPSHOT, one):
        joints = deserialize_message(motion.joint_state(seen, STAMP), JointState)
        known = messages.joint_state_message(seen, STAMP)
        assert list(joints.effort) == pytest.approx(list(known.effort), nan_ok=True)
        assert (list(joints.name), list(joints.velocity)) == (list(known.name), list(known.velocity))


def test_a_drive_that_is_not_heard_yet_is_left_out_and_comes_later() -> None:
    motion = SerializedMotion()
    silent = with_left(feedback_age_s=math.nan)
    nobody = with_driver(drives=())
    for seen in (nobody, silent, SNAPSHOT, silent, nobody):
        joints = deserialize_message(motion.joint_state(seen, STAMP), JointState)
        assert joints == messages.joint_state_message(seen, STAMP)
