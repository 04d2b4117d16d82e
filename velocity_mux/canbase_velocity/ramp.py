"""How the driver goes from one velocity to another: its ramps with their jerk limit, written a second time on purpose.

This package does not know the driver; a test compares both. Rules, as in canbase_driver/motion/limiter.py:
1. The velocity moves along the straight line to the order in the (v, w) plane; the slower axis sets the time. Only
   braking does not wait for a turn that grows.
2. An acceleration away from the order ends at once. A reversal brakes to an exact zero first, a turn that reverses
   beside braking with its own deceleration, off the line.
3. jerk_mps3 rounds the begin and the end of each change of the linear velocity; a turn in place has no jerk limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from canbase_config.robot import Limits
from canbase_velocity.twist import ZERO, Twist

NEGLIGIBLE_MPS = 1e-9
"""A change of the linear velocity below this needs no jerk limit [m/s]."""
RESIDUE = 1e-14
"""What rounding leaves of a velocity that has become zero [m/s, rad/s]."""


@dataclass(frozen=True, slots=True)
class Moving:
    """A velocity, and how its linear part changes [m/s²], with sign."""

    twist: Twist
    acceleration_mps2: float = 0.0


AT_REST = Moving(ZERO)


def follow(moving: Moving, order: Twist, limits: Limits, dt_s: float) -> Moving:
    """`dt_s` later, on the way to `order`. A step that reaches zero on the way to a reversal ends there."""
    twist, waypoint = moving.twist, _waypoint(moving.twist, order)
    if _slows(twist.linear_mps, waypoint.linear_mps) and twist.angular_radps * waypoint.angular_radps < 0.0:
        straight = follow(moving, Twist(waypoint.linear_mps, twist.angular_radps), limits, dt_s)
        left_radps = max(0.0, abs(twist.angular_radps) - limits.angular_deceleration_radps2 * max(dt_s, 0.0))
        turn_radps = math.copysign(left_radps, twist.angular_radps)
        return replace(straight, twist=_without_residue(Twist(straight.twist.linear_mps, turn_radps)))
    goal, ramp_s = _line(twist, waypoint, limits)
    if ramp_s <= 0.0 or dt_s <= 0.0:
        return Moving(goal) if ramp_s <= 0.0 else moving
    change_mps = goal.linear_mps - twist.linear_mps
    distance_mps, slope_mps2 = abs(change_mps), abs(change_mps) / ramp_s
    if distance_mps <= NEGLIGIBLE_MPS:
        done = dt_s / ramp_s
    else:
        towards_mps2 = math.copysign(1.0, change_mps) * moving.acceleration_mps2
        curve = _Curve.of(distance_mps, towards_mps2, slope_mps2, limits.jerk_mps3)
        gained_mps, slope_mps2 = curve.after(dt_s)
        done = gained_mps / distance_mps
    if done >= 1.0:
        return Moving(goal)
    reached = _without_residue(_between(twist, goal, done))
    return Moving(goal) if reached == goal else Moving(reached, math.copysign(slope_mps2, change_mps))


def stop_way_s(moving: Moving, limits: Limits) -> float:
    """The way until the base stands, by an order of zero, as time at the present velocity [s]: what it still drives and
    turns is this times its velocity."""
    linear_mps, angular_radps = abs(moving.twist.linear_mps), abs(moving.twist.angular_radps)
    ramp_s = max(linear_mps / limits.deceleration_mps2, angular_radps / limits.angular_deceleration_radps2)
    if linear_mps <= NEGLIGIBLE_MPS:
        return ramp_s / 2.0
    towards_mps2 = -math.copysign(1.0, moving.twist.linear_mps) * moving.acceleration_mps2
    return _Curve.of(linear_mps, towards_mps2, linear_mps / ramp_s, limits.jerk_mps3).left_mps_s() / linear_mps


def _line(start: Twist, end: Twist, limits: Limits) -> tuple[Twist, float]:
    """Where the straight line ends, and the time for it without a jerk limit [s]."""
    linear_s = _axis_s(start.linear_mps, end.linear_mps, limits.acceleration_mps2, limits.deceleration_mps2)
    turn, turn_to = start.angular_radps, end.angular_radps
    angular_s = _axis_s(turn, turn_to, limits.angular_acceleration_radps2, limits.angular_deceleration_radps2)
    if _slows(start.linear_mps, end.linear_mps) and angular_s > linear_s and not _slows(turn, turn_to):
        return Twist(end.linear_mps, _between(start, end, linear_s / angular_s).angular_radps), linear_s
    return end, max(linear_s, angular_s)


def _slows(velocity: float, goal: float) -> bool:
    """One axis goes towards zero and not beyond it."""
    return velocity * goal >= 0.0 and abs(goal) < abs(velocity)


def _axis_s(velocity: float, goal: float, acceleration: float, deceleration: float) -> float:
    if _slows(velocity, goal):
        return abs(goal - velocity) / deceleration
    return abs(goal - velocity) / (min(acceleration, deceleration) if velocity * goal < 0.0 else acceleration)


def _waypoint(twist: Twist, order: Twist) -> Twist:
    """The order, or where the linear velocity is zero on the way to it; of a turn alone, where the turn is."""
    if twist.linear_mps * order.linear_mps < 0.0:
        done = twist.linear_mps / (twist.linear_mps - order.linear_mps)
        return Twist(0.0, _between(twist, order, done).angular_radps)
    if abs(order.linear_mps - twist.linear_mps) <= NEGLIGIBLE_MPS and twist.angular_radps * order.angular_radps < 0.0:
        return Twist(order.linear_mps, 0.0)
    return order


def _between(start: Twist, end: Twist, done: float) -> Twist:
    left = 1.0 - done
    return Twist(
        end.linear_mps + left * (start.linear_mps - end.linear_mps),
        end.angular_radps + left * (start.angular_radps - end.angular_radps),
    )


def _without_residue(twist: Twist) -> Twist:
    linear, angular = (value if abs(value) > RESIDUE else 0.0 for value in (twist.linear_mps, twist.angular_radps))
    return Twist(linear, angular)


@dataclass(frozen=True, slots=True)
class _Curve:
    """The quickest rise by `distance`: its slope goes from `initial` to `peak`, stays there and goes to 0."""

    distance: float
    initial: float
    peak: float
    jerk: float

    @staticmethod
    def of(distance: float, towards: float, steepest: float, jerk: float) -> _Curve:
        """`towards`: the slope now; one that leads away is none, one that is too steep to end in time is cut."""
        initial = min(max(towards, 0.0), steepest, math.sqrt(2.0 * jerk * distance))
        return _Curve(distance, initial, min(steepest, math.sqrt(jerk * distance + initial**2 / 2.0)), jerk)

    @property
    def _phases_s(self) -> tuple[float, float, float]:
        rise_s, fall_s = (self.peak - self.initial) / self.jerk, self.peak / self.jerk
        hold = self.distance - (self.peak + self.initial) * rise_s / 2.0 - self.peak * fall_s / 2.0
        return rise_s, max(hold, 0.0) / self.peak, fall_s

    def after(self, t_s: float) -> tuple[float, float]:
        """What is gained after `t_s`, and the slope then."""
        rise_s, hold_s, fall_s = self._phases_s
        if t_s < rise_s:
            return self.initial * t_s + self.jerk * t_s**2 / 2.0, self.initial + self.jerk * t_s
        if t_s < rise_s + hold_s:
            return (self.peak + self.initial) * rise_s / 2.0 + self.peak * (t_s - rise_s), self.peak
        left_s = max(rise_s + hold_s + fall_s - t_s, 0.0)
        return self.distance - self.jerk * left_s**2 / 2.0, self.jerk * left_s

    def left_mps_s(self) -> float:
        """The integral of what is still to be gained, over the whole time: the way of a velocity that falls so."""
        rise_s, hold_s, fall_s = self._phases_s
        at_hold = self.distance - (self.peak + self.initial) * rise_s / 2.0
        rising = self.distance * rise_s - self.initial * rise_s**2 / 2.0 - self.jerk * rise_s**3 / 6.0
        return rising + at_hold * hold_s - self.peak * hold_s**2 / 2.0 + self.jerk * fall_s**3 / 6.0
