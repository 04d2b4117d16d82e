"""What one bit of a drive's velocities (60FFh, 606Ch) and ramps (6083h–6085h) means at the motor and at the rim.

The driver (`drive_units.py`) and the watchdog's configuration (`derive.py`) take them from here. The simulated drive
has a table of its own on purpose (`raw_units.py`): a wrong value here shows as a wrong motion there.
"""

from __future__ import annotations

import math
from typing import Final

from canbase_config.drive import Drive
from canbase_config.profile import AccelerationUnit, Units, VelocityUnit

_MOTOR_REV_PER_S: Final[dict[VelocityUnit, float]] = {
    "rpm": 1.0 / 60.0,
    "0.1rpm": 0.1 / 60.0,
    "0.001rpm": 0.001 / 60.0,
    "rev/s": 1.0,
    "0.001rev/s": 0.001,
}
_COUNTS_PER_S: Final[dict[VelocityUnit, float]] = {
    "counts/s": 1.0,
    "0.1counts/s": 0.1,
    "counts/ms/16384": 1000.0 / 16384.0,
    "counts/ms/65536": 1000.0 / 65536.0,
}
_MOTOR_REV_PER_S2: Final[dict[AccelerationUnit, float]] = {"rpm/s": 1.0 / 60.0, "0.1rpm/s": 0.1 / 60.0}
_COUNTS_PER_S2: Final[dict[AccelerationUnit, float]] = {
    "10counts/s2": 10.0,
    "counts/ms2/16384": 1e6 / 16384.0,
    "counts/ms2/65536": 1e6 / 65536.0,
}


def motor_rev_per_s(unit: VelocityUnit, counts_per_motor_rev: int) -> float:
    """Revolutions of the motor shaft per second for one bit of 60FFh or 606Ch; always positive.

    `counts_per_motor_rev` (increments of 6064h) matters for the units in counts alone.
    Raises ValueError for an unknown unit and for less than one count per revolution.
    """
    if counts_per_motor_rev < 1:
        raise ValueError(f"counts_per_motor_rev is {counts_per_motor_rev}, expected at least 1")
    if unit in _MOTOR_REV_PER_S:
        return _MOTOR_REV_PER_S[unit]
    if unit in _COUNTS_PER_S:
        return _COUNTS_PER_S[unit] / counts_per_motor_rev
    known = ", ".join([*_MOTOR_REV_PER_S, *_COUNTS_PER_S])
    raise ValueError(f"velocity unit {unit!r} is unknown, expected one of {known}")


def ramp_raw(units: Units, velocity_unit: VelocityUnit, counts_per_motor_rev: int, motor_rev_per_s2: float) -> float:
    """Value for 6083h–6085h that gives an acceleration of the motor shaft; positive, not rounded.

    `velocity_unit` is that of 60FFh. Raises ValueError unless the acceleration is positive.
    """
    if not motor_rev_per_s2 > 0.0:
        raise ValueError(f"an acceleration of {motor_rev_per_s2} rev/s² cannot be set; expected a positive number")
    unit = units.acceleration
    if unit == "ms":
        return 1000.0 * (units.full_speed_rpm or 0.0) / 60.0 / motor_rev_per_s2
    if unit == "velocity/s":
        return motor_rev_per_s2 / motor_rev_per_s(velocity_unit, counts_per_motor_rev)
    if unit in _MOTOR_REV_PER_S2:
        return motor_rev_per_s2 / _MOTOR_REV_PER_S2[unit]
    return motor_rev_per_s2 * counts_per_motor_rev / _COUNTS_PER_S2[unit]


def m_per_motor_rev(drive: Drive, wheel_radius_m: float) -> float:
    """Travel of the wheel's rim [m] for one revolution of the motor; always positive."""
    return 2.0 * math.pi * wheel_radius_m / drive.gear_ratio


def mps_per_bit(drive: Drive, wheel_radius_m: float) -> float:
    """Speed of the wheel's rim [m/s] for one bit of the drive's 60FFh; the sign makes forward positive."""
    motor_rev_s = motor_rev_per_s(drive.target_unit, drive.counts_per_motor_rev)
    return drive.direction * motor_rev_s * m_per_motor_rev(drive, wheel_radius_m)


def velocity_scale(drive: Drive) -> float:
    """How many bits of 60FFh one bit of 606Ch is worth."""
    counts = drive.counts_per_motor_rev
    return motor_rev_per_s(drive.actual_unit, counts) / motor_rev_per_s(drive.target_unit, counts)


def m_per_count(drive: Drive, wheel_radius_m: float) -> float:
    """Travel of the wheel's rim [m] for one increment of the drive's 6064h; the sign makes forward positive."""
    return drive.direction * m_per_motor_rev(drive, wheel_radius_m) / drive.counts_per_motor_rev
