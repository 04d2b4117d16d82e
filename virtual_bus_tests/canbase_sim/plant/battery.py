"""The battery that all drives share: its voltage sags with the power that the motors take, and rises when they brake.

A source of constant voltage with one resistance, that of cells and cable together. Pure, in SI units.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

from canbase_sim.plant.motor import Motor

REST_V = 24.0
"""Without load, as 6079h of our EDS [V]."""
RESISTANCE_OHM = 0.05
"""Of eight cells in series and their cable: assumed [Ω]."""
COPPER_W = 100.0
"""Heat in one motor at its torque limit, which grows with the square of the torque: assumed [W]."""


class Battery:
    """Of one robot."""

    def __init__(self, motors: Sequence[Motor]) -> None:
        self._motors = motors

    @property
    def power_w(self) -> float:
        """What the drives take, mechanical and heat; negative: they brake and give power back [W]."""
        return sum(
            motor.force_n * motor.speed_mps + COPPER_W * (motor.force_n / motor.peak_force_n) ** 2
            for motor in self._motors
        )

    @property
    def voltage_v(self) -> float:
        """At its terminals: u = rest - r × p / u; no more power than the resistance allows [V]."""
        return (REST_V + sqrt(max(REST_V**2 - 4.0 * RESISTANCE_OHM * self.power_w, 0.0))) / 2.0
