"""How many SDO requests the boots may send in a cycle, so that what is below them on the bus gets through. Pure.

Heartbeats (700h + id) have the lowest priority of all (CiA 301, pre-defined connection set). Boots beside each other
can fill a whole bus; the heartbeats would then wait for their end, and drives that watch them would take us for dead.
"""

from __future__ import annotations

import math

from canbase_config.robot import Bus

FRAME_BITS = 135
"""A data frame of 8 bytes with stuff bits, at the most, and the gap behind it (ISO 11898-1)."""
SHARE = 0.9
"""Of the bus for PDOs and SDOs together."""
FRAMES_PER_REQUEST = 2
"""And its answer."""
FRAMES_PER_AXIS = 3
"""In a cycle: setpoint, status, velocity. One SYNC for all comes on top."""


class SdoBudget:
    """Filled at the beginning of each cycle. A virtual bus has no bit rate, and no end of requests."""

    def __init__(self, bus: Bus, cycle_s: float) -> None:
        self._frames = math.inf if bus.is_virtual else SHARE * bus.bitrate * cycle_s / FRAME_BITS
        self._left = 0.0

    @property
    def is_spent(self) -> bool:
        """No further request in this cycle."""
        return self._left < 1.0

    def refill(self, running_axes: int) -> None:
        """A new cycle; `running_axes` have PDOs. One request may go out in any case."""
        cyclic = 1 + FRAMES_PER_AXIS * running_axes if running_axes else 0
        self._left = max(1.0, (self._frames - cyclic) / FRAMES_PER_REQUEST)

    def spend(self, requests: int) -> None:
        """This many were sent."""
        self._left -= requests
