"""Prints READY for `canbase up`, and ends: `python -m canbase_cli.ready PARENT_PID NAMESPACE [ROS arguments]`.

A process of its own, so that `canbase up` has no ROS in it. It orders nothing, and nothing depends on it.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from typing import Any

from canbase_cli.child import end_with
from canbase_cli.options import ros_needed
from canbase_cli.readiness import Seen, Teller, missing
from canbase_runtime.driver_state import driver_state
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable

LOOK_S = 0.1


class Listener:
    """Keeps `seen` up to date while its node spins."""

    def __init__(self, node: Any) -> None:
        from canbase.action import DriveDistance
        from canbase.msg import DriverStatus
        from nav_msgs.msg import Odometry
        from rclpy.action import ActionClient
        from rclpy.qos import QoSProfile, ReliabilityPolicy

        self._seen = Seen()
        self._server = ActionClient(node, DriveDistance, node.resolve_topic_name("drive_distance"))
        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        node.create_subscription(DriverStatus, "motor_driver/status", self._on_status, newest)
        node.create_subscription(Odometry, "odom", self._on_odometry, newest)

    @property
    def seen(self) -> Seen:
        """Until now."""
        return replace(self._seen, has_server=self._server.server_is_ready())

    def _on_status(self, message: Any) -> None:
        self._seen = replace(
            self._seen,
            state=driver_state(message.state),
            detail=printable(message.detail, SENTENCE_LENGTH),
            hears_command=message.command_fresh,
        )

    def _on_odometry(self, _message: Any) -> None:
        self._seen = replace(self._seen, has_odometry=True)


def main(namespace: str, ros_args: list[str]) -> None:
    """Until the robot is ready."""
    began_s = time.monotonic()
    with ros_needed():
        import rclpy
        from rclpy.signals import SignalHandlerOptions
    rclpy.init(args=ros_args, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("canbase_up", enable_rosout=False)
    listener, teller = Listener(node), Teller(namespace, began_s)
    while True:
        rclpy.spin_once(node, timeout_sec=LOOK_S)
        seen = listener.seen
        line = teller.line(seen, time.monotonic())
        if line is not None:
            print(f"canbase: {line}", file=sys.stderr, flush=True)
        if missing(seen) is None:
            break
    rclpy.try_shutdown()


if __name__ == "__main__":
    end_with(int(sys.argv[1]))
    main(sys.argv[2], sys.argv[3:])
