"""The distance that a wheel needs to stop: from a speed v at least v² / 2a, braked by a (docs/decisions/0041).

A sensor that shows a speed, and then a standstill within less, did not show how the wheel stopped: it met something
hard, or the sensor is dead. Only distance counts and no time, as frames may be lost and 606Ch may be filtered. The
driver has the same rule in code of its own.
"""

from __future__ import annotations


class StoppingDistance:
    """Follows one wheel. Speeds, travel and braking at the rim [m/s, m, m/s²]."""

    def __init__(self, noise_mps: float, grain_m: float) -> None:
        """`noise_mps`: a speed that may be noise; `grain_m`: the encoder may count so much too little."""
        self._noise, self._grain_m = noise_mps**2, grain_m
        self._square = self._braking_mps2 = self._travel_m = self._way_m = self._way_before_m = 0.0
        """Of the last speed that is not braked away, with the hardest braking and the net travel since then; the last
        one until the speed before."""

    @property
    def lacks(self) -> bool:
        """It has not shown the distance to a standstill yet."""
        return self._square - 2.0 * self._braking_mps2 * (self._way_m + self._grain_m) > self._noise

    def on_travel(self, step_m: float) -> None:
        """The encoder went on by so much. To and fro is no distance."""
        self._travel_m += step_m
        self._way_m = max(self._way_m, abs(self._travel_m))

    def on_speed(self, shown_mps: float, braking_mps2: float) -> None:
        """What encoder and velocity both show now, and the hardest braking since the last time."""
        if braking_mps2 != self._braking_mps2:
            self._square -= 2.0 * self._braking_mps2 * self._way_before_m
            self._travel_m = self._way_m = self._way_m - self._way_before_m
            self._braking_mps2 = braking_mps2
        if shown_mps**2 >= self._square - 2.0 * braking_mps2 * self._way_m:
            self._square = shown_mps**2
            self._travel_m = self._way_m = 0.0
        self._way_before_m = self._way_m

    def forget(self) -> None:
        """A new trial: it may be at standstill."""
        self._square = 0.0
