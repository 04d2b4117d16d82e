"""A pause counts like a stop for whom a person holds: a joystick that was held over it moves nothing before its zero.

Pauses: a lock holds, or no scan has arrived for a second longer than its timeout. docs/decisions/0029.
"""

from __future__ import annotations

from typing import Final

from canbase_campaign.allowance import Active, Allowance
from canbase_campaign.wishes import Wishes
from canbase_campaign.world import World
from canbase_velocity.twist import Twist

SCANS_S: Final = 1.0
"""Without usable scans for so long the base has been held by their absence: docs/velocity.md ..."""
LATE_S: Final = 0.1
"""... and the mux knows it so much later."""


class PauseJudge:
    """What the sources may want after pauses; all that happens to `Wishes` has to be passed on."""

    def __init__(self, world: World, allowance: Allowance) -> None:
        self._world, self._allowance = world, allowance
        self._wishes = Wishes(world.robot, world.clock.now_s)
        scan = world.robot.safety.scan
        self._scans_s = scan.timeout_s + SCANS_S + LATE_S if scan.required else float("inf")
        self._scan_at = self._ran_from = world.clock.now_s

    def take(self, topic: str, twist: Twist, now_s: float) -> None:
        """A command was sent."""
        self._wishes.take(topic, twist, now_s)

    def arrive(self, topic: str, twist: Twist, now_s: float) -> None:
        """A command has arrived at the mux."""
        self._wishes.arrive(topic, twist, now_s)

    def on_scan(self, now_s: float) -> None:
        """A scan has arrived."""
        self._scan_at = now_s

    def step(self, tau_s: float, now_s: float, *, locked: bool, active: Active) -> str:
        """What is wrong with a motion of this τ; empty: nothing. `locked`: a lock holds that the mux can know of."""
        if not self._world.velocity.running:
            self._ran_from = now_s
        if locked or now_s > max(self._scan_at, self._ran_from) + self._scans_s:
            self._wishes.on_pause(now_s)
        self._allowance.order(self._wishes.greatest_s(now_s), now_s)
        allowed_s = self._allowance.bound_s(tau_s, now_s, active)
        return "" if tau_s <= allowed_s else f"{tau_s:.3f} s to stop, by a source that was held over a pause"
