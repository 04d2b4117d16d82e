"""The speed now, so that the base comes to standstill at the distance: a ramp with jerk limit, a braking curve.

What was ordered during the latency of the loop has not been seen by the odometry yet, but will be driven: it counts as
driven already, so that neither old odometry nor slow drives make the base overshoot. Magnitudes only: no signs here.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, fields
from itertools import pairwise

END_GAIN_PER_S = 5.0
"""Near the end the speed is this many times the remaining distance: the last centimetres take 1/5 s per factor e."""
BRAKING_SHARE = 0.8
"""Share of the deceleration that the curve plans with: the rest lets the drives catch up with it."""


@dataclass(frozen=True, slots=True)
class ProfileLimits:
    """What a profile keeps to. All positive."""

    speed_mps: float
    """Of this goal: its max_speed_mps, or the robot's limit if that is lower."""
    acceleration_mps2: float
    deceleration_mps2: float
    jerk_mps3: float
    crawl_mps: float
    """Least speed that is ordered before the end: slow enough to stop within half a millimetre, fast enough to move."""
    chain_latency_s: float
    """From an order to the wheels' motion, without the odometry's age: mux, filter, cycle and lag of the drives."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{field.name} must be finite and above 0, not {value}")


def braking_speed_mps(remaining_m: float, deceleration_mps2: float, jerk_mps3: float) -> float:
    """Highest speed from which a jerk-limited stop needs no more than `remaining_m` (negative counts as 0).

    From s = v²/(2·a) + v·a/(2·j), solved for v: the distance of a stop whose deceleration a builds up with jerk j.
    """
    half_m_per_s = deceleration_mps2**2 / (2.0 * jerk_mps3)
    return math.sqrt(half_m_per_s**2 + 2.0 * deceleration_mps2 * max(0.0, remaining_m)) - half_m_per_s


def ideal_time_s(distance_m: float, limits: ProfileLimits) -> float:
    """Time that a trapezoidal profile needs for `distance_m` >= 0, the gentle end included."""
    up, down = limits.acceleration_mps2, BRAKING_SHARE * limits.deceleration_mps2
    ramps_m = 0.5 * limits.speed_mps**2 * (1.0 / up + 1.0 / down)
    end_s = 5.0 / END_GAIN_PER_S
    if distance_m >= ramps_m:
        return (distance_m - ramps_m) / limits.speed_mps + limits.speed_mps * (1.0 / up + 1.0 / down) + end_s
    top_mps = math.sqrt(2.0 * distance_m / (1.0 / up + 1.0 / down))
    return top_mps * (1.0 / up + 1.0 / down) + end_s


class Profile:
    """The order of each control cycle. Remembers its own orders of the last moments, nothing else."""

    def __init__(self, limits: ProfileLimits) -> None:
        self._limits = limits
        self._orders: deque[tuple[float, float]] = deque()
        self._acceleration_mps2 = 0.0

    def pending_m(self, odometry_time: float, now_s: float) -> float:
        """Distance [m] that was ordered, but cannot be part of odometry received at `odometry_time` yet."""
        since = odometry_time - self._limits.chain_latency_s
        while len(self._orders) > 1 and self._orders[1][0] <= since:
            self._orders.popleft()
        steps = pairwise([*self._orders, (now_s, 0.0)])
        return sum(speed * max(0.0, end - max(start, since)) for (start, speed), (end, _) in steps)

    def order(self, remaining_m: float, odometry_time: float, now_s: float) -> float | None:
        """Speed to order now, >= 0 [m/s]. None: order to stand, then the drives end at the distance.

        `remaining_m` is what odometry received at `odometry_time` leaves to drive. Call once per control cycle.
        """
        left_m = remaining_m - self.pending_m(odometry_time, now_s)
        if left_m <= 0.0:
            self.stop(now_s)
            return None
        speed_mps = self._speed(left_m, now_s)
        self._orders.append((now_s, speed_mps))
        return speed_mps

    def stop(self, now_s: float) -> None:
        """Zero is ordered from `now_s` on."""
        self._orders.append((now_s, 0.0))
        self._acceleration_mps2 = 0.0

    def _speed(self, left_m: float, now_s: float) -> float:
        limits = self._limits
        last_time, last_mps = self._orders[-1] if self._orders else (now_s, 0.0)
        curve_mps = braking_speed_mps(left_m, BRAKING_SHARE * limits.deceleration_mps2, limits.jerk_mps3)
        end_mps = max(END_GAIN_PER_S * left_m, limits.crawl_mps)
        wanted_mps = min(limits.speed_mps, max(curve_mps, limits.crawl_mps), end_mps)
        return min(wanted_mps, self._ramped(last_mps, now_s - last_time))

    def _ramped(self, last_mps: float, elapsed_s: float) -> float:
        """Highest speed that acceleration and jerk allow after `last_mps`, rounding off towards the goal's speed."""
        limits = self._limits
        rounded_mps2 = math.sqrt(2.0 * limits.jerk_mps3 * max(0.0, limits.speed_mps - last_mps))
        risen_mps2 = self._acceleration_mps2 + limits.jerk_mps3 * elapsed_s
        self._acceleration_mps2 = min(limits.acceleration_mps2, risen_mps2, rounded_mps2)
        return last_mps + self._acceleration_mps2 * elapsed_s
