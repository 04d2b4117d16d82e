"""A bare rclpy node with one timer and one publisher at 100 Hz: the floor for what a node of the chain takes.

Run it as a program. It has the priority of a node of the chain where it may.
"""

from __future__ import annotations

import contextlib
import os

import rclpy
from geometry_msgs.msg import TwistStamped

PRIORITY = 35
PERIOD_S = 0.01


def main() -> None:
    """Until a signal ends the process."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    rclpy.init()
    node = rclpy.create_node("bare")
    publisher = node.create_publisher(TwistStamped, "bare", 10)

    def tick() -> None:
        message = TwistStamped()
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)

    node.create_timer(PERIOD_S, tick)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
