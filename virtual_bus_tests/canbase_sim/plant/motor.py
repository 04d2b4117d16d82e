"""A motor under its drive's velocity loop: ramp, PI with torque limit and anti-windup. SI, as seen at the wheel's rim.

Speeds in m/s and forces in N at the rim, positive in the motor's own positive direction. Raw units: `cia402/units.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import exp

AT_ONCE = float("inf")
"""Slope of a demand that jumps: mode 9, and stopping at the torque limit."""
STOPPED_MPS = 0.002
"""A ramp to zero has ended when the demand is zero and the rim is slower than this [m/s]."""


class Motor:
    """One axis' servo. The plant calls `step` once per inner step and applies the force that it returns.

    Gains give a double pole at half of `bandwidth_radps` for the mass that the wheel carries.
    """

    def __init__(self, mass_kg: float, bandwidth_radps: float, peak_force_n: float, dt: float) -> None:
        self.step_s = self._dt = dt
        self._kp = mass_kg * bandwidth_radps
        self._ki_dt = mass_kg * bandwidth_radps**2 / 4.0 * dt
        self.peak_force_n = peak_force_n
        self._limit = peak_force_n
        self._on_stopped: Callable[[], None] | None = None
        self.sensor: Callable[[float], float] | None = None
        """What makes the measured speed of the true one; None: the true one is measured."""
        self.speed_mps = 0.0
        self.power_off()

    def power_on(self) -> None:
        """Close the velocity loop at the speed that the wheel has now."""
        self.powered = True
        self.demand_mps = self.goal_mps = self.speed_mps
        self._integral = 0.0
        self._stopping = False

    def power_off(self) -> None:
        """No torque: the wheel coasts."""
        self.powered = self.saturated = self._stopping = False
        self.demand_mps = self.goal_mps = self.force_n = self._integral = 0.0
        self._up = self._down = AT_ONCE

    def limit_force(self, share: float) -> None:
        """Allow `share` (0..1) of the peak force."""
        self._limit = share * self.peak_force_n

    def run(self, goal_mps: float, up_mps2: float, down_mps2: float) -> None:
        """Move the demand to `goal_mps` with these slopes, away from zero and towards it."""
        self.goal_mps = goal_mps
        self._up, self._down = up_mps2 * self._dt, down_mps2 * self._dt
        self._stopping = False

    def stop(self, down_mps2: float, then: Callable[[], None]) -> None:
        """Ramp to zero and call `then` once when the wheel stands."""
        self.run(0.0, down_mps2, down_mps2)
        self._stopping, self._on_stopped = True, then

    @property
    def stop_mps2(self) -> float:
        """Slope of the stop that is under way; infinity: there is none."""
        return self._down / self._dt if self._stopping else AT_ONCE

    @property
    def at_rest(self) -> bool:
        """True when the next step would do what the last one did, as long as the wheel stands."""
        if self.sensor is not None:
            return False
        return not self.powered or (self.demand_mps == 0.0 == self.goal_mps and not self._stopping)

    def settle_mps(self, speed_mps: float, mass_kg: float) -> float:
        """By how much the velocity loop changes the speed of a mass in one inner step, after `step` [m/s].

        Of a mass that is much lighter than the loop was tuned for it is exact, where force × time would overshoot.
        """
        change_mps = self.force_n / mass_kg * self._dt
        if not self.powered:
            return 0.0
        wanted_mps = self.demand_mps + self._integral / self._kp - speed_mps
        most_mps = wanted_mps * (1.0 - exp(-self._kp * self._dt / mass_kg))
        return most_mps if abs(change_mps) > abs(most_mps) else change_mps

    def step(self, speed_mps: float) -> float:
        """One inner step at this true speed, of which the loop knows what is measured; returns the force at the rim."""
        if self.sensor is not None:
            speed_mps = self.sensor(speed_mps)
        self.speed_mps = speed_mps
        if not self.powered:
            return 0.0
        demand = self.demand_mps
        if demand != self.goal_mps:
            demand = self._ramp(demand)
        if self._stopping and demand == 0.0 and -STOPPED_MPS < speed_mps < STOPPED_MPS:
            self._finish()
            return self.force_n
        error = demand - speed_mps
        force = self._kp * error + self._integral
        limit = self._limit
        if -limit <= force <= limit:
            self._integral += self._ki_dt * error
            self.saturated = False
        else:
            force = limit if force > 0.0 else -limit
            if force * error < 0.0:
                self._integral += self._ki_dt * error
            self.saturated = True
        self.force_n = force
        return force

    def _ramp(self, demand: float) -> float:
        delta = self.goal_mps - demand
        slope = self._down if delta * demand < 0.0 else self._up
        if delta > slope:
            demand += slope
        elif delta < -slope:
            demand -= slope
        else:
            demand = self.goal_mps
        self.demand_mps = demand
        return demand

    def _finish(self) -> None:
        self._stopping = False
        if self._on_stopped is not None:
            self._on_stopped()
