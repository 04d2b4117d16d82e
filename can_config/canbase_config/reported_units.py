"""What a drive reports about its own units, compared with robot.yaml. CiA 402-2 (60A8h, 60A9h and their predecessors).

A unit that differs is invisible later: setpoint and measured velocity agree, and the wheel turns 10 times as fast. An
object that contradicts robot.yaml is a `Misfit`. An object that is missing, 0 or 1/1, or whose unit has no fixed ratio
to a revolution, does not show whether robot.yaml is right: `canbase setup commission` shows it, with the wheel.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Final, Literal, get_args

from canbase_config.drive import Drive
from canbase_config.profile import VelocityUnit
from canbase_config.units import motor_rev_per_s

Objects = Mapping[tuple[int, int], int]
"""What the drive answered: (index of the first axis, sub-index) → unsigned value."""
Key = Literal["velocity_unit", "counts_per_motor_rev"]

SI_POSITION, SI_VELOCITY = 0x60A8, 0x60A9
VELOCITY_NOTATION, VELOCITY_DIMENSION = 0x608B, 0x608C
RESOLUTION, GEAR, FEED = 0x608F, 0x6091, 0x6092
FACTORS: Final = (0x6093, 0x6094, 0x6095, 0x6096, 0x6097)
"""Factors between user units and internal units: what one bit means follows from them only with the manual."""
REPORTED: Final = (SI_VELOCITY, VELOCITY_DIMENSION, VELOCITY_NOTATION, SI_POSITION, RESOLUTION, GEAR, FEED)
"""What `misfits` looks at: each boot reads them."""
INCREMENT: Final = 0xB5
PER_REVOLUTION: Final = {0xB4: ("rev", 1.0), 0x41: ("degree", 360.0), 0x10: ("rad", 2.0 * math.pi)}
"""Unit codes of CiA 303-2 in bits 16 to 23 of 60A8h and 60A9h: name, how many make a revolution."""
SECONDS: Final = {0x03: ("s", 1.0), 0x47: ("min", 60.0), 0x48: ("h", 3600.0)}
"""Unit codes in bits 8 to 15 of 60A9h: name, seconds."""
DIMENSIONS: Final = {0xA3: 0x00B4_0300, 0xA4: 0x00B4_4700}
"""608Ch of CiA 402 2.0 as the 60A9h that means the same: revolutions per second, per minute."""
SAME: Final = 1e-3
"""Two units that differ by less are the same: counts are whole numbers."""


@dataclass(frozen=True, slots=True)
class Misfit:
    """An object of the drive that contradicts a key of robot.yaml."""

    index: int
    sub: int
    value: int
    meaning: str
    """The drive's unit: "1 bit of 60FFh is 0.1 rev/min"."""
    effect: str
    key: Key
    has: str
    """What robot.yaml has there."""
    fits: str
    """What has to be there; empty: no value of the key means this unit."""

    @property
    def at(self) -> str:
        """ "60A9h:0 = 00B44700h"."""
        shown = f"{self.value:08X}h" if self.index in (SI_POSITION, SI_VELOCITY) else str(self.value)
        return f"{self.index:04X}h:{self.sub} = {shown}"


def misfits(drive: Drive, objects: Objects, measured: Collection[int] = ()) -> list[Misfit]:
    """Contradictions, the velocity first. `measured`: indexes of the first axis that are compared with a measured value
    instead (`expects`)."""
    found = (_velocity_misfit(drive, objects, measured), _position_misfit(drive, objects, measured))
    return [misfit for misfit in found if misfit is not None]


def undecided(objects: Objects, measured: Collection[int] = ()) -> list[str]:
    """Objects that change a unit in a way that only the wheel can show, as "6091h = 10/1"."""
    ratios = {index: _ratio(objects, index) for index in (GEAR, *FACTORS) if index not in measured}
    return [
        f"{index:04X}h = {objects[index, 1]}/{objects[index, 2]}"
        for index, ratio in ratios.items()
        if ratio is not None and not _same(ratio, 1.0)
    ]


def reported_velocity_unit(objects: Objects, counts: int) -> VelocityUnit | None:
    """The unit of velocities that the drive reports; None: none, or none of those that robot.yaml takes."""
    decoded = _velocity(objects.get((SI_VELOCITY, 0)) or _of_dimension(objects), counts)
    return None if decoded is None else _unit_of(decoded[1], counts)


