"""The joystick of the scenarios: a process above the robot's own, so that no busy processor makes it fall silent.

Its argument is the topic. Standard input: a velocity [m/s] a line, repeated until the next one; `none` lets go. It ends
with that.
"""

from __future__ import annotations

import os
import select
import sys
import time

from canbase_cli.middleware import prefer_udp

prefer_udp(os.environ)

import rclpy  # noqa: E402 - reads the environment
from geometry_msgs.msg import TwistStamped  # noqa: E402
from rclpy.publisher import Publisher  # noqa: E402
from rclpy.signals import SignalHandlerOptions  # noqa: E402

from vm.guest.stick import NONE  # noqa: E402
from vm.guest.system import set_priority  # noqa: E402

PERIOD_S = 0.1
PRIORITY = 50
"""SCHED_FIFO: above canbase's 30 to 40, below the simulated drives."""


def order_of(line: str) -> float | None:
    """What a line of standard input orders."""
    return None if line == NONE else float(line)


def main() -> None:
    """Until standard input ends."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # a reboot ends this process at once
    topic = sys.argv[1]
    node = rclpy.create_node(topic.replace("/", "_"), enable_rosout=False, start_parameter_services=False)
    publisher = node.create_publisher(TwistStamped, topic, 1)
    set_priority(os.getpid(), PRIORITY)  # not before: its start would hold up the robot
    print("ready", flush=True)
    order_mps: float | None = None
    next_s = time.monotonic()
    while True:
        if select.select([sys.stdin.fileno()], [], [], max(0.0, next_s - time.monotonic()))[0]:
            lines = os.read(sys.stdin.fileno(), 4096).decode().split()
            if not lines:
                return
            for line in lines:  # each of them counts: a zero that is let go of at once is still a zero
                order_mps = order_of(line)
                _publish(publisher, order_mps)
            next_s = time.monotonic()
        else:
            _publish(publisher, order_mps)
        next_s += PERIOD_S


def _publish(publisher: Publisher, order_mps: float | None) -> None:
    if order_mps is not None:
        message = TwistStamped()
        message.twist.linear.x = order_mps
        publisher.publish(message)


if __name__ == "__main__":
    main()
