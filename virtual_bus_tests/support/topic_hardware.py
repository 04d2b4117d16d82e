"""A stand-in for ros2_control with joint_state_topic_hardware_interface 1.1.0, as its `read` and `write` are.

It publishes the joints of its tag with the velocity commands that a controller has set, stamped now, at the rate of the
controller manager, and takes the measured speeds from joint_states. With the threshold -1, which canbase print urdf
writes, the original publishes them also at rest.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any

from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

RATE_HZ = 100.0


class TopicHardware:
    """One <ros2_control> tag. `commands`: what its controller has set [rad/s]; `states`: what it has read."""

    def __init__(self, node: Node, joints: Sequence[str], topic: str) -> None:
        self.commands = dict.fromkeys(joints, 0.0)
        self.states = dict.fromkeys(joints, math.nan)
        self.alive = True
        self._node = node
        self.publisher = node.create_publisher(JointState, topic, 1)
        node.create_subscription(JointState, "joint_states", self._read, qos_profile_sensor_data)
        node.create_timer(1.0 / RATE_HZ, self._write)

    def set(self, *radps: float) -> float:
        """The controller's newest commands, in the order of the joints; when it set them (time.monotonic)."""
        self.commands = dict(zip(self.commands, radps, strict=True))
        return time.monotonic()

    def _read(self, message: Any) -> None:
        for name, velocity in zip(message.name, message.velocity, strict=True):
            if name in self.states and math.isfinite(velocity):
                self.states[name] = velocity

    def _write(self) -> None:
        if not self.alive:
            return
        message = JointState(name=list(self.commands), velocity=list(self.commands.values()))
        message.header.stamp = self._node.get_clock().now().to_msg()
        self.publisher.publish(message)
