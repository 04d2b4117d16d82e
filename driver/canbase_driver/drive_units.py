"""Raw values of one axis to SI and back: increments of 6064h and bits of 60FFh, 606Ch, 6083h–6085h.

What one bit is worth stands in canbase_config/units.py.

The mounting direction of the motor is taken in here: everything above is positive when the base drives forward.
"""

from __future__ import annotations

import math

from canbase_config.drive import Drive
from canbase_config.robot import Base
from canbase_config.units import m_per_motor_rev, motor_rev_per_s, ramp_raw

UINT32_MAX = 2**32 - 1


class AxisUnits:
    """Conversions of one axis. Speeds and distances are those of the rim of its wheel."""

    def __init__(self, drive: Drive, base: Base) -> None:
        self.radius_m = base.radius_m(drive.side)
        rim_m_per_motor_rev = m_per_motor_rev(drive, self.radius_m)
        counts = drive.counts_per_motor_rev
        target_rev_per_s = motor_rev_per_s(drive.target_unit, counts)
        self._drive = drive
        self._rim_m_per_motor_rev = rim_m_per_motor_rev
        self._target_limit: int = 1 << drive.kind.layout.target_bits - 1
        self._direction = drive.direction
        self._target_mps_per_bit = target_rev_per_s * rim_m_per_motor_rev
        self._actual_mps_per_bit = motor_rev_per_s(drive.actual_unit, counts) * rim_m_per_motor_rev
        self._m_per_count = rim_m_per_motor_rev / counts

    def velocity_raw(self, rim_mps: float) -> int:
        """Target for 60FFh: nearest value to `rim_mps` [m/s], saturated to its width.

        Raises ValueError when the speed is not finite.
        """
        if not math.isfinite(rim_mps):
            raise ValueError(f"a target velocity of {rim_mps} m/s cannot be sent; expected a finite number")
        raw = round(self._direction * rim_mps / self._target_mps_per_bit)
        return min(max(raw, -self._target_limit), self._target_limit - 1)

    def velocity_mps(self, raw: int) -> float:
        """Speed of the rim [m/s] for a value of 606Ch."""
        return self._direction * raw * self._actual_mps_per_bit

    def position_m(self, counts: int) -> float:
        """Distance of the rim [m] for a number of increments of 6064h, which may be wider than 32 bits."""
        return self._direction * counts * self._m_per_count

    def acceleration_raw(self, mps2: float) -> int:
        """Value for 6083h, 6084h, 6085h in the unit of the profile. A magnitude, 1…2³²-1, never 0.

        Raises ValueError unless `mps2` [m/s²] is positive and finite.
        """
        if not (math.isfinite(mps2) and mps2 > 0.0):
            raise ValueError(f"an acceleration of {mps2} m/s² cannot be set; expected a positive number")
        drive, rev_per_s2 = self._drive, mps2 / self._rim_m_per_motor_rev
        raw = ramp_raw(drive.kind.units, drive.target_unit, drive.counts_per_motor_rev, rev_per_s2)
        return min(max(round(raw), 1), UINT32_MAX)

    def acceleration_mps2(self, raw: int) -> float:
        """What a value of 6083h, 6084h, 6085h means [m/s²]; 0 is no acceleration, or a time of 0."""
        drive, one = self._drive, 1.0 / self._rim_m_per_motor_rev
        unit = ramp_raw(drive.kind.units, drive.target_unit, drive.counts_per_motor_rev, one)
        if drive.kind.units.acceleration == "ms":
            return unit / raw if raw else math.inf
        return raw / unit
