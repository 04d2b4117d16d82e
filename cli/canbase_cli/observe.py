"""The shell of `canbase doctor`: listens to a running robot for a while, and returns what it saw. Orders nothing."""

from __future__ import annotations

import time
from typing import Any, Final

import rclpy
from canbase.msg import DriverStatus, MuxState, SafetyState
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from canbase_cli.evidence import Evidence, Heard
from canbase_config.load import Loaded

LATCHED: Final = QoSProfile(depth=50, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT: Final = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Understands every publisher, reliable or not."""
TOPICS: Final[dict[str, tuple[type, QoSProfile]]] = {
    "motor_driver/status": (DriverStatus, BEST_EFFORT),
    "safety_filter/state": (SafetyState, LATCHED),
    "velocity_mux/state": (MuxState, LATCHED),
    "odom": (Odometry, BEST_EFFORT),
}
SLICE_S: Final = 0.1


class Listener:
    """Keeps what comes on the topics."""

    def __init__(self, node: Node) -> None:
        self._messages: dict[str, list[tuple[float, Any]]] = {topic: [] for topic in TOPICS}
        for topic, (kind, qos) in TOPICS.items():
            node.create_subscription(kind, topic, self._keeper(topic), qos)

    def heard(self) -> dict[str, Heard]:
        """By topic."""
        return {
            topic: Heard(tuple(message for _, message in kept), tuple(at_s for at_s, _ in kept))
            for topic, kept in self._messages.items()
        }

    def _keeper(self, topic: str) -> Any:
        kept = self._messages[topic]
        return lambda message: kept.append((time.monotonic(), message))


def observe(loaded: Loaded, ros_args: list[str], seconds: float) -> Evidence:
    """What a robot says of itself within `seconds` [s]; finding its nodes takes a part of them."""
    rclpy.init(args=ros_args, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node("canbase_doctor", enable_rosout=False)
        listener = Listener(node)
        until = time.monotonic() + seconds
        while (left_s := until - time.monotonic()) > 0.0:
            rclpy.spin_once(node, timeout_sec=min(SLICE_S, left_s))
        return Evidence(loaded.robot, str(loaded.path), time.monotonic(), listener.heard())
    finally:
        rclpy.try_shutdown()
