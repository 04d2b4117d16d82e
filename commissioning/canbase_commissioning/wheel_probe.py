"""What one wheel does, read by SDO: state, speed, position. Needs neither PDO nor SYNC, and commands nothing."""

from __future__ import annotations

from dataclasses import dataclass

from canbase_config.drive import Drive
from canbase_config.object_map import POSITION_ACTUAL, STATUSWORD, VELOCITY_ACTUAL, place
from canbase_config.robot import Robot
from canbase_driver.boot.steps import Steps, unsigned
from canbase_driver.cia301.sdo_client import Read
from canbase_driver.cia402 import DriveState, decode_statusword
from canbase_driver.drive_units import AxisUnits

WRAP = 1 << 32


@dataclass(frozen=True, slots=True)
class Sample:
    """One look at one wheel. Speed of the rim [m/s], forward positive; `counts` of 6064h."""

    state: DriveState | None
    velocity_mps: float
    counts: int


def look(drive: Drive, robot: Robot) -> Steps[Sample]:
    """Reads 6041h, 606Ch and 6064h of one axis."""
    units, kind = AxisUnits(drive, robot.base), drive.kind
    at = place(kind, STATUSWORD, drive.axis)
    word = unsigned((yield Read(at.index, at.sub))) >> at.shift & 0xFFFF
    at = place(kind, VELOCITY_ACTUAL, drive.axis)
    velocity = _signed((yield Read(at.index, at.sub)), at.bits)
    at = place(kind, POSITION_ACTUAL, drive.axis)
    counts = _signed((yield Read(at.index, at.sub)), at.bits)
    return Sample(decode_statusword(word), units.velocity_mps(velocity), counts)


def way_m(drive: Drive, robot: Robot, before: Sample, after: Sample) -> float:
    """Way of the rim between two looks [m], forward positive; the position may have wrapped once."""
    counts = (after.counts - before.counts + WRAP // 2) % WRAP - WRAP // 2
    return AxisUnits(drive, robot.base).position_m(counts)


def _signed(data: bytes, bits: int) -> int:
    """Some drives answer wider than the object is."""
    return int.from_bytes(data[: bits // 8], "little", signed=True)
