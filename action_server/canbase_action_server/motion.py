"""A motion over a signed distance or angle: combines the profile with odometry. Subclasses: straight.py, turn.py.

A way is in metres: that of the base, or for a turn in place that of the wheels on their circle. So one profile, one
tolerance and one standstill serve both.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

from canbase_action_server.inputs import Odometry
from canbase_action_server.profile import Profile, ProfileLimits, ideal_time_s

JUMP_M = 0.1
"""A pose farther from the last one than twice the speed explains, plus this, is no motion: odometry was reset."""


@dataclass(frozen=True, slots=True)
class BaseTwist:
    """A velocity order for the base, REP 103."""

    linear_mps: float = 0.0
    angular_radps: float = 0.0


STOP = BaseTwist()


class Motion(ABC):
    """One goal's way from the odometry at its start. Call `order` or `stop` once per control cycle."""

    def __init__(self, start: Odometry, way_m: float, limits: ProfileLimits) -> None:
        """`way_m` is signed, finite and not 0; ValueError otherwise."""
        if not (math.isfinite(way_m) and way_m != 0.0):
            raise ValueError(f"a way must be finite and not 0, not {way_m}")
        self._start = start.pose
        self._last = start
        self._way_m = way_m
        self._sign = math.copysign(1.0, way_m)
        self._limits = limits
        self._profile = Profile(limits)
        self.overshoot_m = 0.0
        """Farthest seen beyond the goal [m], >= 0."""

    @property
    def ideal_s(self) -> float:
        """Time that the motion takes when nothing hinders it [s]."""
        return ideal_time_s(abs(self._way_m), self._limits)

    @property
    def deceleration_mps2(self) -> float:
        """Along the way, in an ordinary stop [m/s²]."""
        return self._limits.deceleration_mps2

    @property
    def remaining_m(self) -> float:
        """Still to go, negative once beyond the goal [m]."""
        return self._sign * (self._way_m - self.traveled_m)

    def observe(self, odometry: Odometry) -> bool:
        """Take in the newest odometry. False: the pose jumped, this is not the motion of the base."""
        possible_m = 2.0 * self._limits.speed_mps * (odometry.received - self._last.received) + JUMP_M
        if self._step_m(odometry) > possible_m:
            return False
        self._take_in(odometry)
        self._last = odometry
        self.overshoot_m = max(self.overshoot_m, -self.remaining_m)
        return True

    def order(self, now_s: float) -> BaseTwist | None:
        """The velocity to order now. None: order to stand, the way is gone."""
        speed_mps = self._profile.order(self.remaining_m, self._last.received, now_s)
        return None if speed_mps is None else self._twist(speed_mps)

    def stop(self, now_s: float) -> BaseTwist:
        """The order to stand, remembered by the profile."""
        self._profile.stop(now_s)
        return STOP

    @property
    @abstractmethod
    def traveled_m(self) -> float:
        """Since the start, signed [m]."""

    @abstractmethod
    def speed_mps(self, odometry: Odometry) -> float:
        """How fast the base goes along such a way, a magnitude [m/s]."""

    @abstractmethod
    def report(self) -> str:
        """What was done, in words and in the goal's own unit."""

    @abstractmethod
    def strayed(self, lateral_m: float, heading_rad: float) -> str:
        """How far the base is off its course, if that is more than these tolerances; empty: it is not."""

    @abstractmethod
    def _step_m(self, odometry: Odometry) -> float:
        """How far the pose is from the last one."""

    @abstractmethod
    def _take_in(self, odometry: Odometry) -> None:
        """The newest pose; `_last` is still the one before."""

    @abstractmethod
    def _twist(self, speed_mps: float) -> BaseTwist:
        """The order for this speed along the way, >= 0."""
