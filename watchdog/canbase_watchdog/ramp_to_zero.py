"""Whether the driver's setpoints fall when nothing but zero is leased: a living driver is on its ramp then.

The envelope (envelope.py) has to allow every order of the recent past, each for as long as the jerk limit may draw out
its change: 5 s and more with a low jerk_mps3. Once zero alone was leased for `order_wait_s` there is one order left,
and the setpoints of that moment are known. From there all wheels go to zero together: along the S-curve that a driver
makes which has only begun to brake, RECEIVED_S later at most. One that had begun before is below it.
With "brakes hard" it is the straight line of the emergency deceleration, from `emergency_wait_s` after it on.

Pure; written apart from the driver's motion/limiter.py on purpose.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog.lease import Lease
from canbase_watchdog.view import NEVER, Axis, BusView

LONGEST_STEP_S = 0.1
"""A driver that was late by more goes on with its ramp as if that time had passed: the ramp starts again here."""
RECEIVED_S = 0.1
"""A SYNC waits for this process for at most this long [s]: its own loop_late_s is another cause."""
SYNCS = 2


@dataclass(frozen=True, slots=True)
class _Ramp:
    """To zero from these setpoints [m/s]. `linear_mps` of the base; without a jerk limit it takes `straight_s`."""

    setpoints_mps: tuple[float, ...]
    linear_mps: float
    straight_s: float
    jerk_mps3: float

    def share(self, after_s: float) -> float:
        """What is left of the setpoints at most."""
        if self.straight_s <= 0.0:
            return 0.0
        if self.linear_mps <= 0.0:
            return max(0.0, 1.0 - after_s / self.straight_s)
        gained_mps = _gained(self.linear_mps, self.linear_mps / self.straight_s, self.jerk_mps3, after_s)
        return 1.0 - gained_mps / self.linear_mps


class RampToZeroWatch:
    """Remembers since when zero is leased, and what was ordered when nothing else could be under way any more."""

    def __init__(self, config: WatchdogConfig) -> None:
        """`order_wait_s` from `config`: the longest way of an order to the driver."""
        self._config = config
        self._gap_s = max(LONGEST_STEP_S, SYNCS / config.control_hz)
        self._since = self._hard_since = math.inf
        self._sync_at = NEVER
        self._ramp: _Ramp | None = None
        self._after_s = 0.0
        self._bad = 0

    def check_setpoints(self, bus: BusView, lease: Lease | None, now_s: float, hard_since: float = math.inf) -> str:
        """Which wheel's setpoint does not fall, for two SYNCs in a row, in words; empty: they do.

        `hard_since`: when "brakes hard" was received [s], infinity while it does not hold.
        """
        elapsed_s, is_new = bus.sync_at - self._sync_at, bus.sync_at != self._sync_at
        self._sync_at = bus.sync_at
        hard = hard_since < math.inf
        ordered = lease is None or lease.orders_motion
        if hard_since != self._hard_since or (ordered and not hard):
            self._since, self._ramp, self._bad, self._hard_since = hard_since, None, 0, hard_since
        if ordered and not hard:
            return ""
        self._since = min(self._since, now_s)
        wait_s = self._config.emergency_wait_s if hard else self._config.order_wait_s
        if not is_new or now_s < self._since + wait_s or not all(axis.enabled for axis in bus.axes):
            return ""
        if self._ramp is None or self._left(self._ramp) > 0.0:  # at its end time is of no matter any more
            self._after_s += min(elapsed_s, LONGEST_STEP_S)
        if elapsed_s > self._gap_s:
            self._ramp = None
        if not all(axis.setpoint_at == bus.sync_at for axis in bus.axes):
            return ""
        if self._ramp is None:
            self._ramp, self._after_s = self._begin(bus.axes, hard), 0.0
        why = self._why(bus.axes, self._ramp)
        self._bad = self._bad + 1 if why else 0
        return why if self._bad >= SYNCS else ""

    def _begin(self, axes: tuple[Axis, ...], hard: bool) -> _Ramp:
        config, left, right = self._config, _mean(axes, "left"), _mean(axes, "right")
        linear_mps, angular_radps = abs(left + right) / 2.0, abs(right - left) / config.track_m
        straight_s = max(linear_mps / config.deceleration_mps2, angular_radps / config.angular_deceleration_radps2)
        setpoints_mps = tuple(axis.setpoint_mps for axis in axes)
        if hard:
            return _Ramp(setpoints_mps, linear_mps, straight_s * config.emergency_share, math.inf)
        return _Ramp(setpoints_mps, linear_mps, straight_s, config.jerk_mps3)

    def _left(self, ramp: _Ramp) -> float:
        return ramp.share(max(0.0, self._after_s - RECEIVED_S))

    def _why(self, axes: tuple[Axis, ...], ramp: _Ramp) -> str:
        share = self._left(ramp)
        for axis, begin_mps in zip(axes, ramp.setpoints_mps, strict=True):
            allowed_mps = abs(begin_mps) * share + self._config.target_tolerance_mps + abs(axis.drive.mps_per_bit)
            if abs(axis.setpoint_mps) > allowed_mps:
                return (
                    f"{axis.drive.joint} is ordered {axis.setpoint_mps:.3f} m/s with zero leased, "
                    f"{self._after_s:.3f} s after {begin_mps:.3f} m/s: the driver's ramp has {allowed_mps:.3f} m/s then"
                )
        return ""


def _mean(axes: tuple[Axis, ...], side: str) -> float:
    speeds = [axis.setpoint_mps for axis in axes if axis.drive.side == side]
    return sum(speeds) / max(len(speeds), 1)


def _gained(distance: float, rate: float, jerk: float, after_s: float) -> float:
    """What an S-curve of this distance has done: its slope rises with `jerk` up to `rate`, stays, and falls again."""
    peak = min(rate, math.sqrt(jerk * distance))
    rise_s = peak / jerk
    whole_s = distance / peak + rise_s
    if after_s >= whole_s:
        return distance
    if after_s < rise_s:
        return jerk * after_s * after_s / 2.0
    left_s = whole_s - after_s
    return distance - jerk * left_s * left_s / 2.0 if left_s < rise_s else peak * (after_s - rise_s / 2.0)
