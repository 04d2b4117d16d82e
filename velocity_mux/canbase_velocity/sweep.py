"""What the footprint sweeps when it drives an arc, a straight line or turns on the spot: pure geometry, vectorised.

Seen from the base, every point of the world moves on a circle about the centre of the turn (0, v/w), or on a straight
line. Where that circle crosses the edges of the rectangle, the point enters or leaves it. No speeds are decided here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from canbase_config.safety import Footprint
from canbase_velocity.twist import Twist

Floats: TypeAlias = "npt.NDArray[np.float64]"
Bools: TypeAlias = "npt.NDArray[np.bool_]"

STRAIGHT_M = 10_000.0
"""An arc with a greater radius counts as straight: over 10 m it leaves the line by 5 mm."""
EDGE_M = 1e-9
"""A point so near to an edge is on it, and counts as outside: it enters at once, whichever way it moves."""
TOUCH_RAD = 1e-9
FULL_TURN_RAD = 2.0 * math.pi


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle in base_link; distances from its origin to the edges [m]."""

    front_m: float
    rear_m: float
    left_m: float
    right_m: float

    @staticmethod
    def of(footprint: Footprint, padding_m: float) -> Box:
        """The footprint, larger by the padding on all sides."""
        sides = (footprint.front_m, footprint.rear_m, footprint.left_m, footprint.right_m)
        return Box(*(side + padding_m for side in sides))

    @property
    def radius_m(self) -> float:
        """Radius of the circle that it sweeps when turning on the spot [m]."""
        return math.hypot(max(self.front_m, self.rear_m), max(self.left_m, self.right_m))

    def distances_m(self, points: Floats) -> Floats:
        """Of each point to the rectangle [m]; 0 inside."""
        x_m, y_m = points[:, 0], points[:, 1]
        beyond_x_m = np.maximum(np.maximum(x_m - self.front_m, -self.rear_m - x_m), 0.0)
        beyond_y_m = np.maximum(np.maximum(y_m - self.left_m, -self.right_m - y_m), 0.0)
        return np.hypot(beyond_x_m, beyond_y_m)

    def contains(self, points: Floats, within_m: float = 0.0) -> Bools:
        """Which points are inside, by more than `within_m` from each edge; on an edge counts as inside with 0."""
        x_m, y_m = points[:, 0], points[:, 1]
        ahead, behind = x_m <= self.front_m - within_m, x_m >= within_m - self.rear_m
        left, right = y_m <= self.left_m - within_m, y_m >= within_m - self.right_m
        inside: Bools = ahead & behind & left & right
        return inside

    def edge(self, per_side: int) -> Floats:
        """Points along the four sides, the corners among them. Read-only: every decision needs the same ones."""
        return _edge(self, per_side)


@lru_cache(maxsize=16)
def _edge(box: Box, per_side: int) -> Floats:
    share = np.linspace(0.0, 1.0, per_side, endpoint=False)
    x_m, y_m = box.front_m + box.rear_m, box.left_m + box.right_m
    front = np.column_stack((np.full(per_side, box.front_m), box.left_m - share * y_m))
    right = np.column_stack((box.front_m - share * x_m, np.full(per_side, -box.right_m)))
    rear = np.column_stack((np.full(per_side, -box.rear_m), share * y_m - box.right_m))
    left = np.column_stack((share * x_m - box.rear_m, np.full(per_side, box.left_m)))
    points = np.vstack((front, right, rear, left))
    points.flags.writeable = False
    return points


@dataclass(frozen=True, slots=True)
class Touch:
    """The nearest contact on the path. `slack_s`: until the stop distance, at the given speed; below 0: passed."""

    slack_s: float
    way_m: float
    """What the touched point still moves, seen from the base, until it touches [m]; infinity: nothing is touched."""


NO_TOUCH = Touch(math.inf, math.inf)


def fastest_mps(box: Box, twist: Twist) -> float:
    """Speed of the fastest point of the rectangle [m/s]: one of its corners."""
    corners = ((x_m, y_m) for x_m in (box.front_m, -box.rear_m) for y_m in (box.left_m, -box.right_m))
    turn = twist.angular_radps
    return max(math.hypot(twist.linear_mps - turn * y_m, turn * x_m) for x_m, y_m in corners)


def first_touch(points: Floats, box: Box, twist: Twist, stop_m: float) -> Touch:
    """The touch that leaves the least time until `stop_m` before it, at the speed of `twist`, which is not zero.

    A point inside the rectangle is touched already, unless the base moves so that the point leaves it by the shorter
    way; then only what comes after that counts.
    """
    if points.shape[0] == 0:
        return NO_TOUCH
    speed_mps, turn_radps = abs(twist.linear_mps), abs(twist.angular_radps)
    if speed_mps > turn_radps * STRAIGHT_M:
        ways_m = _straight_ways_m(points, box, math.copysign(1.0, twist.linear_mps))
        with np.errstate(over="ignore"):  # a speed next to nothing takes for ever
            slacks_s = (ways_m - stop_m) / speed_mps
    else:
        ways_m, speeds_mps = _arc_ways_m(points, box, twist)
        slacks_s = (ways_m - stop_m) / speeds_mps
    nearest = int(slacks_s.argmin())
    return Touch(float(slacks_s[nearest]), float(ways_m[nearest]))


