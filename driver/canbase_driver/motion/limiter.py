"""Limits of speed, acceleration and jerk between the command and the wheels. No clock, no bus; a state goes in and out.

Four rules, in the order of their weight:
1. The path's curvature (w / v) is kept: a target that is too fast is scaled as a whole, and the velocity moves along
   the straight line from the present to the target in the (v, w) plane. A stop follows the arc that the base is on.
2. Braking is never put off: an acceleration away from a new target is dropped at once, a turn that grows is not waited
   for, and the jerk limit lengthens a stop by deceleration / jerk at most. A reversal brakes to an exact zero first;
   a turn that reverses while the base brakes does so with its own deceleration, off the straight line.
3. The target is reached exactly and never passed: when it comes too near for the jerk limit, the acceleration drops at
   once to what the jerk limit can still take back in time.
4. An emergency stop that has begun goes on to zero, whatever is requested meanwhile.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from canbase_config.robot import Limits
from canbase_driver.motion.kinematics import Twist2D

LONGEST_RAMP_STEP_S = 0.1
"""A step after a longer gap counts as this long [s]: a late cycle must not become a jump of the setpoint."""
NEGLIGIBLE_MPS = 1e-9
"""A change of the linear velocity below this needs no jerk limit [m/s]."""
RESIDUE = 1e-14
"""What rounding leaves of a velocity that has become zero [m/s, rad/s]."""


@dataclass(frozen=True, slots=True)
class MotionState:
    """What was ordered last, and how it was changing."""

    AT_REST: ClassVar[MotionState]

    twist: Twist2D
    acceleration_mps2: float = 0.0
    """Rate of change of the linear velocity, with its sign [m/s²]."""
    emergency: bool = False
    """An emergency stop is under way."""


MotionState.AT_REST = MotionState(Twist2D.ZERO)


@dataclass(frozen=True, slots=True)
class Limiter:
    """The limits of one base. Holds no state: the caller keeps the `MotionState`."""

    limits: Limits
    track_m: float

    @property
    def wheel_mps(self) -> float:
        """Greatest rim speed [m/s]: what the faster of "straight on" and "turn in place" needs, each at its limit."""
        return max(self.limits.linear_mps, self.limits.angular_radps * self.track_m / 2.0)

    def limit(self, target: Twist2D) -> Twist2D:
        """`target`, scaled down to the speed limits of base and wheels with its curvature kept.

        Raises ValueError for NaN and infinity.
        """
        if not target.is_finite:
            raise ValueError(f"a velocity must be finite, not {target}; refuse it where it is received")
        linear_mps, angular_radps = abs(target.linear_mps), abs(target.angular_radps)
        excess = max(
            linear_mps / self.limits.linear_mps,
            angular_radps / self.limits.angular_radps,
            (linear_mps + angular_radps * self.track_m / 2.0) / self.wheel_mps,
        )
        if excess <= 1.0:
            return target
        return Twist2D(
            math.copysign(min(linear_mps / excess, self.limits.linear_mps), target.linear_mps),
            math.copysign(min(angular_radps / excess, self.limits.angular_radps), target.angular_radps),
        )

    def step(self, current: MotionState, target: Twist2D, dt_s: float, *, emergency: bool = False) -> MotionState:
        """The velocity to order `dt_s` after `current`, on the way to `target` (limited here once more).

        `emergency` stops with emergency_deceleration_mps2 and without a jerk limit, whatever the target is; the angular
        deceleration grows by the same factor as the linear one.
        Raises ValueError for a target or current velocity that is not finite, and for a `dt_s` that is not or negative.
        """
        if not (current.twist.is_finite and math.isfinite(current.acceleration_mps2)):
            raise ValueError(f"the current motion must be finite, not {current}")
        if not (math.isfinite(dt_s) and dt_s >= 0.0):
            raise ValueError(f"a time step must be finite and not negative, not {dt_s} s")
        emergency = emergency or current.emergency
        goal = Twist2D.ZERO if emergency else _waypoint(current.twist, self.limit(target))
        if dt_s == 0.0:
            return current
        if goal == current.twist:
            return MotionState(goal)
        dt_s = min(dt_s, LONGEST_RAMP_STEP_S)
        if _slows(current.twist.linear_mps, goal.linear_mps) and current.twist.angular_radps * goal.angular_radps < 0.0:
            return self._brake_apart(current, goal, dt_s)
        return self._advance(current, goal, dt_s, emergency)

    def _brake_apart(self, current: MotionState, goal: Twist2D, dt_s: float) -> MotionState:
        """Braking, and a turn that reverses: each goes towards zero with its own deceleration, none waits."""
        straight = Twist2D(goal.linear_mps, current.twist.angular_radps)
        reached = self._advance(current, straight, dt_s, emergency=False)
        left_radps = abs(current.twist.angular_radps) - self.limits.angular_deceleration_radps2 * dt_s
        turn_radps = math.copysign(max(0.0, left_radps), current.twist.angular_radps)
        return replace(reached, twist=_without_residue(Twist2D(reached.twist.linear_mps, turn_radps)))

    def _advance(self, current: MotionState, goal: Twist2D, dt_s: float, emergency: bool) -> MotionState:
        """`dt_s` along the straight line to `goal`, on which the linear velocity does not change its sign."""
        goal, ramp_s = self._pace(current.twist, goal, emergency)
        if ramp_s <= 0.0:
            return MotionState(goal)
        change_mps = goal.linear_mps - current.twist.linear_mps
        distance_mps = abs(change_mps)
        slope_mps2 = distance_mps / ramp_s
        if emergency or distance_mps <= NEGLIGIBLE_MPS:
            done = dt_s / ramp_s
        else:
            initial_mps2 = min(max(math.copysign(1.0, change_mps) * current.acceleration_mps2, 0.0), slope_mps2)
            gained_mps, slope_mps2 = _s_curve(distance_mps, initial_mps2, slope_mps2, self.limits.jerk_mps3, dt_s)
            done = gained_mps / distance_mps
        if done >= 1.0:
            return MotionState(goal)
        twist = _without_residue(_between(current.twist, goal, done))
        if twist == goal:
            return MotionState(goal)
        return MotionState(twist, math.copysign(slope_mps2, change_mps), emergency)

    def _pace(self, current: Twist2D, goal: Twist2D, emergency: bool) -> tuple[Twist2D, float]:
        """Where the straight line from `current` ends, and the time for it without a jerk limit [s].

        The slower axis sets the time. Only braking does not wait for a turn that grows: there the line ends where the
        braking does, and the rest of the turn comes after.
        """
        limits = self.limits
        linear_s = _axis_ramp_s(current.linear_mps, goal.linear_mps, limits.acceleration_mps2, limits.deceleration_mps2)
        angular_s = _axis_ramp_s(
            current.angular_radps,
            goal.angular_radps,
            limits.angular_acceleration_radps2,
            limits.angular_deceleration_radps2,
        )
        brakes = _slows(current.linear_mps, goal.linear_mps)
        if brakes and angular_s > linear_s and not _slows(current.angular_radps, goal.angular_radps):
            return Twist2D(goal.linear_mps, _between(current, goal, linear_s / angular_s).angular_radps), linear_s
        shortening = limits.deceleration_mps2 / limits.emergency_deceleration_mps2 if emergency else 1.0
        return goal, max(linear_s, angular_s) * shortening


def _slows(current: float, goal: float) -> bool:
    """One axis goes towards zero and not beyond it."""
    return current * goal >= 0.0 and abs(goal) < abs(current)


def _axis_ramp_s(current: float, goal: float, acceleration: float, deceleration: float) -> float:
    """Time of one axis. One that goes through zero uses the smaller limit until it is there: the line has one speed."""
    if _slows(current, goal):
        limit = deceleration
    elif current * goal < 0.0:
        limit = min(acceleration, deceleration)
    else:
        limit = acceleration
    return abs(goal - current) / limit


def _waypoint(current: Twist2D, target: Twist2D) -> Twist2D:
    """`target`, or the point on the way to it at which the linear velocity is zero, if it has to change its sign; where
    it does not change at all, that at which the turn is."""
    if current.linear_mps * target.linear_mps < 0.0:
        done = current.linear_mps / (current.linear_mps - target.linear_mps)
        return Twist2D(0.0, _between(current, target, done).angular_radps)
    straight = abs(target.linear_mps - current.linear_mps) <= NEGLIGIBLE_MPS
    if straight and current.angular_radps * target.angular_radps < 0.0:
        return Twist2D(target.linear_mps, 0.0)
    return target


def _between(start: Twist2D, end: Twist2D, done: float) -> Twist2D:
    """The point at the fraction `done` of the line; towards zero both components shrink by the same factor."""
    left = 1.0 - done
    return Twist2D(
        end.linear_mps + left * (start.linear_mps - end.linear_mps),
        end.angular_radps + left * (start.angular_radps - end.angular_radps),
    )


def _without_residue(twist: Twist2D) -> Twist2D:
    """A velocity that is zero but for rounding is zero: else the next step would be needed to end at it."""
    return Twist2D(
        twist.linear_mps if abs(twist.linear_mps) > RESIDUE else 0.0,
        twist.angular_radps if abs(twist.angular_radps) > RESIDUE else 0.0,
    )


def _s_curve(distance: float, initial: float, rate: float, jerk: float, t_s: float) -> tuple[float, float]:
    """What is gained after `t_s` of the quickest rise by `distance`, and the slope then; the slope ends at 0.

    `initial` and `rate` are the first and the greatest slope, 0 ≤ initial ≤ rate. The slope rises with `jerk`, stays at
    its peak, falls with `jerk`. An initial slope that is too steep for that is cut to the steepest one that is not.
    """
    initial = min(initial, math.sqrt(2.0 * jerk * distance))
    peak = min(rate, math.sqrt(jerk * distance + initial * initial / 2.0))
    rise_s, fall_s = (peak - initial) / jerk, peak / jerk
    if t_s < rise_s:
        return initial * t_s + jerk * t_s * t_s / 2.0, initial + jerk * t_s
    rise, fall_distance = (peak + initial) * rise_s / 2.0, peak * fall_s / 2.0
    hold_s = max(distance - rise - fall_distance, 0.0) / peak
    if t_s < rise_s + hold_s:
        return rise + peak * (t_s - rise_s), peak
    left_s = max(rise_s + hold_s + fall_s - t_s, 0.0)
    return distance - jerk * left_s * left_s / 2.0, jerk * left_s
