"""The motion of rotate_angle: in place, over a signed angle that may be more than one turn."""

from __future__ import annotations

import math

from canbase_action_server.along_track import displacement
from canbase_action_server.inputs import Odometry
from canbase_action_server.motion import BaseTwist, Motion
from canbase_action_server.profile import ProfileLimits


class TurnMotion(Motion):
    """From the odometry at the start, `angle_rad` (signed, not 0). Its way is that of the wheels, `lever_m` outside."""

    def __init__(self, start: Odometry, angle_rad: float, lever_m: float, limits: ProfileLimits) -> None:
        super().__init__(start, angle_rad * lever_m, limits)
        self._angle_rad = angle_rad
        self._lever_m = lever_m
        self._turned_rad = 0.0

    @property
    def traveled_m(self) -> float:
        """Of the wheels on their circle, signed [m]."""
        return self._turned_rad * self._lever_m

    def speed_mps(self, odometry: Odometry) -> float:
        """Of the wheels on their circle [m/s]."""
        return abs(odometry.angular_radps) * self._lever_m

    def report(self) -> str:
        """How far, and how far from where it began."""
        return (
            f"turned {self._turned_rad:+.4f} rad of {self._angle_rad:+.4f} rad, {self._shift_m:.4f} m beside the place"
        )

    def strayed(self, lateral_m: float, heading_rad: float) -> str:
        """Away from its place. About a wheel that stands the base swings to the side of that wheel."""
        if self._shift_m <= lateral_m:
            return ""
        slow = "left" if displacement(self._start, self._last.pose).lateral_m > 0.0 else "right"
        return (
            f"{self._shift_m:.3f} m away from where the turn began (tolerance action.lateral_tolerance_m {lateral_m}); "
            f"does the {slow} wheel turn as ordered?"
        )

    @property
    def _shift_m(self) -> float:
        start, last = self._start, self._last.pose
        return math.hypot(last.x_m - start.x_m, last.y_m - start.y_m)

    def _step_m(self, odometry: Odometry) -> float:
        last = self._last.pose
        shift_m = math.hypot(odometry.pose.x_m - last.x_m, odometry.pose.y_m - last.y_m)
        return max(shift_m, abs(self._step_rad(odometry)) * self._lever_m)

    def _take_in(self, odometry: Odometry) -> None:
        self._turned_rad += self._step_rad(odometry)

    def _step_rad(self, odometry: Odometry) -> float:
        """Since the last pose, the short way round: no base turns half a turn between two messages."""
        return math.remainder(odometry.pose.yaw_rad - self._last.pose.yaw_rad, 2.0 * math.pi)

    def _twist(self, speed_mps: float) -> BaseTwist:
        return BaseTwist(0.0, self._sign * speed_mps / self._lever_m)
