"""The orders of the mux's sources in the black box, over DDS: nothing takes them before a stop is recorded."""

from __future__ import annotations

import math
import time
from typing import Any

import pytest
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from canbase_config.load import load_robot, sample
from canbase_config.mux import MuxSource
from canbase_config.robot import Robot
from canbase_driver.ros.source_orders import FASTEST_HZ, SourceOrders
from canbase_driver.runtime.black_box import EventEntry, Recording
from support.ros_harness import TestNode

pytestmark = [pytest.mark.ros, pytest.mark.timeout(60)]

ROBOT = load_robot(sample("bench")).robot
PERIOD_S = 0.02
LATE_S = 0.05
"""A loaded machine receives within this."""


def since(at_s: float) -> Recording:
    return Recording(((at_s, 0x80, b"", False),), (), 0.0)


def publish(
    test_node: TestNode, speeds: list[float], topic: str, kind: type[Twist] | type[TwistStamped]
) -> list[float]:
    """At 50 Hz; the times."""
    publisher = test_node.node.create_publisher(kind, topic, 10)
    test_node.wait_for(lambda: publisher.get_subscription_count() == 1, 10.0, "the black box")
    times = []
    for speed in speeds:
        message = kind()
        (message if isinstance(message, Twist) else message.twist).linear.x = speed
        times.append(time.monotonic())
        publisher.publish(message)
        time.sleep(PERIOD_S)
    time.sleep(LATE_S)
    return times


def with_source(name: str, **keys: Any) -> Robot:
    """The bench with this source alone."""
    source = MuxSource(priority=1, timeout_s=0.3, **keys)
    return ROBOT.model_copy(update={"mux": ROBOT.mux.model_copy(update={"sources": {name: source}})})


def speeds(events: list[EventEntry]) -> list[float]:
    return [values["linear_mps"] for _, _, values in events]


def test_each_order_is_there_with_the_time_at_which_it_came_and_so_it_is_in_the_next_recording(
    test_node: TestNode,
) -> None:
    orders = SourceOrders(test_node.node, ROBOT, 10.0)
    sent_s = publish(test_node, [0.1, 0.2, 0.3, float("nan")], "cmd_vel_joy", TwistStamped)
    events = list(orders.during(since(0.0)))
    assert [(what, values["source"]) for _, what, values in events] == [("order", "joystick")] * 4
    assert speeds(events)[:3] == [0.1, 0.2, 0.3]
    for sent, (at_s, _, _) in zip(sent_s, events, strict=True):
        assert 0.0 <= at_s - sent <= LATE_S
    assert speeds(list(orders.during(since(sent_s[1]))))[:2] == [0.2, 0.3]


def test_a_source_without_a_header_is_heard_as_well(test_node: TestNode) -> None:
    orders = SourceOrders(test_node.node, with_source("old", topic="cmd_vel_old", stamped=False), 2.0)
    publish(test_node, [0.25], "cmd_vel_old", Twist)
    (event,) = orders.during(since(0.0))
    assert event[2] == {"source": "old", "linear_mps": 0.25, "angular_radps": 0.0}


def test_wheel_speeds_are_kept_as_the_velocity_of_the_base_and_what_the_mux_refuses_as_none(
    test_node: TestNode,
) -> None:
    robot = with_source("control", topic="joint_command", type="joint_command")
    orders = SourceOrders(test_node.node, robot, 2.0)
    publisher = test_node.node.create_publisher(JointState, "joint_command", 10)
    test_node.wait_for(lambda: publisher.get_subscription_count() == 1, 10.0, "the black box")
    whole = JointState(name=["right_wheel", "left_wheel"], velocity=[3.0, 2.0])
    whole.header.stamp.sec = 7
    publisher.publish(whole)
    publisher.publish(JointState(name=["left_wheel"], velocity=[2.0]))
    time.sleep(LATE_S)
    first, second = (values for _, _, values in orders.during(since(0.0)))
    assert first == {"source": "control", "stamp_s": 7.0, "linear_mps": 0.25, "angular_radps": pytest.approx(0.2)}
    assert math.isnan(second["linear_mps"])
    assert math.isnan(second["angular_radps"])


def test_what_waits_is_bounded_and_the_newest_is_kept(test_node: TestNode) -> None:
    orders = SourceOrders(test_node.node, ROBOT, seconds := 2.0)
    depth = round(seconds * FASTEST_HZ)
    publisher = test_node.node.create_publisher(TwistStamped, "cmd_vel_joy", depth)
    test_node.wait_for(lambda: publisher.get_subscription_count() == 1, 10.0, "the black box")
    for number in range(depth + 20):
        message = TwistStamped()
        message.twist.linear.x = float(number)
        publisher.publish(message)
        time.sleep(0.002)
    time.sleep(LATE_S)
    events = list(orders.during(since(0.0)))
    assert len(events) == depth
    assert speeds(events)[-1] == depth + 19


def test_bytes_that_are_no_message_are_passed_over(test_node: TestNode) -> None:
    orders = SourceOrders(test_node.node, ROBOT, 2.0)
    publisher = test_node.node.create_publisher(TwistStamped, "cmd_vel_joy", 10)
    test_node.wait_for(lambda: publisher.get_subscription_count() == 1, 10.0, "the black box")
    whole = TwistStamped()
    whole.twist.linear.x = 0.5
    publisher.publish(bytes(serialize_message(whole))[:-4])
    publisher.publish(whole)
    time.sleep(LATE_S)
    assert speeds(list(orders.during(since(0.0)))) == [0.5]
