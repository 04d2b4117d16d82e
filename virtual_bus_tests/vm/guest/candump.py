"""Positions of drives from what candump (can-utils) has written: the frames of docs/bus.md, read by another program.
Pure."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

TPDO1: Final = 0x180


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
    return Sample(float(words[0].strip("()")), status, position)


def speed(found: Sequence[Sample], window_s: float) -> float:
    """Mean of the last `window_s` before the last sample [counts/s]; 0 if there are fewer than two samples in it."""
    late = [sample for sample in found if sample.time_s >= found[-1].time_s - window_s]
    if len(late) < 2 or late[-1].time_s <= late[0].time_s:
        return 0.0
    return (late[-1].position - late[0].position) / (late[-1].time_s - late[0].time_s)