def _unit_of(rev_s: float, counts: int) -> VelocityUnit | None:
    units: tuple[VelocityUnit, ...] = get_args(VelocityUnit)
    return next((unit for unit in units if _same(motor_rev_per_s(unit, counts), rev_s)), None)


def _velocity_misfit(drive: Drive, objects: Objects, measured: Collection[int]) -> Misfit | None:
    index = SI_VELOCITY if objects.get((SI_VELOCITY, 0)) else VELOCITY_DIMENSION
    unit = objects.get((SI_VELOCITY, 0)) or _of_dimension(objects)
    decoded = _velocity(unit, drive.counts_per_motor_rev)
    if decoded is None or index in measured:
        return None
    text, rev_s = decoded
    here = motor_rev_per_s(drive.target_unit, drive.counts_per_motor_rev)
    if any(_same(rev_s * turns, here) for turns in _shafts(objects)):
        return None
    fits = _unit_of(rev_s, drive.counts_per_motor_rev) or ""
    effect = f"its wheel would turn {rev_s / here:.3g} times as fast as commanded"
    meaning = f"one bit of 60FFh and 606Ch is {text}"
    return Misfit(index, 0, objects[index, 0], meaning, effect, "velocity_unit", drive.target_unit, fits)


def _position_misfit(drive: Drive, objects: Objects, measured: Collection[int]) -> Misfit | None:
    reported = _counts(objects)
    if reported is None or reported[0] in measured:
        return None
    index, counts = reported
    here = drive.counts_per_motor_rev
    if any(_same(counts / turns, here) for turns in _shafts(objects)):
        return None
    sub = 0 if index == SI_POSITION else 1
    fits = str(round(counts)) if _same(counts, max(1, round(counts))) else ""
    effect = f"it would have gone {here / counts:.3g} times as far as the odometry says"
    meaning = f"one revolution is {counts:g} increments of 6064h"
    return Misfit(index, sub, objects[index, sub], meaning, effect, "counts_per_motor_rev", str(here), fits)


def _velocity(unit: int, counts: int) -> tuple[str, float] | None:
    """The text, and revolutions per second of one bit; None: 0, or a unit without a fixed ratio to a revolution."""
    numerator, denominator = unit >> 16 & 0xFF, unit >> 8 & 0xFF
    parts = {INCREMENT: ("increment", float(counts))} | PER_REVOLUTION
    if numerator not in parts or denominator not in SECONDS or unit & 0xFF:
        return None
    (name, per_revolution), (per, seconds) = parts[numerator], SECONDS[denominator]
    factor = _power_of_ten(unit >> 24)
    return f"{factor:g} {name}/{per}", factor / per_revolution / seconds


def _of_dimension(objects: Objects) -> int:
    unit = DIMENSIONS.get(objects.get((VELOCITY_DIMENSION, 0), 0), 0)
    return unit | (objects.get((VELOCITY_NOTATION, 0), 0) & 0xFF) << 24 if unit else 0


def _counts(objects: Objects) -> tuple[int, float] | None:
    """The object that decides, and increments of 6064h for one revolution of the shaft."""
    unit = objects.get((SI_POSITION, 0), 0)
    numerator = unit >> 16 & 0xFF
    if numerator in PER_REVOLUTION and not unit & 0xFFFF:
        return SI_POSITION, PER_REVOLUTION[numerator][1] / _power_of_ten(unit >> 24)
    if unit and (numerator != INCREMENT or unit >> 24):
        return None
    index = RESOLUTION if unit or _is_plain(objects, FEED) else FEED
    ratio = _ratio(objects, index)
    return None if ratio is None or _same(ratio, 1.0) else (index, ratio)


def _shafts(objects: Objects) -> tuple[float, ...]:
    """Motor revolutions per revolution of the shaft that the unit may be about: drives differ where 6091h is set."""
    return (1.0, _ratio(objects, GEAR) or 1.0)


def _is_plain(objects: Objects, index: int) -> bool:
    ratio = _ratio(objects, index)
    return ratio is None or _same(ratio, 1.0)


def _ratio(objects: Objects, index: int) -> float | None:
    numerator, divisor = objects.get((index, 1), 0), objects.get((index, 2), 0)
    return numerator / divisor if numerator and divisor else None


def _power_of_ten(byte: int) -> float:
    return 10.0 ** (byte - 256 if byte > 127 else byte)


def _same(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=SAME)
