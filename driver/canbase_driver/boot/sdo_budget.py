"""How many SDO requests the boots may send in a cycle, so that what is below them on the bus gets through. Pure.

Heartbeats (700h + id) have the lowest priority of all (CiA 301, pre-defined connection set). Boots beside each other
can fill a whole bus; the heartbeats would then wait for their end, and drives that watch them would take us for dead.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from canbase_config.robot import Bus

SDO_BITS = 122
"""An SDO frame and the gap behind it: mean of the 1,752 frames of a boot of eight drives, 126 at the most."""
PDO_BITS = 135
"""A frame of 8 bytes with stuff bits, at the most, and the gap behind it (ISO 11898-1)."""
SHARE = 0.92
"""Of the bus for PDOs and SDOs together. The rest carries 67 heartbeats in 100 ms at 500 kbit/s; ten nodes send 15."""
FRAMES_PER_REQUEST = 2
"""And its answer."""
FRAMES_PER_AXIS = 3
"""In a cycle: setpoint, status, velocity. One SYNC for all comes on top."""
CATCH_UP = 0.5
"""Of the transfers that a node is behind the mean, it may make up so many in a cycle."""


class SdoBudget:
    """Filled at the beginning of each cycle, in shares for the nodes that are being configured: low node ids win every
    arbitration, and would be ready long before the others, who then have most of the bus but one SDO at a time each.

    A virtual bus has no bit rate, and no end of requests.
    """

    def __init__(self, bus: Bus, cycle_s: float, values_bits: float = 0.0) -> None:
        """`values_bits`: of named values in a cycle, in the mean [bit]."""
        self._bits = math.inf if bus.is_virtual else SHARE * bus.bitrate * cycle_s - values_bits
        self._all = self._share = 0.0
        self._left: dict[int, float] = {}

    def is_spent(self, node_id: int) -> bool:
        """No further request to this node in this cycle."""
        return self._all < 1.0 or self._left.get(node_id, self._share) < 1.0

    def refill(self, running_axes: int, transfers: Mapping[int, int]) -> None:
        """A new cycle. `running_axes` have PDOs; `transfers`: how many SDO transfers each node has begun that has more
        to make. One request may go out in any case, and a part of one is kept."""
        cyclic = 1 + FRAMES_PER_AXIS * running_axes if running_axes else 0
        requests = max(1.0, (self._bits - PDO_BITS * cyclic) / (FRAMES_PER_REQUEST * SDO_BITS))
        nodes = max(1, len(transfers))
        self._all = requests + min(max(0.0, self._all), nodes / 2)
        self._share, mean = requests / nodes, sum(transfers.values()) / nodes
        kept = {node: min(max(0.0, self._left.get(node, 0.0)), 1.0) for node in transfers}
        self._left = {n: self._share + kept[n] + CATCH_UP * (mean - begun) for n, begun in transfers.items()}

    def spend(self, node_id: int, requests: int) -> None:
        """This many were sent to this node."""
        self._all -= requests
        self._left[node_id] = self._left.get(node_id, self._share) - requests
