"""Samples of one wheel against its setpoints and its encoder, every 10 ms. 1 mm/s per bit, 0.1 mm per count."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from canbase_watchdog.plausibility import Feedback, Plausibility
from support.watchdog_story import config

CONFIG = replace(config(), motion_tolerance_mps=0.05 - 0.001)
"""With one bit the tolerance is 0.05 m/s."""


class Wheel:
    """A wheel on the table. `way_m`: what its encoder shows."""

    def __init__(self, mirrored: bool = False, **changes: Any) -> None:
        self.sign = -1 if mirrored else 1
        drive = replace(CONFIG.drives[0], mps_per_bit=self.sign * 0.001, m_per_count=self.sign * 0.0001)
        self.watch = Plausibility(drive, replace(CONFIG, **changes), -10.0)
        self.n = 0
        self.way_m = 0.0
        self.sample(0.0, 0.0)

    @property
    def last(self) -> Feedback:
        return self.watch.last

    def sample(
        self, velocity: float, target: float, *, rolls: float | None = None, powered: bool = True, after_s: float = 0.01
    ) -> Feedback:
        """One cycle: setpoint, then feedback. By default the encoder rolls like the velocity."""
        self.n += round(after_s * 1000)
        now_s = self.n / 1000
        self.way_m += (velocity if rolls is None else rolls) * after_s
        self.watch.on_target(target, now_s)
        self.watch.on_position(self.sign * round(self.way_m * 10_000))
        self.watch.on_velocity(velocity, powered, powered, now_s)
        return self.watch.last

    def samples(self, count: int, velocity: float, target: float, rolls: float | None = None) -> Feedback:
        for _ in range(count):
            self.sample(velocity, target, rolls=rolls)
        return self.last
