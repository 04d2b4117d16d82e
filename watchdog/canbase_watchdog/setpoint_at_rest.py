"""Whether wheels are ordered to turn while no lease allows any motion: a small setpoint is forgiven for a moment only.

A setpoint may be `target_tolerance_mps` beyond what the leases allow, as driver and watchdog see an order at different
times. The driver's ramp ends at an exact zero, so what is left of a setpoint after `order_hold_s` of rest was never
ordered: a driver that repeats it would creep for ever.
"""

from __future__ import annotations

import math

from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog.envelope import Bounds
from canbase_watchdog.view import Axis, BusView

AT_REST = Bounds(0.0, 0.0, 0.0, 0.0)
"""Nothing may move."""


class SetpointAtRestWatch:
    """Remembers for how long a wheel was ordered to turn and nothing allowed it; a zero in between ends nothing."""

    def __init__(self, config: WatchdogConfig) -> None:
        """`order_hold_s` from `config`: the longest way of an order to the driver, and its ramp's rounding."""
        self._hold_s = config.order_hold_s
        self._ordered_s = 0.0
        self._ordered_at = self._checked_at = math.inf
        self._ordered = False
        """At the last look."""

    def check_setpoints(self, bus: BusView, bounds: Bounds, now_s: float) -> str:
        """What is ordered though nothing is allowed, for `order_hold_s` in all; empty: nothing is.

        It starts again when anything is allowed, and when nothing was ordered for as long.
        """
        elapsed_s, self._checked_at = now_s - self._checked_at, now_s
        if bounds != AT_REST:
            self._ordered, self._ordered_s = False, 0.0
            return ""
        wheel = _ordered(bus)
        went_on, self._ordered = self._ordered, wheel is not None
        if now_s >= self._ordered_at + self._hold_s:
            self._ordered_s = 0.0
        if wheel is None:
            return ""
        self._ordered_s = min(self._ordered_s + (elapsed_s if went_on else 0.0), self._hold_s)
        self._ordered_at = now_s
        if self._ordered_s < self._hold_s:
            return ""
        return f"{wheel.drive.joint} is ordered {wheel.target_mps:.4f} m/s for {self._ordered_s:.3f} s"


def _ordered(bus: BusView) -> Axis | None:
    for axis in bus.axes:
        if axis.target_mps != 0.0 and axis.enabled:
            return axis
    return None
