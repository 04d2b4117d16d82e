"""How fast the base may go: the last decision about a command. Time comes in as an argument; ROS is in filter_node.py.

Rules, in the order of their precedence:
1. Emergency stop pressed: stop. Required and silent counts as pressed. After it, the command has to be zero once.
2. Command silent, or with NaN or infinity: stop.
3. Scan required and silent: stop.
4. Faster than the limits: slower, on the same curve.
5. Obstacle in the direction of travel: slower, on the same curve, so that the base can stop before the stop distance;
   there it stops. Driving away from an obstacle is free.
Zero is always allowed: nothing here makes a command faster or turns it around.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_config.robot import Limits, Robot
from canbase_config.safety import Safety
from canbase_velocity.clearance import Clearances, swept_radius_m
from canbase_velocity.decision import PASSED, Action, Cause, Decision, Finding, stop
from canbase_velocity.twist import ZERO, Twist

SHUTDOWN = Decision(Action.STOP, Cause.SHUTDOWN, "the safety filter is being shut down", "its next start", ZERO)


@dataclass(frozen=True, slots=True)
class FilterConfig:
    """What the filter needs of robot.yaml."""

    limits: Limits
    safety: Safety
    standstill_mps: float

    @staticmethod
    def of(robot: Robot) -> FilterConfig:
        """The filter's part of `robot`."""
        return FilterConfig(robot.limits, robot.safety, robot.base.standstill_mps)


@dataclass(frozen=True, slots=True)
class Inputs:
    """What is known when a decision is made. Ages are of local receive times [s]; None: nothing received yet.

    `clearances` are of the last scan that said something; they count only while that scan is fresh.
    """

    command: Twist
    command_age_s: float | None
    clearances: Clearances
    scan_age_s: float | None
    estop: bool
    estop_age_s: float | None
    awaits_zero: bool
    """An emergency stop was released, and the command has not been zero since."""


def decide(inputs: Inputs, config: FilterConfig) -> Decision:
    """The order for these inputs: the most severe finding wins, of two alike the one of the earlier rule."""
    stopped = _estop(inputs, config) or _command(inputs, config) or _scan(inputs, config)
    if stopped is not None:
        return Decision(stopped.action, stopped.cause, stopped.detail, stopped.clears_on, ZERO)
    ceiling = _ceiling(inputs.command, config.limits)
    limited = _within(inputs.command.scaled(ceiling.factor), config.limits)
    obstacle = _obstacle(limited, inputs, config)
    worst = max(ceiling, obstacle, key=lambda finding: finding.action)
    return Decision(worst.action, worst.cause, worst.detail, worst.clears_on, limited.scaled(obstacle.factor))


def estop_holds(inputs: Inputs, config: FilterConfig) -> bool:
    """Pressed, or required and silent."""
    return inputs.estop or _estop_is_silent(inputs, config)


def approach_speed_mps(gap_m: float, scan_age_s: float, deceleration_mps2: float) -> float:
    """Speed from which the base still stands within gap_m [m/s], having gone on at that speed since the scan was taken.

    From v·age + v²/(2·a) = gap. With a scan of age 0 it is sqrt(2·a·gap).
    """
    if gap_m <= 0.0:
        return 0.0
    before_mps = deceleration_mps2 * scan_age_s
    return math.sqrt(before_mps**2 + 2.0 * deceleration_mps2 * gap_m) - before_mps


def braking_time_s(twist: Twist, limits: Limits) -> float:
    """How long the driver's ordinary ramp from `twist` to standstill takes [s]."""
    return max(
        abs(twist.linear_mps) / limits.deceleration_mps2,
        abs(twist.angular_radps) / limits.angular_deceleration_radps2,
    )


def _estop(inputs: Inputs, config: FilterConfig) -> Finding | None:
    estop = config.safety.estop
    if inputs.estop:
        return stop(Cause.ESTOP, "the emergency stop is pressed", "its release, then a zero command")
    if _estop_is_silent(inputs, config):
        detail = _silence(estop.topic, inputs.estop_age_s, estop.timeout_s)
        return stop(Cause.ESTOP_STALE, detail, f"false on {estop.topic}, then a zero command")
    if inputs.awaits_zero:
        detail = "the emergency stop is released, the command has not been zero since"
        return stop(Cause.ESTOP, detail, "a zero command")
    return None


def _estop_is_silent(inputs: Inputs, config: FilterConfig) -> bool:
    estop = config.safety.estop
    return estop.required and not _is_fresh(inputs.estop_age_s, estop.timeout_s)


def _command(inputs: Inputs, config: FilterConfig) -> Finding | None:
    timeout_s = config.safety.command_timeout_s
    if not _is_fresh(inputs.command_age_s, timeout_s):
        detail = _silence("cmd_vel_mux", inputs.command_age_s, timeout_s)
        return stop(Cause.COMMAND_STALE, detail, "commands on cmd_vel_mux")
    if not inputs.command.is_finite:
        return stop(Cause.COMMAND_INVALID, f"cmd_vel_mux carries {inputs.command}", "a finite command")
    return None


