"""Who moves drives past all layers, and who cannot be heard: when it was last so. Asked every step."""

from __future__ import annotations

import math

from campaign.world import World

SENT_S = 0.1
"""Frames that were sent may be on their way for so long: the delay of the bus, and its queue."""


class Strangers:
    """Times [s]; minus infinity: never."""

    def __init__(self, world: World) -> None:
        self._world, self._from = world, world.clock.now
        self.sent_at = -math.inf
        """Somebody sent controlwords, setpoints or NMT commands past the driver's decisions."""
        self.ordered_at = -math.inf
        """... or published to cmd_vel."""
        self.deaf_at = -math.inf
        """The watchdog could not send."""

    def step(self, now: float) -> None:
        """Now."""
        driver, intruder = self._world.driver, self._world.intruder
        if driver.alive and (driver.repeats or driver.ignores_zero):
            self.sent_at = now
        if intruder.bad_at > max(self._from, self.sent_at):
            self.sent_at = intruder.bad_at
        if intruder.twist is not None:
            self.ordered_at = now
        if self._world.watchdog.is_deaf:
            self.deaf_at = now

    @property
    def acted_at(self) -> float:
        """Somebody moved the base, or may have."""
        return max(self.sent_at, self.ordered_at)
