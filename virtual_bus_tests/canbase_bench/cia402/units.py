"""Raw drive units ↔ SI, for the simulated drive only. The driver has its own; a test on the bus compares both."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, pi

from canbase_config.drive import Drive

STEPS_PER_REVOLUTION = {
    "rpm": 60.0,
    "0.1rpm": 600.0,
    "0.001rpm": 60_000.0,
    "rev/s": 1.0,
    "0.001rev/s": 1000.0,
}
"""Raw velocity at one motor revolution per second; units of counts depend on the encoder."""


@dataclass(frozen=True, slots=True)
class Scale:
    """How one axis counts. Velocities raw in `velocity_unit`, accelerations raw in `velocity_unit` per second."""

    mps_per_raw: float
    """Rim speed of one raw velocity step [m/s]."""
    counts_per_m: float
    """Increments of 6064h per metre of the rim."""

    @classmethod
    def of(cls, drive: Drive, wheel_radius_m: float) -> Scale:
        """The scale of an axis as robot.yaml describes it."""
        metres_per_motor_rev = 2.0 * pi * wheel_radius_m / drive.gear_ratio
        counts = float(drive.counts_per_motor_rev)
        raw = {"counts/s": counts, "0.1counts/s": counts * 10.0} | STEPS_PER_REVOLUTION
        return cls(metres_per_motor_rev / raw[drive.target_unit], counts / metres_per_motor_rev)

    def counts(self, travel_m: float, offset: int) -> int:
        """6064h after `travel_m` in the motor's positive direction: whole increments, wrapped to 32 bits."""
        return (floor(travel_m * self.counts_per_m) + offset + 2**31) % 2**32 - 2**31

    def raw(self, speed_mps: float) -> int:
        """606Ch and 606Bh: whole steps, limited to 32 bits."""
        return max(-(2**31), min(2**31 - 1, round(speed_mps / self.mps_per_raw)))