def _straight_ways_m(points: Floats, box: Box, sign: float) -> Floats:
    along_m, y_m = sign * points[:, 0], points[:, 1]
    front_m, rear_m = (box.front_m, box.rear_m) if sign > 0.0 else (box.rear_m, box.front_m)
    in_corridor = (y_m <= box.left_m) & (y_m >= -box.right_m)
    leaves = along_m + rear_m < front_m - along_m
    ways_m: Floats = np.where(in_corridor & ~leaves, np.maximum(along_m - front_m, 0.0), np.inf)
    return ways_m


def _arc_ways_m(points: Floats, box: Box, twist: Twist) -> tuple[Floats, Floats]:
    """The ways along the arc [m], and the speeds of the points on it [m/s]."""
    centre_m = twist.linear_mps / twist.angular_radps
    x_m, y_m = points[:, 0], points[:, 1] - centre_m
    radii_m = np.hypot(x_m, y_m)
    travels_rad = _crossings_rad(x_m, y_m, radii_m, box, centre_m, math.copysign(1.0, twist.angular_radps))
    inside = box.contains(points, EDGE_M)
    # On an edge, rounding makes 0 out of a full turn or the other way round: it enters at once.
    on_edge = ~inside[:, np.newaxis] & (travels_rad >= FULL_TURN_RAD - TOUCH_RAD) & np.isfinite(travels_rad)
    travels_rad = np.where(on_edge, 0.0, travels_rad)
    travels_rad.sort(axis=1)
    enters_rad = np.where(inside, _after_leaving_rad(travels_rad), travels_rad[:, 0])
    # Next to the centre of the turn a point does not move: the smallest number keeps the quotient defined.
    speeds_mps = np.maximum(radii_m * abs(twist.angular_radps), np.finfo(np.float64).tiny)
    return enters_rad * radii_m, speeds_mps


def _crossings_rad(x_m: Floats, y_m: Floats, radii_m: Floats, box: Box, centre_m: float, sign: float) -> Floats:
    """How far each point turns about the centre until each crossing of an edge, 0 to 2π; infinity: no crossing.

    `x_m`, `y_m` are seen from the centre of the turn; `sign` is that of the base's turn: points turn the other way.
    """
    edges_x_m = np.array((box.front_m, -box.rear_m))
    edges_y_m = np.array((box.left_m, -box.right_m)) - centre_m
    square_m2 = (radii_m**2)[:, np.newaxis]
    rest_y_m2, rest_x_m2 = square_m2 - edges_x_m**2, square_m2 - edges_y_m**2
    other_y_m, other_x_m = np.sqrt(np.maximum(rest_y_m2, 0.0)), np.sqrt(np.maximum(rest_x_m2, 0.0))
    across_x_m = np.broadcast_to(edges_x_m, other_y_m.shape)
    across_y_m = np.broadcast_to(edges_y_m, other_x_m.shape)
    at_x_m = np.concatenate((across_x_m, across_x_m, other_x_m, -other_x_m), axis=1)
    at_y_m = np.concatenate((other_y_m, -other_y_m, across_y_m, across_y_m), axis=1)
    exist = np.concatenate((rest_y_m2, rest_y_m2, rest_x_m2, rest_x_m2), axis=1) >= 0.0
    on_edge = (
        (at_x_m <= box.front_m + EDGE_M)
        & (at_x_m >= -box.rear_m - EDGE_M)
        & (at_y_m <= edges_y_m[0] + EDGE_M)
        & (at_y_m >= edges_y_m[1] - EDGE_M)
    )
    turned_rad = sign * (np.arctan2(y_m, x_m)[:, np.newaxis] - np.arctan2(at_y_m, at_x_m))
    travels_rad: Floats = np.where(exist & on_edge, np.mod(turned_rad, FULL_TURN_RAD), np.inf)
    return travels_rad


def _after_leaving_rad(travels_rad: Floats) -> Floats:
    """For points inside, from their sorted crossings: 0 when they are touched, else where they enter again."""
    counts = np.isfinite(travels_rad).sum(axis=1)
    last_rad = travels_rad[np.arange(counts.size), np.maximum(counts - 1, 0)]
    leaves = (counts > 0) & (travels_rad[:, 0] < FULL_TURN_RAD - last_rad)
    enters_rad: Floats = np.where(leaves, travels_rad[:, 1], 0.0)
    return enters_rad
