"""The least speed that a wheel still has: from a speed v it cannot stop within less than v² / 2a, braked by a.

The distance is that of the encoder, net from where the speed was shown: an encoder counts over gaps and lost frames,
and no time is in it, so frames that come late or a velocity that is filtered change nothing. An encoder that dies shows
no distance: what it showed last is not braked away, and its standstill proves nothing (docs/decisions/0041). Pure.
"""

from __future__ import annotations

import math


class StoppingDistance:
    """Follows one wheel. Speeds, travel and braking at the rim [m/s, m, m/s²]."""

    def __init__(self, noise_mps: float, grain_m: float) -> None:
        """`noise_mps`: a speed that may be noise; `grain_m`: the encoder may count so much too little."""
        self._noise_mps, self._grain_m = noise_mps, grain_m
        self._shown_mps = self._from_m = self._distance_m = self._hardest_mps2 = 0.0
        self.least_mps = 0.0
        """It still turns as fast as this, or its encoder does not show how it stopped."""

    @property
    def needed_m(self) -> float:
        """From where `_shown_mps` was shown until standstill."""
        noise = self._noise_mps**2
        return max(0.0, self._shown_mps**2 - noise) / (2.0 * self._hardest_mps2) - self._grain_m

    @property
    def missing_m(self) -> float:
        """Distance that it has to show until its standstill is possible; 0: it is possible."""
        if self.least_mps <= self._noise_mps:
            return 0.0
        return max(0.0, self.needed_m - self._distance_m)

    def on_sample(self, shown_mps: float, travel_m: float, braking_mps2: float) -> None:
        """The speed that encoder and velocity both show, the travel of the encoder since the start, and the hardest
        braking since the last sample."""
        self._hardest_mps2 = max(self._hardest_mps2, braking_mps2)
        self._distance_m = max(self._distance_m, abs(travel_m - self._from_m))
        self.least_mps = math.sqrt(max(0.0, self._shown_mps**2 - 2.0 * self._hardest_mps2 * self._distance_m))
        if abs(shown_mps) >= self.least_mps:
            self._begin(abs(shown_mps), travel_m, braking_mps2)

    def forget(self) -> None:
        """A new trial: it may be at standstill."""
        self._begin(0.0, self._from_m, 0.0)

    def _begin(self, shown_mps: float, travel_m: float, braking_mps2: float) -> None:
        self.least_mps = self._shown_mps = shown_mps
        self._from_m, self._distance_m, self._hardest_mps2 = travel_m, 0.0, braking_mps2
