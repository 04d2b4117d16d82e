"""Raw drive units ↔ SI, for the simulated drive only. The driver has its own; a test on the bus compares both."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, inf, pi

from canbase_config.drive import Drive
from canbase_sim.personality import GENERIC, Personality

STEPS_PER_REVOLUTION = {
    "rpm": 60.0,
    "0.1rpm": 600.0,
    "0.001rpm": 60_000.0,
    "rev/s": 1.0,
    "0.001rev/s": 1000.0,
}
"""Raw velocity at one motor revolution per second; units of counts depend on the encoder."""
STEPS_PER_COUNT = {
    "counts/s": 1.0,
    "0.1counts/s": 10.0,
    "counts/ms/16384": 16.384,
    "counts/ms/65536": 65.536,
}
"""Raw velocity at one increment per second."""
ACCELERATION_PER_REVOLUTION = {"rpm/s": 60.0, "0.1rpm/s": 600.0}
"""Raw acceleration at one motor revolution per second in a second."""
ACCELERATION_PER_COUNT = {"counts/s2": 1.0, "counts/ms2/16384": 0.016384, "counts/ms2/65536": 0.065536}
"""Raw acceleration at one increment per second in a second."""


@dataclass(frozen=True, slots=True)
class Scale:
    """How one axis counts."""

    target_mps: float
    """Rim speed of one bit of 60FFh [m/s]."""
    actual_mps: float
    """Rim speed of one bit of 606Ch and 606Bh [m/s]."""
    slope_mps2: float
    """Rim acceleration of one bit of 6083h to 6085h [m/s²]; with `full_speed_mps` they are times in ms."""
    counts_per_m: float
    """Increments of 6064h per metre of the rim."""
    full_speed_mps: float | None = None
    """The speed that a ramp's time counts to [m/s]."""
    largest: int = 2**31 - 1
    """Of 606Ch, 606Bh and 6044h, in both directions: what is faster is shown as this."""

    @classmethod
    def of(cls, drive: Drive, wheel_radius_m: float, personality: Personality = GENERIC) -> Scale:
        """The scale of an axis: units of the personality; robot.yaml has those that it leaves open."""
        metres, counts = 2.0 * pi * wheel_radius_m / drive.gear_ratio, float(drive.counts_per_motor_rev)
        velocity = STEPS_PER_REVOLUTION | {unit: steps * counts for unit, steps in STEPS_PER_COUNT.items()}
        target = metres / velocity[personality.target_unit or drive.target_unit]
        actual = metres / velocity[personality.actual_unit or drive.actual_unit]
        slopes = ACCELERATION_PER_REVOLUTION | {u: steps * counts for u, steps in ACCELERATION_PER_COUNT.items()}
        narrow = personality.vl or personality.widths.get(0x606C) == "h"
        largest = 2**15 - 1 if narrow else 2**31 - 1
        unit = personality.acceleration_unit
        if unit == "ms":
            full_mps = metres * personality.full_speed_rpm / 60.0
            return cls(target, actual, inf, counts / metres, full_mps, largest)
        slope = target if unit is None else metres / slopes[unit]
        return cls(target, actual, slope, counts / metres, largest=largest)

    def counts(self, travel_m: float, offset: int) -> int:
        """6064h after `travel_m` in the motor's positive direction: whole increments, wrapped to 32 bits."""
        return (floor(travel_m * self.counts_per_m) + offset + 2**31) % 2**32 - 2**31

    def raw(self, speed_mps: float) -> int:
        """606Ch, 606Bh and 6044h: whole steps."""
        return self.limited(round(speed_mps / self.actual_mps))

    def limited(self, raw: int) -> int:
        """What these objects have room for."""
        return max(-self.largest, min(self.largest, raw))

    def slope(self, raw: int) -> float:
        """Rim acceleration that 6083h to 6085h mean [m/s²]."""
        if self.full_speed_mps is None:
            return raw * self.slope_mps2
        return self.full_speed_mps * 1000.0 / raw if raw else inf
