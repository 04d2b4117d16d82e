"""What one bit of a drive's velocity objects (60FFh, 606Ch) means. The only place that gives VelocityUnit its value."""

from __future__ import annotations

from typing import Final

from canbase_config.drive import VelocityUnit

_MOTOR_REV_PER_S: Final[dict[VelocityUnit, float]] = {
    "rpm": 1.0 / 60.0,
    "0.1rpm": 0.1 / 60.0,
    "0.001rpm": 0.001 / 60.0,
    "rev/s": 1.0,
    "0.001rev/s": 0.001,
}
_COUNTS_PER_S: Final[dict[VelocityUnit, float]] = {"counts/s": 1.0, "0.1counts/s": 0.1}


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
