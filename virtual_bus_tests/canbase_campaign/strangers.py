"""What moves drives past all layers, and what cannot be received: when it was last so. Called every step."""

from __future__ import annotations

import math

from canbase_campaign.world import World

SENT_S = 0.1
"""Frames that were sent may be on their way for this long [s]: the delay of the bus, and its queue."""


class Strangers:
    """Times [s]; minus infinity: never."""

    def __init__(self, world: World) -> None:
        self._world, self._from = world, world.clock.now_s
        self.sent_at = -math.inf
        """Somebody sent controlwords, setpoints or NMT commands past the driver's decisions ..."""
        self.sends_from = -math.inf
        """... since then, with pauses of SENT_S at most."""
        self.ordered_at = -math.inf
        """... or published to cmd_vel."""
        self.ordered_on_bus_at = -math.inf
        """A second master sent anything: commands, or a SYNC."""
        self.deaf_from = -math.inf
        """Since when the watchdog could not send, this time or the last one."""
        self._deaf = False

    def step(self, now_s: float) -> None:
        """Now."""
        driver, intruder, deaf = self._world.driver, self._world.intruder, self._world.watchdog.is_deaf
        before = self.sent_at
        if driver.alive and (driver.repeats or driver.ignores_zero):
            self.sent_at = now_s
        if intruder.moves_at > max(self._from, self.sent_at):
            self.sent_at = intruder.moves_at
        if self.sent_at > before + SENT_S:
            self.sends_from = self.sent_at
        if intruder.setpoints_mps or intruder.nmt or intruder.syncs:
            self.ordered_on_bus_at = now_s
        if intruder.twist is not None:
            self.ordered_at = now_s
        self.deaf_from = now_s if deaf and not self._deaf else self.deaf_from
        self._deaf = deaf

    @property
    def begins_at(self) -> float:
        """When somebody began to send, or the watchdog to be deaf: it takes its time from there on to be stopped."""
        return max(self.sends_from, self.deaf_from)

    @property
    def acted_at(self) -> float:
        """Somebody moved the base, or may have."""
        return max(self.sent_at, self.ordered_at)
