"""Where the base is, seen from where it started: distance along the start heading, deviation to the side, heading.

Signed, unlike a norm of the displacement: a base that rolls backward counts down. Frames and signs follow REP 103.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BasePose:
    """Pose of the base in the odometry frame: position [m], heading [rad, counter-clockwise positive]."""

    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class Displacement:
    """A pose in the frame of the start pose."""

    along_m: float
    """Along the start heading, forward positive."""
    lateral_m: float
    """To the side of the start line, left positive."""
    heading_rad: float
    """Turned since the start, in (-pi, pi], counter-clockwise positive."""


def yaw_of_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Rotation about z of a unit quaternion (geometry_msgs order), in [-pi, pi]."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def displacement(start: BasePose, pose: BasePose) -> Displacement:
    """`pose` as seen from `start`."""
    dx_m, dy_m = pose.x_m - start.x_m, pose.y_m - start.y_m
    cos, sin = math.cos(start.yaw_rad), math.sin(start.yaw_rad)
    turned_rad = math.remainder(pose.yaw_rad - start.yaw_rad, 2.0 * math.pi)
    return Displacement(along_m=cos * dx_m + sin * dy_m, lateral_m=cos * dy_m - sin * dx_m, heading_rad=turned_rad)
