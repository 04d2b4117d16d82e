"""The datagram that reports the safety filter's order to the watchdog: docs/bus.md, "The lease"."""

from __future__ import annotations

import struct
import zlib

from canbase_velocity.twist import Twist

MAGIC = b"CBL1"
BRAKES_HARD = 1 << 2
"""The base has to brake with limits.emergency_deceleration_mps2, to standstill. The other bits mean nothing."""

_BODY = struct.Struct("<4sQQddI")
_CRC = struct.Struct("<I")


def lease_datagram(sequence: int, monotonic_ns: int, twist: Twist, *, brakes_hard: bool) -> bytes:
    """The 44 bytes of one lease. `sequence` from 1, +1 each; `monotonic_ns` is CLOCK_MONOTONIC.

    Raises ValueError for a sequence below 1 or a velocity that is not finite: such a lease would allow anything.
    """
    if sequence < 1:
        raise ValueError(f"the sequence of leases starts at 1, got {sequence}")
    if not twist.is_finite:
        raise ValueError(f"a lease needs finite velocities, got {twist}")
    flags = BRAKES_HARD if brakes_hard else 0
    body = _BODY.pack(MAGIC, sequence, monotonic_ns, twist.linear_mps, twist.angular_radps, flags)
    return body + _CRC.pack(zlib.crc32(body))
