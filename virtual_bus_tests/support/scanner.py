"""A laser scanner as real ones are: each scan has its own stamp, and readings with 1 mm of noise."""

from __future__ import annotations

import copy
import math
import random

from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header

from support.ros_harness import Repeater, TestNode

BEAMS = 360
STEP_RAD = 2.0 * math.pi / BEAMS
NOISE_M = 0.001


def all_around(ranges: list[float]) -> LaserScan:
    """A scan with these BEAMS readings, from straight ahead on to the left."""
    return LaserScan(
        angle_max=(BEAMS - 1) * STEP_RAD, angle_increment=STEP_RAD, range_min=0.05, range_max=10.0, ranges=ranges
    )


def scanner(node: TestNode, topic: str = "scan") -> Repeater[LaserScan]:
    """Sends its `message` 20 times a second."""
    made: Repeater[LaserScan] = node.repeat(LaserScan, topic, 20.0, qos_profile_sensor_data)

    def prepare(message: LaserScan) -> LaserScan:
        fresh = copy.copy(message)
        fresh.header = Header(stamp=node.node.get_clock().now().to_msg(), frame_id=message.header.frame_id)
        fresh.ranges = [range_m + random.uniform(-NOISE_M, NOISE_M) for range_m in message.ranges]
        return fresh

    made.prepare = prepare
    return made
