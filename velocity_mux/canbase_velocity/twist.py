"""The velocity of a two-wheeled base: forward speed and turning speed (REP 103)."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Twist:
    """Forward positive [m/s], counter-clockwise positive [rad/s]. May hold NaN or infinity: see `is_finite`."""

    linear_mps: float
    angular_radps: float

    @property
    def is_finite(self) -> bool:
        """Neither NaN nor infinity in it."""
        return math.isfinite(self.linear_mps) and math.isfinite(self.angular_radps)

    @property
    def is_zero(self) -> bool:
        """Both speeds are zero."""
        return self.linear_mps == 0.0 and self.angular_radps == 0.0

    def scaled(self, factor: float) -> Twist:
        """The same curve, driven `factor` (0 to 1) times as fast."""
        return Twist(self.linear_mps * factor, self.angular_radps * factor)

    def normalized(self) -> Twist:
        """The same curve with 1 m/s or 1 rad/s, whichever is the greater; for twists that are not zero."""
        greatest = max(abs(self.linear_mps), abs(self.angular_radps))
        return Twist(self.linear_mps / greatest, self.angular_radps / greatest)


ZERO = Twist(0.0, 0.0)
