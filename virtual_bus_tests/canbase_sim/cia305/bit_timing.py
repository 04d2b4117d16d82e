"""The bit rates of CANopen and their numbers in LSS (CiA 301, table of bit timings; CiA 305, 13h).

The simulated drive has a table of its own: that of the tools is `canbase_config.bit_rate`, and a test on the bus
compares both.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

BIT_RATES: Mapping[int, int] = MappingProxyType(
    {0: 1_000_000, 1: 800_000, 2: 500_000, 3: 250_000, 4: 125_000, 6: 50_000, 7: 20_000, 8: 10_000}
)
"""[bit/s] by table index; 5 is reserved, 9 (the drive finds the rate by itself) is not supported here."""
FACTORY_BITRATE = 125_000
"""Of a new drive of many makers [bit/s]."""
FACTORY_NODE_ID = 1
"""Of a new drive of many makers."""
