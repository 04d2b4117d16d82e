"""How many frames have passed on the bus, and what share of its time they took. The kernel's counters are read here."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from canbase_config.bus_load import traffic_bits

INTERFACES = Path("/sys/class/net")
SHORTEST_S = 0.1
"""Between two looks: over less time the load is that of a few frames."""


@dataclass(frozen=True, slots=True)
class Traffic:
    """Frames and their data since some moment; both only grow until the interface is made anew."""

    frames: int
    data_bytes: int


def interface_traffic(arguments: Mapping[str, Any], interfaces: Path = INTERFACES) -> Traffic | None:
    """What a SocketCAN interface has sent and received, frames of all devices and programs; None: it is not known.

    A vcan interface, which has no wire, counts frames of this computer twice.
    """
    folder = interfaces / str(arguments.get("channel")) / "statistics"
    try:
        frames, data_bytes = (
            sum(int((folder / f"{way}_{what}").read_text("ascii")) for way in ("rx", "tx"))
            for what in ("packets", "bytes")
        )
    except (OSError, ValueError):
        return None
    return Traffic(frames, data_bytes)


class MeasuredLoad:
    """The share of the bus's time that frames took between two looks, at most; NaN: not known."""

    def __init__(self, bitrate: int) -> None:
        """`bitrate`: of the bus [bit/s]."""
        self._bitrate = bitrate
        self._before: Traffic | None = None
        self._at_s = -math.inf
        self.share = math.nan

    def measure(self, traffic: Traffic, now_s: float) -> float:
        """The new share, of the time since the last look [s, monotonic]. A counter that went back begins anew."""
        since_s, before = now_s - self._at_s, self._before
        if since_s < SHORTEST_S:
            return self.share
        self._before, self._at_s = traffic, now_s
        self.share = math.nan if before is None else self._share(before, traffic, since_s)
        return self.share

    def _share(self, before: Traffic, after: Traffic, since_s: float) -> float:
        frames, data_bytes = after.frames - before.frames, after.data_bytes - before.data_bytes
        if frames < 0 or data_bytes < 0:
            return math.nan
        return traffic_bits(frames, data_bytes) / self._bitrate / since_s
