"""Positions and states of drives from what candump (can-utils) has written: the frames of docs/bus.md, read by another
program. Pure."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

TPDO1: Final = 0x180
DRIVER_HEARTBEAT: Final = 0x77F
STATE: Final = 0x6F
"""The bits of 6041h that are the state (CiA 402)."""
OPERATION_ENABLED: Final = 0x27


@dataclass(frozen=True, slots=True)
class Sample:
    """TPDO1 of a drive: Unix time [s], 6041h, and 6064h in counts."""

    time_s: float
    status: int
    position: int


def samples(lines: Iterable[str], node_id: int) -> list[Sample]:
    """Every TPDO1 of the drive. `lines`: of `candump -L`, such as `(1795613709.836924) vcan0 181#3706E8030000`."""
    return [sample for line in lines if (sample := _sample(line, TPDO1 + node_id))]


def _sample(line: str, cob_id: int) -> Sample | None:
    words = line.split()
    if len(words) < 3:
        return None
    identifier, _, data = words[2].partition("#")
    if identifier != f"{cob_id:03X}" or len(data) != 12:
        return None
    status, position = struct.unpack("<Hi", bytes.fromhex(data))
    return Sample(_time(line), status, position)


def boot_s(lines: Sequence[str], node_ids: Iterable[int]) -> float:
    """From the first heartbeat of the driver until the last of these drives reports OPERATION ENABLED [s]; infinity:
    one of them does not, or there is no driver."""
    begun_s = next((_time(line) for line in lines if f" {DRIVER_HEARTBEAT:03X}#" in line), math.inf)
    enabled_s = max(_enabled_s(samples(lines, node_id), begun_s) for node_id in node_ids)
    return enabled_s - begun_s if enabled_s < math.inf else math.inf


def _enabled_s(found: Iterable[Sample], since_s: float) -> float:
    times = (each.time_s for each in found if each.time_s >= since_s and each.status & STATE == OPERATION_ENABLED)
    return next(times, math.inf)


def _time(line: str) -> float:
    return float(line.partition(")")[0].strip("("))


def speed(found: Sequence[Sample], window_s: float) -> float:
    """Mean of the last `window_s` before the last sample [counts/s]; 0 if there are fewer than two samples in it."""
    late = [sample for sample in found if sample.time_s >= found[-1].time_s - window_s]
    if len(late) < 2 or late[-1].time_s <= late[0].time_s:
        return 0.0
    return (late[-1].position - late[0].position) / (late[-1].time_s - late[0].time_s)
