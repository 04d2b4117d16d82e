"""How the base is expected to move, by what was ordered: the driver's ordinary ramps (ramp.py).

The filter has no odometry on purpose: a lie there must not open the way. What it needs is only how the base leaves the
motion that it is in, and how far it can have come since a scan; both ways, moved and not moved, are looked at.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from canbase_config.robot import Limits
from canbase_velocity.ramp import AT_REST, follow
from canbase_velocity.sweep import Floats
from canbase_velocity.twist import ZERO, Twist

LONGEST_TIME_S = 1.0
"""A longer gap between two looks counts as this one [s]."""
STEP_S = 0.05
"""The velocity changes in steps no longer than this."""
STILL_M = 1e-6
"""A way or, at one metre, a turn below this is none."""


@dataclass(frozen=True, slots=True)
class Pose:
    """Where the base is, in a frame that stands still."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0

    def moved(self, twist: Twist, dt_s: float) -> Pose:
        """After `dt_s` of `twist`: an arc."""
        way_m, turn_rad = twist.linear_mps * dt_s, twist.angular_radps * dt_s
        half_rad = turn_rad / 2.0
        chord_m = way_m * math.sin(half_rad) / half_rad if half_rad else way_m
        heading_rad = self.yaw_rad + half_rad
        x_m, y_m = self.x_m + chord_m * math.cos(heading_rad), self.y_m + chord_m * math.sin(heading_rad)
        return Pose(x_m, y_m, self.yaw_rad + turn_rad)

    def towards(self, other: Pose, share: float) -> Pose:
        """On the way to `other`; a share above 1 is 1."""
        share = min(share, 1.0)
        return Pose(
            self.x_m + (other.x_m - self.x_m) * share,
            self.y_m + (other.y_m - self.y_m) * share,
            self.yaw_rad + (other.yaw_rad - self.yaw_rad) * share,
        )

    def is_at(self, other: Pose) -> bool:
        """The same place, but for less than `STILL_M`."""
        apart_m = math.hypot(self.x_m - other.x_m, self.y_m - other.y_m)
        return apart_m < STILL_M and abs(self.yaw_rad - other.yaw_rad) < STILL_M

    def from_here(self, points: Floats, there: Pose) -> Floats:
        """Points seen from `there`, as they are seen from this pose."""
        turn_rad = there.yaw_rad - self.yaw_rad
        x_m, y_m = there.x_m - self.x_m, there.y_m - self.y_m
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        shift_m = np.array((cos * x_m + sin * y_m, cos * y_m - sin * x_m))
        turn = np.array(((math.cos(turn_rad), math.sin(turn_rad)), (-math.sin(turn_rad), math.cos(turn_rad))))
        seen: Floats = points @ turn + shift_m
        return seen


class ExpectedMotion:
    """The motion over time: `order` gives what holds from now on."""

    def __init__(self, limits: Limits, memory_s: float) -> None:
        """`memory_s`: how far back `pose_at` reaches [s]."""
        self._limits = limits
        self._memory_s = memory_s
        self._order = ZERO
        self.moving = AT_REST
        """The velocity expected now, and how it changes."""
        self._poses: deque[tuple[float, Pose]] = deque([(-math.inf, Pose())])

    def advance(self, now_s: float) -> Pose:
        """Lets the time pass until `now_s` [s, monotonic]; the pose there."""
        at_s, pose = self._poses[-1]
        left_s = min(max(now_s - at_s, 0.0), LONGEST_TIME_S)
        while left_s > 0.0:
            dt_s = min(left_s, STEP_S)
            left_s -= dt_s
            pose = self._step(pose, dt_s)
        self._poses.append((now_s, pose))
        while len(self._poses) > 2 and self._poses[1][0] < now_s - self._memory_s:
            self._poses.popleft()
        return pose

    def _step(self, pose: Pose, dt_s: float) -> Pose:
        before, self.moving = self.moving.twist, follow(self.moving, self._order, self._limits, dt_s)
        after = self.moving.twist
        mean = Twist((before.linear_mps + after.linear_mps) / 2.0, (before.angular_radps + after.angular_radps) / 2.0)
        return pose.moved(mean, dt_s)

    def order(self, twist: Twist, now_s: float) -> None:
        """From `now_s` on this is ordered."""
        self.advance(now_s)
        self._order = twist

    def pose_at(self, at_s: float) -> Pose:
        """The pose at that time, between the two that are remembered around it."""
        later_s, later = self._poses[-1]
        for since_s, pose in reversed(self._poses):
            if since_s <= at_s:
                span_s = later_s - since_s
                return pose.towards(later, (at_s - since_s) / span_s if 0.0 < span_s < math.inf else 1.0)
            later_s, later = since_s, pose
        return later
