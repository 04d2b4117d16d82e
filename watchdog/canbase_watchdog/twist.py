"""Whether the base as a whole moves as its setpoints order: what each wheel may do alone, both may not.

A base that is ordered straight on, with one slow wheel, turns. So the measured twist must be between standstill and
what the setpoints of the last `drive_lag_s` ordered. After that the range falls to a new order as slowly as wheels on
the slowest ramp get there, one of them after the other. Drives with slow ramps have more than that: ordered from a turn
to fast straight on, both wheels are on their ramps, and the base turns until the first one is there. So what wheels on
the slowest ramp do with these setpoints is allowed as if it were ordered. Speeds are smoothed, as the noise of two
wheels adds up. The time outside adds up to `twist_s`, and goes down as fast while the base is inside
(docs/decisions/0041).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog.envelope import Bounds, Peak
from canbase_watchdog.view import NEVER, Axis, BusView

SMOOTHED_S = 0.05
"""Time constant of the measured speeds."""


class Reach:
    """How far a velocity may be from zero, both ways: as ordered within the lag, then falling."""

    def __init__(self, lag_s: float, slope: float, most: float) -> None:
        """`slope`: how fast it falls, per second. Up to `most` may have been ordered before."""
        self._up, self._down, self._slope = Peak(lag_s), Peak(lag_s), slope
        self.high = self.low = most

    def order(self, values: Sequence[float], now_s: float) -> None:
        """All that may be ordered from now on."""
        self._up.set(max(values), now_s, math.inf)
        self._down.set(-min(values), now_s, math.inf)

    def advance(self, elapsed_s: float, now_s: float) -> None:
        """Bring `high` and `low`, which counts the other way, up to the time `now_s`."""
        fallen = elapsed_s * self._slope
        self.high = max(self.high - fallen, self._up.greatest(now_s), 0.0)
        self.low = max(self.low - fallen, self._down.greatest(now_s), 0.0)


class SlowWheels:
    """The speeds of left and right on their ramps [m/s]: those of the drives, upward and downward."""

    def __init__(self, up_mps2: float, down_mps2: float) -> None:
        """They stand."""
        self._up_mps2, self._down_mps2 = up_mps2, down_mps2
        self.speeds = (0.0, 0.0)

    def follow(self, setpoints: tuple[float, float], elapsed_s: float) -> tuple[float, float]:
        """Where they are after so much time."""
        if setpoints != self.speeds:
            left, right = self.speeds
            self.speeds = self._ramp(left, setpoints[0], elapsed_s), self._ramp(right, setpoints[1], elapsed_s)
        return self.speeds

    def _ramp(self, speed_mps: float, setpoint_mps: float, elapsed_s: float) -> float:
        slows = speed_mps * setpoint_mps < 0.0 or abs(setpoint_mps) < abs(speed_mps)
        most_mps = (self._down_mps2 if slows else self._up_mps2) * elapsed_s
        return speed_mps + min(max(setpoint_mps - speed_mps, -most_mps), most_mps)


class TwistWatch:
    """Follows the setpoints and speeds of all wheels, from SYNC to SYNC."""

    def __init__(self, config: WatchdogConfig, now_s: float) -> None:
        """Before the monotonic time `now_s` [s] anything within the limits may have been ordered."""
        self._config = config
        self._coarsest_mps = max(abs(drive.velocity_mps_per_bit) for drive in config.drives)
        self._sync_at = NEVER
        self._at = now_s
        self._begin(config.linear_mps, config.angular_radps)

    def _begin(self, linear_mps: float, angular_radps: float) -> None:
        config = self._config
        self._linear = Reach(config.drive_lag_s, config.slowest_ramp_mps2 / 2.0, linear_mps)
        self._angular = Reach(config.drive_lag_s, config.slowest_ramp_mps2 / config.track_m, angular_radps)
        slowest = config.slowest_ramp_mps2
        self._slow = SlowWheels(slowest, slowest), SlowWheels(slowest, max(slowest, config.deceleration_mps2))
        self._speeds: list[float] = []
        self._outside_s = 0.0

    def check_motion(self, bus: BusView, now_s: float) -> str:
        """Why the base has not moved as ordered for `twist_s`, empty when it has."""
        if bus.sync_at == self._sync_at:
            return ""
        self._sync_at = bus.sync_at
        elapsed_s, self._at = now_s - self._at, now_s
        if not all(axis.enabled for axis in bus.axes):
            self._begin(0.0, 0.0)
            return ""
        bounds = self._bounds(bus, elapsed_s, now_s)
        self._smooth([axis.velocity_mps for axis in bus.axes], elapsed_s)
        why = self._why(bus, bounds)
        outside_s = self._outside_s + (elapsed_s if why else -elapsed_s)
        self._outside_s = min(max(0.0, outside_s), self._config.twist_s)
        return why if self._outside_s >= self._config.twist_s else ""

    def _bounds(self, bus: BusView, elapsed_s: float, now_s: float) -> Bounds:
        setpoints = _mean(bus.axes, "left"), _mean(bus.axes, "right")
        one, other = self._slow
        wheels = (setpoints, one.follow(setpoints, elapsed_s), other.follow(setpoints, elapsed_s))
        linear, angular, track_m = self._linear, self._angular, self._config.track_m
        linear.order([(left + right) / 2.0 for left, right in wheels], now_s)
        angular.order([(right - left) / track_m for left, right in wheels], now_s)
        linear.advance(elapsed_s, now_s)
        angular.advance(elapsed_s, now_s)
        return Bounds(-linear.low, linear.high, -angular.low, angular.high)

    def _smooth(self, speeds: list[float], elapsed_s: float) -> None:
        share = min(elapsed_s / SMOOTHED_S, 1.0)
        before = self._speeds or speeds
        self._speeds = [before[at] + share * (new - before[at]) for at, new in enumerate(speeds)]

    def _why(self, bus: BusView, bounds: Bounds) -> str:
        config = self._config
        low_mps, high_mps = bounds.wheel(config.track_m / 2.0)
        fastest_mps = max(abs(low_mps), abs(high_mps))
        tolerance_mps = config.twist_tolerance_mps + self._coarsest_mps + config.twist_tolerance_share * fastest_mps
        lefts, rights = self._side(bus, "left"), self._side(bus, "right")
        why = bounds.all_left_right(lefts, rights, config.track_m, tolerance_mps)
        return why and f"{why}; {self._worst(bus)}"

    def _side(self, bus: BusView, side: str) -> list[float]:
        return [self._speeds[at] for at, axis in enumerate(bus.axes) if axis.drive.side == side]

    def _worst(self, bus: BusView) -> str:
        """The wheel that is farthest from its setpoint, in words."""
        axis = max(bus.axes, key=lambda each: abs(each.velocity_mps - each.setpoint_mps))
        return f"{axis.drive.joint} is ordered {axis.setpoint_mps:.3f} m/s and turns at {axis.velocity_mps:.3f} m/s"


def _mean(axes: tuple[Axis, ...], side: str) -> float:
    speeds = [axis.setpoint_mps for axis in axes if axis.drive.side == side]
    return sum(speeds) / max(len(speeds), 1)
