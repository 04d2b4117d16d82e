"""Whether wheels are ordered to turn while no lease allows any motion: a small setpoint is forgiven for a moment only.

A setpoint may be `target_tolerance_mps` beyond what the leases allow, as driver and watchdog see an order at different
times. The driver's ramp ends at an exact zero, so what is left of a setpoint after `order_hold_s` of rest was never
ordered: a driver that repeats it would creep for ever.
"""

from __future__ import annotations

import math

from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog.envelope import Bounds
from canbase_watchdog.view import BusView

AT_REST = Bounds(0.0, 0.0, 0.0, 0.0)
"""Nothing may move."""


class CreepWatch:
    """Remembers since when a wheel is ordered to turn and nothing allows it."""

    def __init__(self, config: WatchdogConfig) -> None:
        """`order_hold_s` from `config`: the longest way of an order to the driver, and its ramp's rounding."""
        self._hold_s = config.order_hold_s
        self._since = math.inf

    def look(self, bus: BusView, bounds: Bounds, now: float) -> str:
        """What is ordered though nothing is allowed, for `order_hold_s`; empty: nothing is."""
        wheel = next((axis for axis in bus.axes if axis.enabled and axis.target_mps != 0.0), None)
        if wheel is None or bounds != AT_REST:
            self._since = math.inf
            return ""
        self._since = min(self._since, now)
        if now < self._since + self._hold_s:
            return ""
        return f"{wheel.drive.joint} is ordered {wheel.target_mps:.4f} m/s for {now - self._since:.3f} s"
