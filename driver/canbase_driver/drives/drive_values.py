"""The values of one drive that robot.yaml wants published, as its spare TPDOs bring them. It decides nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from canbase_config.drive_values import ValuePdo

LATE = 3.0
"""A value that did not come for so many of its periods is none ..."""
LATE_S = 0.2
"""... but not before this time [s]."""


@dataclass(frozen=True, slots=True)
class NamedValue:
    """`value` in `unit` (empty: it has none); NaN: the drive has sent none, or none of late.

    `at`: when it came, monotonic [s].
    """

    name: str
    unit: str
    value: float
    at: float


class DriveValues:
    """The last value of each."""

    def __init__(self, pdos: Sequence[ValuePdo], cycle_s: float) -> None:
        """`cycle_s`: the period of the control cycle, of which each PDO has a multiple [s]."""
        self._pdos = tuple(pdos)
        self._late_s = [max(LATE_S, LATE * pdo.every * cycle_s) for pdo in self._pdos]
        self._raw: list[tuple[int, ...]] = [() for _ in self._pdos]
        self._at = [-math.inf for _ in self._pdos]

    def on_frame(self, number: int, data: bytes, now_s: float) -> bool:
        """Take the data of a PDO, counted from 0. False: wrong length, to be dropped and counted."""
        pdo = self._pdos[number]
        if len(data) != pdo.data_bytes:
            return False
        raw, at = [], 0
        for value in pdo.values:
            size = value.bits // 8
            raw.append(int.from_bytes(data[at : at + size], "little", signed=value.signed))
            at += size
        self._raw[number], self._at[number] = tuple(raw), now_s
        return True

    def forget(self) -> None:
        """What came no longer counts: the drive restarted, or its bus did."""
        self._at = [-math.inf for _ in self._pdos]

    def values(self, now_s: float) -> tuple[NamedValue, ...]:
        """All of them, in the order of their PDOs."""
        values = []
        for pdo, raw, at, late_s in zip(self._pdos, self._raw, self._at, self._late_s, strict=True):
            known = raw if now_s - at <= late_s else (math.nan,) * len(pdo.values)
            values += [
                NamedValue(of.name, of.unit or "", bits * of.scale, at)
                for of, bits in zip(pdo.values, known, strict=True)
            ]
        return tuple(values)
