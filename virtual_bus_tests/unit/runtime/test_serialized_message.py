"""A message kept as bytes is the message that rclpy makes of the same numbers, whatever lies between its fields."""

from __future__ import annotations

import math
import struct

import pytest
from geometry_msgs.msg import TransformStamped, TwistStamped
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from canbase_runtime.serialized_message import SerializedMessage

STAMP = ("header.stamp.sec", "header.stamp.nanosec")
SECONDS, NANOSECONDS = st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1)
NUMBERS = st.floats(allow_nan=False)


@given(SECONDS, NANOSECONDS, NUMBERS, NUMBERS, st.text("abcäö/", max_size=9))
def test_names_of_any_length_before_the_numbers(sec: int, nanosec: int, ahead: float, turn: float, frame: str) -> None:
    message = TwistStamped()
    message.header.frame_id = frame
    kept = SerializedMessage(message, *STAMP, "twist.linear.x", "twist.angular.z")

    found = deserialize_message(kept.pack(sec, nanosec, ahead, turn), TwistStamped)

    message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
    message.twist.linear.x, message.twist.angular.z = ahead, turn
    assert found == message


@given(st.lists(NUMBERS, min_size=1, max_size=5), NUMBERS)
def test_sequences_keep_their_length(positions: list[float], speed: float) -> None:
    message = JointState(
        name=[str(at) for at in range(len(positions))], position=[0.0] * len(positions), velocity=[1.0]
    )
    kept = SerializedMessage(message, "velocity", "position")

    found = deserialize_message(kept.pack(speed, *positions), JointState)

    assert (list(found.position), list(found.velocity)) == (positions, [speed])
    assert found.name == message.name


def test_arrays_of_fixed_length_and_what_is_not_named_stays_as_it_was() -> None:
    message = Odometry()
    message.pose.pose.position.z = 7.0
    message.twist.covariance[0] = 5.0
    kept = SerializedMessage(message, "pose.covariance", "twist.twist.linear.y")

    found = deserialize_message(kept.pack(*map(float, range(36)), 2.5), Odometry)

    assert list(found.pose.covariance) == list(range(36))
    assert (found.twist.twist.linear.y, found.pose.pose.position.z, found.twist.covariance[0]) == (2.5, 7.0, 5.0)


def test_the_numbers_of_the_last_time_are_gone_and_those_bytes_stay_as_they_were_handed_out() -> None:
    kept = SerializedMessage(TwistStamped(), "twist.linear.x")
    first, second = kept.pack(1.0), kept.pack(math.nan)
    assert deserialize_message(first, TwistStamped).twist.linear.x == 1.0
    assert math.isnan(deserialize_message(second, TwistStamped).twist.linear.x)


def test_the_example_is_not_changed() -> None:
    message = TransformStamped()
    message.transform.rotation.w = 0.5
    SerializedMessage(message, "transform.rotation.w")
    assert message.transform.rotation.w == 0.5


def test_what_is_no_number_is_refused() -> None:
    with pytest.raises(ValueError, match="frame_id is string"):
        SerializedMessage(TwistStamped(), "header.frame_id")
    with pytest.raises(ValueError, match="position is sequence<double> with array"):
        SerializedMessage(JointState(), "position")
    with pytest.raises(ValueError, match="two of the fields are one"):
        SerializedMessage(TwistStamped(), "twist.linear.x", "twist.linear.x")
    with pytest.raises(AttributeError):
        SerializedMessage(TwistStamped(), "twist.linear.w")


def test_a_wrong_count_of_numbers_is_refused_and_changes_nothing() -> None:
    kept = SerializedMessage(TwistStamped(), *STAMP)
    before = kept.pack(1, 2)
    with pytest.raises(ValueError, match="3 numbers for 2"):
        kept.pack(3, 4, 5)
    with pytest.raises(struct.error):
        kept.pack(1, -2)
    assert kept.pack(1, 2) == before
