"""How far a wheel that comes free may be ahead of its setpoint: it catches up the way that it lost. Pure.

The velocity loop of a drive integrates what it lacks, and the integral comes back to where it was when the wheel has
caught up the way that it lost; that is so with any bandwidth, load and force. How fast it does so depends on them:
a critically damped loop that was held for 0.2 s reaches up to three times what it lacked above its setpoint; a faster
loop goes higher, for less than five samples (docs/decisions/0041).
"""

from __future__ import annotations

import math

AFTER_S = 0.2
"""This long after the last sample that lacked [s]."""
HELD_S = 0.3
"""The way is lost within this time at most: a wheel that is held for longer trips."""
FASTER = 3.0
"""This many times what it lacked."""


class Overshoot:
    """One wheel, one way of turning. Speeds at the rim in that way [m/s]."""

    def __init__(self) -> None:
        """It has lost nothing."""
        self._lack_mps = self._lost_m = 0.0
        self._lacked_at = -math.inf

    def on_sample(
        self, target_mps: float, velocity_mps: float, slack_mps: float, elapsed_s: float, now_s: float
    ) -> float:
        """By how much it may be faster than its setpoints now [m/s].

        `slack_mps`: so much faster it may always be; what it lacked counts where FASTER times that is more.
        """
        if now_s - self._lacked_at > AFTER_S:
            self._lack_mps = self._lost_m = 0.0
        lack_mps = min(target_mps - velocity_mps, target_mps)
        if lack_mps > min(slack_mps / FASTER, target_mps / 2.0):
            self._lacked_at = now_s
            self._lack_mps = max(self._lack_mps, lack_mps)
            self._lost_m = min(self._lost_m + lack_mps * elapsed_s, self._lack_mps * HELD_S)
        allowed_mps = FASTER * self._lack_mps if self._lost_m > 0.0 else 0.0
        self._lost_m = max(0.0, self._lost_m - max(0.0, velocity_mps - max(target_mps, 0.0)) * elapsed_s)
        return allowed_mps
