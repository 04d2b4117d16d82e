"""Whether a base that is being stopped loses speed as it must. The limits follow from robot.yaml.

A wheel may keep its speed for the lag of driver and drive, and must then be on its way to zero in twice the time of
its ramp (half is room for double payload, slopes, slow current limits). It fails in the third cycle in a row above
that, in the second one where cycles are slow; a wheel that stands is never looked at, so that the end of this way is
the deadline of the stop.

In a quick stop the fastest wheel with power must also be slower than it was one window of time ago: by a quarter of the
deceleration, as soon as that exceeds the noise, at any speed (docs/decisions/0023). A wheel without power brakes
without an order, and costs the others nothing. Pure.
"""

from __future__ import annotations

from collections import deque

from canbase_config.derive import BRAKING_SAMPLES, LEAST_SAMPLES, samples, slope_window_s, speed_noise_mps
from canbase_config.robot import Robot
from canbase_config.stopping import BRAKING_SHARE, HELD_S, SLOPE_SHARE, lag_s, ramp

LASTS_S = 0.08
"""It must not be slower within this time [s]: a wheel that was held may swing beyond the ramp of its drive."""


class Slowing:
    """The fastest speed of the last moments, each as a height above the line that falls as it must at least."""

    def __init__(self, robot: Robot, now_s: float) -> None:
        """A quick stop begins now."""
        self._least_mps2 = SLOPE_SHARE * robot.limits.deceleration_mps2
        self._noise_mps, self._floor_mps = speed_noise_mps(robot), robot.watchdog.motion_tolerance_mps
        self._window_s, self._lag_s = slope_window_s(robot), lag_s(robot)
        self._past: deque[tuple[float, float]] = deque()
        self._since = self._slow_at = now_s
        self._bad = 0

    def fails(self, speed_mps: float, now_s: float) -> bool:
        """Once a cycle: for LASTS_S the wheel has been above all lines of HELD_S that are a window old."""
        height_mps = speed_mps + self._least_mps2 * (now_s - self._since)
        self._past.append((now_s, height_mps))
        while self._past[0][0] < now_s - self._window_s - HELD_S:
            self._past.popleft()
        heights = [height for at, height in self._past if at <= now_s - self._window_s]
        slows = not heights or height_mps <= max(heights) + self._noise_mps
        if slows or speed_mps <= self._floor_mps or now_s < self._since + self._lag_s + self._window_s:
            self._slow_at, self._bad = now_s, -1
        self._bad += 1
        return self._bad >= LEAST_SAMPLES and now_s - self._slow_at >= LASTS_S


class Braking:
    """Watches one step of a stop after the other. `begin` comes first."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._lag_s, self._cycles = robot, lag_s(robot), samples(robot, BRAKING_SAMPLES)
        self._fixed_mps = robot.watchdog.motion_tolerance_mps
        self._share = robot.watchdog.motion_tolerance_share

    def begin(self, speed_mps: float, turn_radps: float, now_s: float, quick: bool) -> None:
        """A ramp, or a quick stop of the drives, from this wheel speed and turn of the base, begins now."""
        speed_mps, turn_radps = abs(speed_mps), abs(turn_radps)
        self._since, self._against = now_s, 0
        self._slowing = Slowing(self._robot, now_s)
        self._from_mps = speed_mps * (1.0 + self._share) + self._fixed_mps
        limits = self._robot.limits
        if quick:
            self._slope_mps2 = BRAKING_SHARE * limits.deceleration_mps2
        else:
            time_s = ramp(limits, max(speed_mps, self._fixed_mps), turn_radps).time_s
            self._slope_mps2 = BRAKING_SHARE * max(speed_mps, self._fixed_mps) / time_s

    def allowed_mps(self, now_s: float) -> float:
        """The speed that is left at most; below zero the wheels should stand."""
        return self._from_mps - self._slope_mps2 * max(0.0, now_s - self._since - self._lag_s)

    def fails(self, speed_mps: float, now_s: float) -> bool:
        """Once a cycle, while some wheel does not stand: its speed is too high now and was in the last cycles."""
        self._against = self._against + 1 if abs(speed_mps) > self.allowed_mps(now_s) else 0
        return self._against >= self._cycles

    def keeps_speed(self, speed_mps: float, now_s: float) -> bool:
        """Once a cycle of a quick stop, with the speed of the fastest wheel with power: it has not lost any."""
        return self._slowing.fails(abs(speed_mps), now_s)
