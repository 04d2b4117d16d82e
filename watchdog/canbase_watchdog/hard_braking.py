"""Whether the base has to brake hard, and since when. The leases begin it, and standstill alone ends it. Pure.

A lease without the flag ends nothing while a setpoint is left: a filter that was started again knows nothing of the
motion, and no sender may weaken a stop that another one has begun.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from canbase_watchdog.lease import Lease
from canbase_watchdog.view import Axis


class HardBraking:
    """Remembers the flag of the leases."""

    def __init__(self) -> None:
        """Nothing brakes."""
        self.since = math.inf
        """When the first lease with the flag was received [s, monotonic]; infinity: the base need not brake hard."""
        self._flagged = False

    @property
    def holds(self) -> bool:
        """The base has to brake hard."""
        return self.since < math.inf

    def on_lease(self, lease: Lease, now_s: float) -> None:
        """A lease that counts."""
        self._flagged = lease.brakes_hard
        if self._flagged:
            self.since = min(self.since, now_s)

    def end_at_zero_setpoints(self, axes: Sequence[Axis]) -> None:
        """It ends once the last lease is without the flag and every setpoint is zero."""
        if self.holds and not self._flagged and all(axis.target_mps == axis.setpoint_mps == 0.0 for axis in axes):
            self.since = math.inf
