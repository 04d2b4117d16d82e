"""What the leases of the recent past allow: bounds of the base's velocity, and of each wheel's target from them.

Rules
1. An order allows itself and everything between it and zero at once: stopping is always allowed.
2. It stays allowed for `order_hold_s` after the next order took its place or its lease ran out: that long may
   the driver still follow it (its command timeout, its cycle, latency, and the time that the jerk limit adds).
3. Then a bound falls to what is ordered now. As the driver keeps the curvature while it slows down, linear and angular
   bounds wait for each other: braking for a turn that has to end as well, a turn for braking, and also for a linear
   velocity that is reversed, or that still has to grow. The slower one sets the time (a reversal: both of them), and
   what has grown is waited for no more.
4. Before the watchdog started anything within the limits may have been ordered.
5. From `emergency_wait_s` after "brakes hard" on, orders allow nothing: all bounds fall to zero together, with the
   emergency deceleration, as the driver does then. Orders of before count no more, also when the base is at standstill.

Pure; written apart from the driver's motion/limiter.py on purpose.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from canbase_config.watchdog import WatchdogConfig


class Peak:
    """The greatest of the values that were in force within the last `hold_s` [s]; without any, 0 is in force."""

    def __init__(self, hold_s: float) -> None:
        """Nothing was in force yet."""
        self._hold_s = hold_s
        self._past: deque[tuple[float, float]] = deque()
        """Value and when it ended, only those that may still be the greatest: the values fall, their ends rise."""
        self._value, self._end = 0.0, -math.inf

    def set(self, value: float, now_s: float, until: float) -> None:
        """From `now_s` on `value` is in force, until the next one or until the time `until`, whichever is earlier."""
        if self._end < now_s:
            self._keep(self._value, self._end)
            self._keep(0.0, now_s)
        elif value != self._value:  # else it stays in force
            self._keep(self._value, now_s)
        self._value, self._end = value, until

    def forget(self) -> None:
        """Only the value in force is left."""
        self._past.clear()

    def greatest(self, now_s: float) -> float:
        """The greatest value at the time `now_s`, which may not be before that of the last call."""
        past = self._past
        if not past and self._end >= now_s:
            return self._value
        since = now_s - self._hold_s
        while past and past[0][1] < since:
            past.popleft()
        if not past:
            before = self._value if self._end >= since else -math.inf
        else:
            before = past[0][0]
            if self._value > before and self._end >= since:
                before = self._value
        return before if self._end >= now_s else max(before, 0.0)

    def _keep(self, value: float, end: float) -> None:
        past = self._past
        while past and past[-1][0] <= value:
            past.pop()
        past.append((value, end))


class DirectionBounds:
    """One way to go (forward, backward, to the left, to the right): what is ordered that way, and what is allowed."""

    def __init__(self, ceiling: float, hold_s: float, now_s: float) -> None:
        """Up to `ceiling` may have been ordered before the time `now_s`."""
        self._ceiling = ceiling
        self._high, self._low = Peak(hold_s), Peak(hold_s)
        self._high.set(ceiling, now_s, now_s)
        self.level = self.most = ceiling
        self.least = self.grown = 0.0

    def order(self, value: float, now_s: float, until: float) -> None:
        """An order, negative for the opposite way; above the ceiling it allows no more than the ceiling."""
        value = min(max(value, 0.0), self._ceiling)
        self._high.set(value, now_s, until)
        self._low.set(-value, now_s, until)

    def update_orders(self, now_s: float) -> None:
        """Bring the most and the least of what was ordered up to date."""
        self.most, self.least = self._high.greatest(now_s), -self._low.greatest(now_s)
        self.level = max(self.level, self.most)
        self.grown = min(self.grown, self.least)

    def cease(self) -> None:
        """What was ordered is forgotten, and what is ordered allows nothing now. What is allowed is left, to fall."""
        self._high.forget()
        self._low.forget()
        self.most = self.least = self.grown = 0.0

    def fall(self, kept: float) -> None:
        """Keep this share of what is allowed beyond the most that was ordered."""
        self.level = self.most + (self.level - self.most) * kept

    def grow(self, kept: float) -> None:
        """At least so fast the driver goes this way: of what is missing to the least order, this share is left."""
        self.grown = self.least - (self.least - self.grown) * kept

    @property
    def growth(self) -> float:
        """By so much the driver may still have to grow, to the most that was ordered."""
        return self.most - self.grown

    @property
    def excess(self) -> float:
        """What is allowed beyond all orders: it falls."""
        return self.level - self.most

    @property
    def span(self) -> float:
        """What is allowed beyond the least order: so far the driver may be from where it goes."""
        return self.level - self.least


@dataclass(frozen=True, slots=True)
class Bounds:
    """What the base may be ordered to do. Each range contains 0. Linear [m/s], angular [rad/s] (REP 103)."""

    linear_low: float
    linear_high: float
    angular_low: float
    angular_high: float

    def wheel(self, arm_m: float) -> tuple[float, float]:
        """Least and greatest speed [m/s] of a wheel that is `arm_m` to the right of the middle (left: negative)."""
        one, other = arm_m * self.angular_low, arm_m * self.angular_high
        return self.linear_low + min(one, other), self.linear_high + max(one, other)

    def all_left_right(
        self, lefts: Sequence[float], rights: Sequence[float], track_m: float, tolerance_mps: float
    ) -> str:
        """The same for each wheel of the left side with each one of the right: the first reason."""
        for left_mps in lefts:
            for right_mps in rights:
                if why := self.left_right(left_mps, right_mps, track_m, tolerance_mps):
                    return why
        return ""

    def left_right(self, left_mps: float, right_mps: float, track_m: float, tolerance_mps: float) -> str:
        """Why two wheels that are each allowed are not so together, empty when they are."""
        linear, angular = (left_mps + right_mps) / 2.0, (right_mps - left_mps) / track_m
        slack = 2.0 * tolerance_mps / track_m
        if not self.linear_low - tolerance_mps <= linear <= self.linear_high + tolerance_mps:
            return f"{linear:.3f} m/s together, allowed {self.linear_low:.3f} to {self.linear_high:.3f} m/s"
        if not self.angular_low - slack <= angular <= self.angular_high + slack:
            return f"{angular:.3f} rad/s together, allowed {self.angular_low:.3f} to {self.angular_high:.3f} rad/s"
        return ""


class Envelope:
    """The bounds as they rise with each order and fall with time."""

    def __init__(self, config: WatchdogConfig, now_s: float) -> None:
        """Rule 4: open at the monotonic time `now_s` [s]."""
        self._config = config
        ceilings = (config.linear_mps, config.linear_mps, config.angular_radps, config.angular_radps)
        self._directions = tuple([DirectionBounds(ceiling, config.order_hold_s, now_s) for ceiling in ceilings])
        self._at = now_s

    def order(self, linear_mps: float, angular_radps: float, now_s: float) -> None:
        """A lease that counts. What it orders above the configured limits allows no more than they do."""
        until = now_s + self._config.lease_timeout_s
        forward, backward, left, right = self._directions
        forward.order(linear_mps, now_s, until)
        backward.order(-linear_mps, now_s, until)
        left.order(angular_radps, now_s, until)
        right.order(-angular_radps, now_s, until)

    def advance(self, now_s: float, hard_since: float = math.inf) -> Bounds:
        """The bounds at the monotonic time `now_s` [s], which may not be before that of the last call.

        `hard_since`: when "brakes hard" was received [s], infinity while it does not hold (rule 5).
        """
        elapsed_s, self._at = now_s - self._at, now_s
        hard_s = now_s - hard_since - self._config.emergency_wait_s
        if hard_s >= 0.0:
            self._fall_hard(min(elapsed_s, hard_s))
        else:
            self._follow_orders(elapsed_s, now_s)
        forward, backward, left, right = self._directions
        return Bounds(-backward.level, forward.level, -right.level, left.level)

    def _fall_hard(self, elapsed_s: float) -> None:
        config = self._config
        forward, backward, left, right = self._directions
        linear_s = max(forward.level, backward.level) / config.deceleration_mps2
        angular_s = max(left.level, right.level) / config.angular_deceleration_radps2
        kept = _kept(elapsed_s, max(linear_s, angular_s) * config.emergency_share)
        for direction in self._directions:
            direction.cease()
            direction.fall(kept)

    def _follow_orders(self, elapsed_s: float, now_s: float) -> None:
        for direction in self._directions:
            direction.update_orders(now_s)
        forward, backward, left, right = self._directions
        falls = forward.excess or backward.excess or left.excess or right.excess
        if falls or forward.growth or backward.growth:
            linear_s, angular_s = self._falling_s()
            self._grow(elapsed_s, angular_s)
            forward.fall(_kept(elapsed_s, linear_s))
            backward.fall(_kept(elapsed_s, linear_s))
            left.fall(_kept(elapsed_s, angular_s))
            right.fall(_kept(elapsed_s, angular_s))

    def _grow(self, elapsed_s: float, angular_s: float) -> None:
        """What is ordered has grown when a turn has fallen, and one that is ordered has grown as well.

        It does not grow before the opposite way is braked. An order that the driver scales down, as a wheel cannot go
        so fast, tells nothing of how fast it goes.
        """
        config = self._config
        forward, backward, left, right = self._directions
        linear_mps, angular_radps = max(forward.most, backward.most), max(left.most, right.most)
        scaled = linear_mps + angular_radps * config.track_m / 2.0 > config.max_wheel_mps
        unknown = scaled or angular_radps >= config.angular_radps
        kept = _kept(elapsed_s, angular_s + angular_radps / config.angular_acceleration_radps2)
        for direction, opposite in ((forward, backward), (backward, forward)):
            if unknown or opposite.level > 0.0:
                direction.grown = 0.0
            else:
                direction.grow(kept)

    def _falling_s(self) -> tuple[float, float]:
        """How long the linear and the angular bounds still take to fall to what is ordered (rule 3)."""
        config = self._config
        forward, backward, left, right = self._directions
        braking, turning = config.deceleration_mps2, config.angular_deceleration_radps2
        reversing = min(config.angular_acceleration_radps2, turning)
        linear_s = max(forward.excess, backward.excess) / braking
        waits_s = max(left.span, right.span) / turning
        angular_s = max(
            left.excess / (reversing if right.most > 0.0 else turning),
            right.excess / (reversing if left.most > 0.0 else turning),
            max(forward.span, backward.span) / braking,
        )
        growth_s = max(forward.growth, backward.growth) / min(config.acceleration_mps2, braking)
        reverses = (forward.growth and backward.level) or (backward.growth and forward.level)
        return max(linear_s, waits_s), angular_s + growth_s if reverses else max(angular_s, growth_s)


def _kept(elapsed_s: float, falling_s: float) -> float:
    """The share of an excess that is left after `elapsed_s` of a straight fall to nothing in `falling_s`."""
    return 1.0 - elapsed_s / falling_s if elapsed_s < falling_s else 0.0