def _scan(inputs: Inputs, config: FilterConfig) -> Finding | None:
    scan = config.safety.scan
    if not scan.required or _is_fresh(inputs.scan_age_s, scan.timeout_s):
        return None
    return stop(Cause.SCAN_STALE, _silence(scan.topic, inputs.scan_age_s, scan.timeout_s), f"scans on {scan.topic}")


def _ceiling(command: Twist, limits: Limits) -> Finding:
    linear_mps, angular_radps = abs(command.linear_mps), abs(command.angular_radps)
    if linear_mps <= limits.linear_mps and angular_radps <= limits.angular_radps:
        return PASSED
    factor = min(
        limits.linear_mps / max(linear_mps, limits.linear_mps),
        limits.angular_radps / max(angular_radps, limits.angular_radps),
    )
    asked = f"{command.linear_mps:.2f} m/s, {command.angular_radps:.2f} rad/s asked for"
    allowed = f"{limits.linear_mps:.2f} m/s, {limits.angular_radps:.2f} rad/s allowed"
    return Finding(Action.LIMIT, Cause.SPEED, f"{asked}, {allowed}", "a slower command", factor)


def _within(twist: Twist, limits: Limits) -> Twist:
    """`twist`, without what the rounding of a scaled number left above the limits."""
    return Twist(
        math.copysign(min(abs(twist.linear_mps), limits.linear_mps), twist.linear_mps),
        math.copysign(min(abs(twist.angular_radps), limits.angular_radps), twist.angular_radps),
    )


def _obstacle(twist: Twist, inputs: Inputs, config: FilterConfig) -> Finding:
    """Compares with a fresh scan only: a required one that is stale has stopped the base before."""
    age_s = inputs.scan_age_s
    if age_s is None or age_s > config.safety.scan.timeout_s:
        return PASSED
    ways = (_straight(twist, inputs.clearances, age_s, config), _turning(twist, inputs.clearances, age_s, config))
    return min(ways, key=lambda finding: finding.factor)


def _straight(twist: Twist, clearances: Clearances, age_s: float, config: FilterConfig) -> Finding:
    if twist.linear_mps == 0.0:
        return PASSED
    where, free_m = ("ahead", clearances.ahead_m) if twist.linear_mps > 0.0 else ("behind", clearances.behind_m)
    limits, safety = config.limits, config.safety
    # The gentlest braking that starts at the slow-down distance from the highest speed, never harder than the ordinary.
    braking_m = safety.slow_distance_m - safety.stop_distance_m
    deceleration_mps2 = min(limits.deceleration_mps2, limits.linear_mps**2 / (2.0 * braking_m))
    allowed_mps = approach_speed_mps(free_m - safety.stop_distance_m, age_s, deceleration_mps2)
    return _slowed(abs(twist.linear_mps), allowed_mps, free_m, where, config)


def _turning(twist: Twist, clearances: Clearances, age_s: float, config: FilterConfig) -> Finding:
    """Turning about a centre inside the circle that the footprint sweeps, by the speed of its farthest corner."""
    radius_m = swept_radius_m(config.safety.footprint)
    corner_mps = abs(twist.angular_radps) * radius_m
    if abs(twist.linear_mps) >= corner_mps:
        return PASSED
    deceleration_mps2 = config.limits.angular_deceleration_radps2 * radius_m
    gap_m = clearances.around_m - config.safety.stop_distance_m
    allowed_mps = approach_speed_mps(gap_m, age_s, deceleration_mps2)
    return _slowed(corner_mps, allowed_mps, clearances.around_m, "around", config)


def _slowed(speed_mps: float, allowed_mps: float, free_m: float, where: str, config: FilterConfig) -> Finding:
    """An allowed speed below standstill is none: otherwise the base would creep towards the stop distance for ever."""
    stop_m = config.safety.stop_distance_m
    if allowed_mps < config.standstill_mps:
        detail = f"{free_m:.2f} m free {where}, stop distance {stop_m:.2f} m"
        return stop(Cause.OBSTACLE, detail, f"more free way {where}, or a command away from the obstacle")
    if allowed_mps >= speed_mps:
        return PASSED
    detail = f"{free_m:.2f} m free {where}: at most {allowed_mps:.2f} m/s"
    return Finding(Action.SLOW, Cause.OBSTACLE_NEAR, detail, f"more free way {where}", allowed_mps / speed_mps)


def _is_fresh(age_s: float | None, timeout_s: float) -> bool:
    return age_s is not None and age_s <= timeout_s


def _silence(topic: str, age_s: float | None, timeout_s: float) -> str:
    if age_s is None:
        return f"nothing received on {topic} yet"
    return f"{topic} silent for {age_s:.2f} s (timeout {timeout_s:.2f} s)"
