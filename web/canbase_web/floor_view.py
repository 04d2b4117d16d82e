"""The robot from above, for the page `Now`: footprint, what the safety filter looks at, the points of scans. Pure."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from canbase_config.robot import Robot
from canbase_config.safety import Scan as ScanConfig
from canbase_velocity.placement import Placement

MOST_POINTS: Final = 240
"""Of a scan; a browser needs no more for a picture of some hundred pixels."""
SIGHT_M: Final = 3.0
"""Points farther away are not in the picture."""


def outlines(robot: Robot) -> dict[str, Any]:
    """Rectangles in base_link [m], each front, rear, left, right: the footprint, and the ways that must be free."""
    safety = robot.safety
    edge = safety.footprint

    def around(distance_m: float) -> list[float]:
        side_m = safety.padding_m
        return [edge.front_m + distance_m, edge.rear_m + distance_m, edge.left_m + side_m, edge.right_m + side_m]

    return {
        "footprint": [edge.front_m, edge.rear_m, edge.left_m, edge.right_m],
        "stop": around(safety.stop_distance_m),
        "slow": around(safety.slow_distance_m),
        "wheels": [[0.0, side * robot.base.track_m / 2.0, robot.base.wheel_radius_m] for side in (1, -1)],
        "sight": SIGHT_M,
    }


def points(scanner: ScanConfig, message: Any) -> list[list[float]]:
    """The readings of a sensor_msgs/LaserScan in base_link [m], as robot.yaml places the scanner; a part of them."""
    ranges_m = np.asarray(message.ranges, dtype=float)
    with np.errstate(invalid="ignore"):  # infinity times zero
        angles = message.angle_min + message.angle_increment * np.arange(len(ranges_m))
    usable = (ranges_m >= message.range_min) & (ranges_m <= min(message.range_max, SIGHT_M)) & np.isfinite(angles)
    step = max(1, int(np.ceil(len(ranges_m) / MOST_POINTS)))
    kept = np.flatnonzero(usable)
    kept = kept[kept % step == 0]
    x_m, y_m = ranges_m[kept] * np.cos(angles[kept]), ranges_m[kept] * np.sin(angles[kept])
    places = Placement.of(scanner).points(x_m, y_m)
    return [[round(float(x), 2), round(float(y), 2)] for x, y in places]
