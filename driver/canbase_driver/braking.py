"""Whether a base that is being stopped loses speed as it must. The limits follow from robot.yaml.

A wheel may keep its speed for the lag of driver and drive, and must then be on its way to zero in twice the time of
its ramp (half is room for double payload, slopes, slow current limits). It fails in the third cycle in a row above
that; a wheel that stands is never looked at, so that the end of this way is the deadline of the stop. Pure.
"""

from __future__ import annotations

import math

from canbase_config.robot import Robot
from canbase_config.stopping import BRAKING_SHARE, lag_s, ramp

CYCLES = 3


class Braking:
    """Watches one step of a stop after the other."""

    def __init__(self, robot: Robot) -> None:
        self._limits, self._lag_s = robot.limits, lag_s(robot)
        self._fixed_mps = robot.watchdog.motion_tolerance_mps
        self._share = robot.watchdog.motion_tolerance_share
        self._since = -math.inf
        self._from_mps = self._slope_mps2 = 0.0
        self._against = 0

    def begin(self, speed_mps: float, turn_radps: float, now: float, quick: bool) -> None:
        """A ramp, or a quick stop of the drives, from this wheel speed and turn of the base, begins now."""
        speed_mps, turn_radps = abs(speed_mps), abs(turn_radps)
        self._since, self._against = now, 0
        self._from_mps = speed_mps * (1.0 + self._share) + self._fixed_mps
        ordinary = self._limits.deceleration_mps2
        if quick:
            self._slope_mps2 = BRAKING_SHARE * ordinary
        else:
            time_s = ramp(self._limits, max(speed_mps, self._fixed_mps), turn_radps).time_s
            self._slope_mps2 = BRAKING_SHARE * max(speed_mps, self._fixed_mps) / time_s

    def allowed_mps(self, now: float) -> float:
        """The speed that is left at most; below zero the wheels should stand."""
        return self._from_mps - self._slope_mps2 * max(0.0, now - self._since - self._lag_s)

    def fails(self, speed_mps: float, now: float) -> bool:
        """Once a cycle, while some wheel does not stand: its speed is too high now and was in the last cycles."""
        self._against = self._against + 1 if abs(speed_mps) > self.allowed_mps(now) else 0
        return self._against >= CYCLES
