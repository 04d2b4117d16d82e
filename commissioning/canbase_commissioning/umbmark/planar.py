"""Poses on the ground as arrays of x [m], y [m], yaw [rad], and the way of a base from the angles of its wheels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Wheels:
    """What is calibrated [m]."""

    left_m: float
    """Wheel radius on the left."""
    right_m: float
    track_m: float

    @property
    def radius_m(self) -> float:
        """Mean radius: base.wheel_radius_m."""
        return (self.left_m + self.right_m) / 2.0

    @property
    def ratio(self) -> float:
        """Right over left: base.wheel_ratio."""
        return self.right_m / self.left_m


def pose(x_m: float, y_m: float, yaw_rad: float) -> Array:
    """As an array."""
    return np.array([x_m, y_m, yaw_rad])


def compose(first: Array, then: Array) -> Array:
    """The pose that is `then` as seen from `first`."""
    cos, sin = math.cos(first[2]), math.sin(first[2])
    return pose(
        first[0] + cos * then[0] - sin * then[1], first[1] + sin * then[0] + cos * then[1], wrapped(first[2] + then[2])
    )


def inverse(one: Array) -> Array:
    """The origin as seen from `one`."""
    cos, sin = math.cos(one[2]), math.sin(one[2])
    return pose(-cos * one[0] - sin * one[1], sin * one[0] - cos * one[1], -one[2])


def between(start: Array, end: Array) -> Array:
    """`end` as seen from `start`."""
    return compose(inverse(start), end)


def moved(points: Array, by: Array) -> Array:
    """n × 2 points, seen from the frame in which `by` is the pose of theirs."""
    cos, sin = math.cos(by[2]), math.sin(by[2])
    turned: Array = points @ np.array([[cos, sin], [-sin, cos]]) + by[:2]
    return turned


def wrapped(angle_rad: float) -> float:
    """-π to π."""
    return math.remainder(angle_rad, math.tau)


def rolled(angles_rad: Array, wheels: Wheels) -> Array:
    """Pose of the base at the end, as seen from the start, with exact arcs between samples. `angles_rad`: n × 2."""
    steps = np.diff(angles_rad, axis=0)
    left_m, right_m = steps[:, 0] * wheels.left_m, steps[:, 1] * wheels.right_m
    distance_m, turn_rad = (left_m + right_m) / 2.0, (right_m - left_m) / wheels.track_m
    yaw_rad = np.concatenate(([0.0], np.cumsum(turn_rad)))
    middle_rad = yaw_rad[:-1] + turn_rad / 2.0
    chord_m = distance_m * np.sinc(turn_rad / math.tau)
    return pose(float(chord_m @ np.cos(middle_rad)), float(chord_m @ np.sin(middle_rad)), wrapped(float(yaw_rad[-1])))
