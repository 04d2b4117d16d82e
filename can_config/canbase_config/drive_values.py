"""Values of a drive that a robot wants published: `values` below each drive, and the spare TPDOs that carry them.

One motor uses TPDO1 and TPDO2 of its node; TPDO3 and TPDO4 are spare. The feedback of two motors has the identifiers of
all four, however many TPDOs the drive has. Bytes that a feedback TPDO does not use must stay unused: driver and
watchdog recognize by its length what it carries, and two bytes more behind 606Ch would be read as a torque, behind
6064h as a velocity. CiA 301: eight bytes a PDO. Nothing that stops the robot depends on values: one that a drive does
not map is reported, and not published.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final

from pydantic import Field

from canbase_config.profile import Bits, Index, Sub
from canbase_config.section import Name, Section

FIRST_SPARE_TPDO: Final = 3
SPARE_TPDOS: Final = 2
"""Of a node with one motor: 380h and 480h + id are free."""
PDO_BYTES: Final = 8
MOST_SYNCS: Final = 240
"""Transmission types 1 to 240: the TPDO is sent at each n-th SYNC (CiA 301)."""


class DriveValue(Section):
    """An object of the drive that is published as a named value: raw × scale, in `unit`."""

    name: Annotated[Name, Field(description="its name in motor_driver/values and /diagnostics")]
    index: Index
    sub: Sub = 0
    bits: Bits
    signed: Annotated[bool, Field(description="true: two's complement")] = False
    scale: Annotated[float, Field(gt=0.0, le=1e9, description="`unit` for one bit")] = 1.0
    unit: Annotated[str, Field(min_length=1, max_length=16, description="for people")] | None = None
    period_s: Annotated[
        float, Field(ge=0.005, le=10.0, description="from one value to the next; 240 control cycles at most [s]")
    ] = 0.1


@dataclass(frozen=True, slots=True)
class ValuePdo:
    """One TPDO: `values` in its order, sent once in `every` control cycles (1 to 240)."""

    every: int
    values: tuple[DriveValue, ...]

    @property
    def data_bytes(self) -> int:
        """Length of its data, 1 to 8 [bytes]."""
        return sum(value.bits for value in self.values) // 8


def value_pdos(values: Sequence[DriveValue], control_hz: float) -> tuple[ValuePdo, ...]:
    """The TPDOs that carry these values, each period in its own; as many as it takes."""
    pdos: list[ValuePdo] = []
    for value in values:
        every = min(max(round(value.period_s * control_hz), 1), MOST_SYNCS)
        for at, pdo in enumerate(pdos):
            if pdo.every == every and pdo.data_bytes + value.bits // 8 <= PDO_BYTES:
                pdos[at] = ValuePdo(every, (*pdo.values, value))
                break
        else:
            pdos.append(ValuePdo(every, (value,)))
    return tuple(pdos)


def misfit(values: Sequence[DriveValue], control_hz: float, motors: int, tpdos: int) -> str:
    """Why a node with so many motors and TPDOs cannot send them, with the way out; empty: it can."""
    if not values:
        return ""
    names = [value.name for value in values]
    if twice := next((name for name in names if names.count(name) > 1), ""):
        return f"two values are named {twice}: give each its own name"
    if motors > 1:
        return (
            "its node turns two motors, whose feedback has all four TPDO identifiers of a node (180h, 280h, 380h and "
            "480h + id). Spare bytes behind feedback carry no values: the watchdog would read them as torque or "
            "velocity. Take the values out, and read one by hand with `canbase bus sdo read "
            f"NODE {values[0].index:04X}:{values[0].sub}`"
        )
    spare = min(SPARE_TPDOS, tpdos - FIRST_SPARE_TPDO + 1)
    if spare < 1:
        return f"its drive has {tpdos} TPDOs (pdo.tpdos of its profile), and none of them is spare: take the values out"
    pdos = value_pdos(values, control_hz)
    if len(pdos) <= spare:
        return ""
    periods = len({pdo.every for pdo in pdos})
    total = sum(pdo.data_bytes for pdo in pdos)
    return (
        f"{len(values)} values with {periods} different period_s and {total} bytes need {len(pdos)} TPDOs of "
        f"{PDO_BYTES} bytes, one period each; {spare} of the {tpdos} TPDOs (pdo.tpdos of its profile) "
        "are spare: give them the same period_s, or take values out"
    )
