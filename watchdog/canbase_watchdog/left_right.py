"""Whether the setpoints of the left and the right side go together: what each wheel may do alone, both may not.

Looked at per SYNC, for only the SYNC makes setpoints effective: between the two frames of one cycle new and old mix.
It takes two SYNCs that show it, as one lost frame leaves an old setpoint beside a new one. A SYNC for which a setpoint
is missing shows nothing, neither that they fit nor that they do not: the count stays.
"""

from __future__ import annotations

from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog.envelope import Bounds
from canbase_watchdog.view import NEVER, Axis, BusView

SYNCS = 2


class LeftRightWatch:
    """Remembers whether the setpoints of the last SYNCs went together."""

    def __init__(self, config: WatchdogConfig) -> None:
        """Tolerances are those of a single target."""
        self._config = config
        self._coarsest_mps = max(abs(drive.mps_per_bit) for drive in config.drives)
        self._sync_at = NEVER
        self._bad = 0

    def check_setpoints(self, bus: BusView, bounds: Bounds) -> str:
        """Why they did not go together in the last SYNCS that showed it, empty when they did."""
        if bus.sync_at == self._sync_at:
            return ""
        self._sync_at = bus.sync_at
        for axis in bus.axes:
            if not axis.enabled:
                self._bad = 0
                return ""
        for axis in bus.axes:
            if axis.setpoint_at != bus.sync_at:
                return ""
        misfit = self._misfit(bus, bounds)
        self._bad = self._bad + 1 if misfit else 0
        return misfit if self._bad >= SYNCS else ""

    def _misfit(self, bus: BusView, bounds: Bounds) -> str:
        """Each wheel of the left side with each one of the right."""
        lefts, rights = _speeds(bus.axes, "left"), _speeds(bus.axes, "right")
        config = self._config
        low_mps, high_mps = bounds.wheel(config.track_m / 2.0)
        share = config.target_tolerance_share * max(abs(low_mps), abs(high_mps))
        tolerance_mps = config.target_tolerance_mps + self._coarsest_mps + share
        return bounds.all_left_right(lefts, rights, config.track_m, tolerance_mps)


def _speeds(axes: tuple[Axis, ...], side: str) -> list[float]:
    return [axis.setpoint_mps for axis in axes if axis.drive.side == side]
