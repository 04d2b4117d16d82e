"""A straight motion over a signed distance: joins the profile with what odometry says, and keeps to the start line."""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_action_server.along_track import Displacement, displacement
from canbase_action_server.inputs import Odometry
from canbase_action_server.profile import Profile, ProfileLimits, ideal_time_s

HEADING_GAIN_PER_S = 1.5
LATERAL_GAIN_PER_M = 4.0
"""With both gains the lateral error dies out along the way, in either direction of travel, without swinging."""
STEERING_RADPM = 0.5
"""Largest curvature that the correction may order [rad per m driven]: it never turns a standing base."""
JUMP_M = 0.1
"""A pose farther from the last one than twice the speed explains, plus this, is no motion: odometry was reset."""


@dataclass(frozen=True, slots=True)
class Twist:
    """A velocity order for the base, REP 103."""

    linear_mps: float = 0.0
    angular_radps: float = 0.0


STOP = Twist()


class StraightMotion:
    """One goal's way: from the odometry at its start, `distance_m` (signed, not 0) along the heading there."""

    def __init__(self, start: Odometry, distance_m: float, limits: ProfileLimits) -> None:
        if not (math.isfinite(distance_m) and distance_m != 0.0):
            raise ValueError(f"distance_m must be finite and not 0, not {distance_m}")
        self._start = start.pose
        self._last = start
        self._distance_m = distance_m
        self._sign = math.copysign(1.0, distance_m)
        self._limits = limits
        self._profile = Profile(limits)
        self._now_at = Displacement(0.0, 0.0, 0.0)
        self.overshoot_m = 0.0
        """Farthest seen beyond the goal [m], >= 0."""

    @property
    def ideal_s(self) -> float:
        """Time that the motion takes when nothing hinders it [s]."""
        return ideal_time_s(abs(self._distance_m), self._limits)

    @property
    def traveled_m(self) -> float:
        """Along the start heading, signed [m]."""
        return self._now_at.along_m

    @property
    def lateral_m(self) -> float:
        """Beside the start line, left positive [m]."""
        return self._now_at.lateral_m

    @property
    def remaining_m(self) -> float:
        """Still to drive, negative once beyond the goal [m]."""
        return self._sign * (self._distance_m - self._now_at.along_m)

    def observe(self, odometry: Odometry) -> bool:
        """Take in the newest odometry. False: the pose jumped, this is not the motion of the base."""
        step_m = math.hypot(odometry.pose.x_m - self._last.pose.x_m, odometry.pose.y_m - self._last.pose.y_m)
        possible_m = 2.0 * self._limits.speed_mps * (odometry.received - self._last.received) + JUMP_M
        if step_m > possible_m:
            return False
        self._last = odometry
        self._now_at = displacement(self._start, odometry.pose)
        self.overshoot_m = max(self.overshoot_m, -self.remaining_m)
        return True

    def order(self, now: float) -> Twist | None:
        """The velocity to order now. None: order to stand, the distance is driven. Call once per control cycle."""
        speed_mps = self._profile.order(self.remaining_m, self._last.received, now)
        return None if speed_mps is None else Twist(self._sign * speed_mps, self._steering(speed_mps))

    def stop(self, now: float) -> Twist:
        """The order to stand, remembered by the profile."""
        self._profile.stop(now)
        return STOP

    def _steering(self, speed_mps: float) -> float:
        at = self._now_at
        velocity_mps = self._sign * speed_mps
        wanted_radps = -HEADING_GAIN_PER_S * at.heading_rad - LATERAL_GAIN_PER_M * velocity_mps * at.lateral_m
        most_radps = STEERING_RADPM * speed_mps
        return max(-most_radps, min(most_radps, wanted_radps))
