"""Does each wheel do what was ordered? Runaway, another path than ordered, and a standstill that is none."""

from __future__ import annotations

import math
from collections import deque

from campaign.world import World
from canbase_velocity.twist import Twist

RUNAWAY_MPS, RUNAWAY_S = 0.35, 0.6
"""So much faster than the fastest that was ordered of it a wheel may be, and for how long, while it has power."""
PATH_RADPS, PATH_SHARE, PATH_S = 0.5, 0.25, 0.9
"""So far beside what was ordered the base may turn, and for how long, while it has power."""
REMEMBERED_S = 1.2
"""An order counts for so long: hold times of the layers, their reaction, and the ramp that follows the order."""
STANDS_MPS, STANDS_S = 0.15, 0.5
"""A wheel that is faster for longer does not stand, whoever says so."""


class MotionJudge:
    """To be asked every step. Times in seconds, virtual."""

    def __init__(self, world: World) -> None:
        self._world, self._half_m = world, world.robot.base.track_m / 2.0
        now = world.clock.now
        self._orders: deque[tuple[float, Twist]] = deque([(now, Twist(0.0, 0.0))])
        self._fast_since = self._beside_since = self._lies_since = now

    def order(self, twist: Twist) -> None:
        """The filter ordered this, with a lease."""
        self._orders.append((self._world.clock.now, twist))

    def step(self, now: float) -> tuple[str, str]:
        """Name of the property that does not hold now and what is seen; two empty texts: everything holds."""
        while len(self._orders) > 1 and self._orders[1][0] < now - REMEMBERED_S:
            self._orders.popleft()
        return self._runaway(now) or self._path(now) or self._standstill(now) or ("", "")

    def _fastest_mps(self) -> float:
        base = self._world.drives.bench.base
        return max(abs(base.v_left_mps), abs(base.v_right_mps))

    def _powered(self) -> bool:
        nodes = self._world.drives.bench.nodes.values()
        return any(axis.motor.powered for node in nodes for axis in node.axes)

    def _runaway(self, now: float) -> tuple[str, str] | None:
        ordered_mps = max(abs(t.linear_mps) + abs(t.angular_radps) * self._half_m for _, t in self._orders)
        wheel_mps = self._fastest_mps()
        if wheel_mps <= ordered_mps + RUNAWAY_MPS or not self._powered():
            self._fast_since = now
        if now <= self._fast_since + RUNAWAY_S:
            return None
        return "runaway", f"a wheel turns at {wheel_mps:.2f} m/s, {ordered_mps:.2f} m/s was the most ordered of it"

    def _path(self, now: float) -> tuple[str, str] | None:
        """Between the slowest and the fastest turn that was ordered, zero among them, as a stop may come any time."""
        turns = [twist.angular_radps for _, twist in self._orders]
        low, high = min(0.0, *turns, 0.0), max(0.0, *turns, 0.0)
        turn = self._world.drives.bench.base.w_radps
        slack = PATH_RADPS + PATH_SHARE * max(-low, high)
        if low - slack <= turn <= high + slack or not self._powered():
            self._beside_since = now
        if now <= self._beside_since + PATH_S:
            return None
        return "path", f"the base turns at {turn:+.2f} rad/s, between {low:+.2f} and {high:+.2f} rad/s were ordered"

    def _standstill(self, now: float) -> tuple[str, str] | None:
        driver = self._world.driver
        says = driver.running and driver.snapshot is not None and driver.snapshot.standstill
        if not says or self._fastest_mps() <= STANDS_MPS or math.isclose(now, self._lies_since):
            self._lies_since = now
        if now <= self._lies_since + STANDS_S:
            return None
        return "standstill", f"the driver says standstill, a wheel turns at {self._fastest_mps():.2f} m/s"
