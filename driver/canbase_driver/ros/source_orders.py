"""The orders of the mux's sources, for the black box: kept by the middleware, taken out only when a stop is recorded.

No executor spins the node: while the robot drives a message costs what DDS needs to receive it, and no Python at all.
Each message has the time at which DDS received it, by the wall clock.
"""

from __future__ import annotations

import itertools
import math
import time
from collections import deque
from collections.abc import Iterator, Mapping
from typing import Any

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from canbase_config.mux import JOINTS, MuxSource
from canbase_config.robot import Robot
from canbase_driver.runtime.black_box import EventEntry, Recording
from canbase_runtime.joint_command import BaseVelocity, base_velocity
from canbase_runtime.message_reader import MessageReader

NODE = "_motor_driver_black_box"
ORDER = "order"
"""What the events are."""
FASTEST_HZ = 50.0
"""A source that publishes faster is kept for a shorter time than `black_box.seconds`."""
MOST_KEPT = 2000
"""Of each source."""


class SourceOrders:
    """Hears each topic of `mux.sources` by a node of its own, in the context of `beside`."""

    def __init__(self, beside: Node, robot: Robot, seconds: float) -> None:
        """`seconds`: how far a recording goes back."""
        self._robot = robot
        self._reader = MessageReader()
        depth = min(MOST_KEPT, math.ceil(seconds * FASTEST_HZ))
        qos = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._depth = depth
        self.node = rclpy.create_node(NODE, context=beside.context, enable_rosout=False, start_parameter_services=False)
        self._kept: dict[str, deque[EventEntry]] = {name: deque(maxlen=depth) for name in robot.mux.sources}
        """What was taken for the last recording, which may overlap the next one."""
        self._subscriptions: dict[str, Any] = {}
        for name, source in robot.mux.sources.items():
            try:
                self._subscriptions[name] = self.node.create_subscription(_kind(source), source.topic, _unused, qos)
            except rclpy_implementation.RCLError as error:  # SROS2 may forbid it; the driver drives all the same
                beside.get_logger().warning(f"the black box cannot hear {source.topic} of source {name}: {error}")

    def during(self, recording: Recording) -> Iterator[EventEntry]:
        """The orders since the recording began, source by source; those that wait are taken out one by one."""
        behind_s = time.time() - time.monotonic()
        for name, subscription in self._subscriptions.items():
            kept = self._kept[name]
            for event in itertools.chain(tuple(kept), self._new(name, subscription, behind_s, kept)):
                if event[0] >= recording.began_s:
                    yield event

    def _new(self, name: str, subscription: Any, behind_s: float, kept: deque[EventEntry]) -> Iterator[EventEntry]:
        """At most as many as can wait: a source that publishes meanwhile does not hold the recording up."""
        for _ in range(self._depth):
            taken = self._reader.take_with_times(subscription)
            if taken is None:
                return
            message, info = taken
            kept.append(_event({"source": name, **_order(message, self._robot)}, info, behind_s))
            yield kept[-1]


def _kind(source: MuxSource) -> Any:
    """The class of its messages."""
    if source.type == JOINTS:
        return JointState
    return TwistStamped if source.stamped else Twist


def _event(values: dict[str, Any], info: Mapping[str, Any], behind_s: float) -> EventEntry:
    """`behind_s`: of the monotonic clock to the wall clock [s]. Not every middleware has a receive time."""
    at_s = (info["received_timestamp"] or info["source_timestamp"]) * 1e-9 - behind_s
    return at_s, ORDER, values


def _order(message: Twist | TwistStamped | JointState, robot: Robot) -> dict[str, float]:
    """What a message orders. Wheel speeds that the mux refuses are NaN, which it refuses as well."""
    if isinstance(message, Twist):
        return {"linear_mps": message.linear.x, "angular_radps": message.angular.z}
    stamp_s = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
    if isinstance(message, TwistStamped):
        return {"stamp_s": stamp_s, **_order(message.twist, robot)}
    velocity = base_velocity(message, robot)
    order = velocity if isinstance(velocity, BaseVelocity) else BaseVelocity(math.nan, math.nan)
    return {"stamp_s": stamp_s, "linear_mps": order.linear_mps, "angular_radps": order.angular_radps}


def _unused(message: Any) -> None:
    """Nothing spins this node."""
