"""Kinematics of the two-wheeled base: velocity of the base ↔ speed of the wheels' rims. No limits, no integration.

REP 103: x forward, z up, so a positive angular velocity turns counter-clockwise (to the left).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class Twist2D:
    """Velocity of a base that cannot move sideways. Any float is allowed, NaN too: see `is_finite`."""

    ZERO: ClassVar[Twist2D]

    linear_mps: float
    """Forward positive [m/s]."""
    angular_radps: float
    """Counter-clockwise positive [rad/s]."""

    @property
    def is_finite(self) -> bool:
        """Neither component is NaN or infinite."""
        return math.isfinite(self.linear_mps) and math.isfinite(self.angular_radps)


Twist2D.ZERO = Twist2D(0.0, 0.0)


def wheel_speeds(twist: Twist2D, track_m: float) -> tuple[float, float]:
    """Rim speeds (left, right) [m/s], forward positive, that move a base with this track by `twist`."""
    half_difference_mps = twist.angular_radps * track_m / 2.0
    return twist.linear_mps - half_difference_mps, twist.linear_mps + half_difference_mps


def base_twist(left_mps: float, right_mps: float, track_m: float) -> Twist2D:
    """Velocity of the base whose wheels roll with these rim speeds [m/s]; the inverse of `wheel_speeds`."""
    return Twist2D((left_mps + right_mps) / 2.0, (right_mps - left_mps) / track_m)
