"""The straight motion of drive_distance: along the heading at the start, and steered back to that line."""

from __future__ import annotations

import math

from canbase_action_server.along_track import Displacement, displacement
from canbase_action_server.inputs import Odometry
from canbase_action_server.motion import BaseTwist, Motion
from canbase_action_server.profile import ProfileLimits

HEADING_GAIN_PER_S = 1.5
LATERAL_GAIN_PER_M = 4.0
"""With both gains the lateral error dies out along the way, in either direction of travel, without swinging."""
STEERING_RADPM = 0.5
"""Largest curvature that the correction may order [rad per m driven]: it never turns a standing base."""


class StraightMotion(Motion):
    """From the odometry at the start, `distance_m` (signed, not 0) along the heading there."""

    def __init__(self, start: Odometry, distance_m: float, limits: ProfileLimits) -> None:
        super().__init__(start, distance_m, limits)
        self._now_at = Displacement(0.0, 0.0, 0.0)

    @property
    def traveled_m(self) -> float:
        """Along the start heading, signed [m]."""
        return self._now_at.along_m

    @property
    def lateral_m(self) -> float:
        """Beside the start line, left positive [m]."""
        return self._now_at.lateral_m

    def speed_mps(self, odometry: Odometry) -> float:
        """Of the base [m/s]."""
        return abs(odometry.linear_mps)

    def report(self) -> str:
        """How far, and how far beside the line."""
        return f"drove {self.traveled_m:+.4f} m of {self._way_m:+.4f} m, {self.lateral_m:+.4f} m beside the line"

    def strayed(self, lateral_m: float, heading_rad: float) -> str:
        """Beside the line, or turned away from it. Odometry sees what the wheels do: slip is not in it."""
        at = self._now_at
        if abs(at.lateral_m) <= lateral_m and abs(at.heading_rad) <= heading_rad:
            return ""
        slow = "left" if at.heading_rad * self._sign > 0.0 else "right"
        return (
            f"{at.lateral_m:+.3f} m beside the line and turned away by {at.heading_rad:+.3f} rad (tolerances: "
            f"action.lateral_tolerance_m {lateral_m}, action.heading_tolerance_rad {heading_rad}); "
            f"does the {slow} wheel turn as ordered?"
        )

    def _step_m(self, odometry: Odometry) -> float:
        return math.hypot(odometry.pose.x_m - self._last.pose.x_m, odometry.pose.y_m - self._last.pose.y_m)

    def _take_in(self, odometry: Odometry) -> None:
        self._now_at = displacement(self._start, odometry.pose)

    def _twist(self, speed_mps: float) -> BaseTwist:
        at = self._now_at
        velocity_mps = self._sign * speed_mps
        wanted_radps = -HEADING_GAIN_PER_S * at.heading_rad - LATERAL_GAIN_PER_M * velocity_mps * at.lateral_m
        most_radps = STEERING_RADPM * speed_mps
        return BaseTwist(velocity_mps, max(-most_radps, min(most_radps, wanted_radps)))
