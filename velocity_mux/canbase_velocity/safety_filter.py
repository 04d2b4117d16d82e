"""How fast the base may go: the last decision about a command. Time comes in as an argument; ROS is in filter_node.py.

Rules, in the order of their precedence:
1. Emergency stop pressed: stop, with the emergency deceleration. Required without a recent message counts as pressed.
   Its memory is estop.py.
2. No recent command, or one with NaN or infinity: stop.
3. A required scan not recent, frozen, not usable, or of a scanner whose place is unknown: stop.
4. Faster than the limits, the ceiling, a speed limit of run time, the speed of a robot that is not commissioned, a
   limit zone that is not seen to be empty, or the speed for where scanners do not cover the path: slower, on the same
   curve. See coverage.py.
5. Growing faster than the ceiling: slower. What falls is never held up.
6. Obstacle where the footprint will be: slower, on the same curve, so that the base can stop before the stop distance;
   there it stops. Driving away from an obstacle is free. See obstacle.py.
Zero is always allowed: nothing here makes a command faster or turns it around.
Before all rules, whether the base has to brake hard: with the emergency deceleration, to standstill. That follows from
its motion and from what is in its way, never from the command: an order that is already lower, or zero, for whatever
reason, keeps it.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, replace
from typing import Final

from canbase_config.commissioned import uncommissioned, uncommissioned_mps
from canbase_config.robot import Limits, Robot
from canbase_config.safety import Ceiling, Safety
from canbase_runtime.stop_cause import StopCause
from canbase_velocity import coverage, obstacle
from canbase_velocity.coverage import Gap, Why
from canbase_velocity.decision import PASSED, Action, Decision, Finding, stop
from canbase_velocity.estop import EstopState
from canbase_velocity.obstacle import Geometry, Sight
from canbase_velocity.ramp import Moving
from canbase_velocity.speed_limit import NO_LIMIT, SpeedLimit
from canbase_velocity.sweep import fastest_mps, first_touch
from canbase_velocity.twist import ZERO, Twist

SHUTDOWN = Decision(Action.STOP, StopCause.SHUTDOWN, "the safety filter is being shut down", "its next start", ZERO)


CURES: Final = {
    StopCause.SCAN_STALE: "scans that can be used",
    StopCause.SCAN_UNPLACED: "a static transform of the scanner",
    StopCause.SCAN_INVALID: "scans that can be used; see the scanner and its ROS driver",
    StopCause.SCAN_FROZEN: "scans that change; start the scanner or its ROS driver again",
}
"""What ends a stop for a scanner whose scans come, and cannot be used."""


@dataclass(frozen=True, slots=True)
class FilterConfig:
    """What the filter needs of robot.yaml."""

    limits: Limits
    safety: Safety
    standstill_mps: float
    geometry: Geometry
    uncommissioned: str = ""
    """Why the robot counts as not commissioned; empty: it is."""

    @staticmethod
    def of(robot: Robot) -> FilterConfig:
        """The filter's part of `robot`."""
        geometry = Geometry.of(robot.limits, robot.safety, robot.rates.command_hz)
        standstill_mps, why = robot.base.standstill_mps, uncommissioned(robot)
        safety = robot.safety.model_copy(update={"uncommissioned_mps": uncommissioned_mps(robot)})
        return FilterConfig(robot.limits, safety, standstill_mps, geometry, why)


@dataclass(frozen=True, slots=True)
class ScanState:
    """The state of one scanner. `age_s`: of its last scan with readings [s]; infinite: none yet."""

    topic: str
    required: bool
    timeout_s: float
    age_s: float
    problem: str = ""
    """Why its scans cannot be used, such as a frame that tf_static does not know; empty: they can."""
    cause: StopCause = StopCause.SCAN_STALE
    """What `problem` is, or what its last dropped scan was."""
    dropped: int = 0
    """Scans that could not be used."""
    why_dropped: str = ""
    """Why the last one was; empty when one that can be used came since."""
    usable_share: float | None = None
    """Of the beams of its last usable scan that have a reading, 0 to 1; None: none yet."""

    knows_age: bool = True
    """False: its stamps are of another clock. What it shows as free may have been so long ago."""

    @property
    def is_fresh(self) -> bool:
        """Its last scan counts."""
        return not self.problem and self.age_s <= self.timeout_s


@dataclass(frozen=True, slots=True)
class Inputs:
    """What is known when a decision is made. Ages are of local receive times [s]; infinite: nothing received yet."""

    command: Twist
    command_age_s: float
    scans: tuple[ScanState, ...]
    sight: Sight
    """What the fresh ones of the scans show."""
    moving: Moving
    """How the base is expected to move, by earlier orders."""
    previous: Twist
    """The last order."""
    since_s: float
    """How long ago that was [s]."""
    estop: EstopState
    pressed: bool
    """The state in the last message of the emergency stop."""
    estop_age_s: float
    estop_before: str = ""
    """Why the emergency stop holds since the start; empty: it does not."""
    estop_crowd: str = ""
    """Why a release of the emergency stop cannot be seen; empty: it can."""
    estop_unarmed: str = ""
    """A press would not outlive this process: why; empty: it would."""
    braking_hard: bool = False
    """The last order was to brake hard. It holds until the base is expected to be at standstill."""
    speed_limit: SpeedLimit = NO_LIMIT
    """Set while the robot runs."""
    speed_limit_by: str = ""
    """Who has set it."""


def decide(inputs: Inputs, config: FilterConfig) -> Decision:
    """The order for these inputs: the most severe finding wins, of two alike the one of the earlier rule."""
    emergency = brakes_hard(inputs, config)
    stopped = _estop(inputs, config) or _command(inputs, config) or missing_scan(inputs)
    if stopped is not None:
        return Decision(stopped.action, stopped.cause, stopped.detail, stopped.clears_on, ZERO, emergency)
    if inputs.command.is_zero:
        return Decision(Action.PASS, StopCause.NONE, "", "", ZERO, emergency)
    slowest = min(_slower(inputs, config), key=lambda finding: finding.factor)
    most = SpeedLimit(config.limits.linear_mps, config.limits.angular_radps).lower_of(inputs.speed_limit)
    limited = _within(inputs.command.scaled(slowest.factor), most)
    grown, growth = _growth(limited, inputs, config.safety.ceiling)
    judged = _too_late(inputs, config) if emergency else _obstacle(grown, inputs, config)
    worst = max(slowest, growth, judged, key=lambda finding: finding.action)
    twist = ZERO if worst.action is Action.STOP else grown.scaled(judged.factor)
    return Decision(worst.action, worst.cause, worst.detail, worst.clears_on, twist, emergency)


def brakes_hard(inputs: Inputs, config: FilterConfig) -> bool:
    """Whether the ordinary ramp is too late. Decided once for every order: the command has no part in it."""
    if inputs.estop is EstopState.HELD:
        return True
    if inputs.moving.twist.is_zero:
        return False
    return inputs.braking_hard or obstacle.brakes_too_late(inputs.moving, inputs.sight, config.geometry)


def _estop(inputs: Inputs, config: FilterConfig) -> Finding | None:
    estop = config.safety.estop
    if inputs.estop is EstopState.AWAITS_RESET:
        before = f" ({inputs.estop_before})" if inputs.estop_before else ""
        return stop(StopCause.ESTOP, f"the emergency stop is released and waits for a reset{before}", "reset")
    if inputs.estop is EstopState.AWAITS_ZERO:
        detail = "the emergency stop is released, the command has not been zero since"
        return stop(StopCause.ESTOP, detail, "a zero command")
    if inputs.estop is EstopState.FREE:
        return stop(StopCause.ESTOP, inputs.estop_unarmed, "the record on disk") if inputs.estop_unarmed else None
    then = "a reset" if estop.latched else "a zero command"
    if not inputs.pressed and inputs.estop_crowd:
        return stop(StopCause.ESTOP, f"the emergency stop holds: {inputs.estop_crowd}", f"one publisher, then {then}")
    if not inputs.pressed:
        detail = _silence(estop.topic, inputs.estop_age_s, estop.timeout_s)
        return stop(StopCause.ESTOP_STALE, detail, f"false on {estop.topic}, then {then}")
    if inputs.estop_before and inputs.estop_age_s == math.inf:
        detail = f"the emergency stop was not seen released yet: {inputs.estop_before}"
        return stop(StopCause.ESTOP, detail, f"false on {estop.topic}, then {then}")
    return stop(StopCause.ESTOP, "the emergency stop is pressed", f"its release, then {then}")


def _command(inputs: Inputs, config: FilterConfig) -> Finding | None:
    timeout_s = config.safety.command_timeout_s
    if inputs.command_age_s > timeout_s:
        detail = _silence("cmd_vel_mux", inputs.command_age_s, timeout_s)
        return stop(StopCause.COMMAND_STALE, detail, "commands on cmd_vel_mux")
    if not inputs.command.is_finite:
        return stop(StopCause.COMMAND_INVALID, f"cmd_vel_mux carries {inputs.command}", "a finite command")
    return None


def missing_scan(inputs: Inputs) -> Finding | None:
    """A required scanner of which no scan counts; None: there is none. The command has no part in it."""
    bad = next((scan for scan in inputs.scans if scan.required and not scan.is_fresh), None)
    if bad is None:
        return None
    if bad.problem:
        return stop(bad.cause, f"{bad.topic}: {bad.problem}", CURES[bad.cause])
    if bad.why_dropped:
        detail = f"{bad.topic}: {bad.why_dropped} ({bad.dropped} scans dropped)"
        return stop(bad.cause, detail, CURES[bad.cause])
    return stop(StopCause.SCAN_STALE, _silence(bad.topic, bad.age_s, bad.timeout_s), f"scans on {bad.topic}")


def _slower(inputs: Inputs, config: FilterConfig) -> list[Finding]:
    """Rule 4, each with what it leaves of the command."""
    command, limits, ceiling = inputs.command, config.limits, config.safety.ceiling
    linear_mps = min(limits.linear_mps, ceiling.linear_mps) if ceiling else limits.linear_mps
    angular_radps = min(limits.angular_radps, ceiling.angular_radps) if ceiling else limits.angular_radps
    slower = [
        _limit(command, obstacle.speed_factor(command, linear_mps, angular_radps), StopCause.SPEED, "a slower command")
    ]
    slower.append(_lowered(inputs))
    if config.uncommissioned:
        slower.append(
            _corners(command, config.safety.uncommissioned_mps, config, StopCause.SPEED, *_commission(config))
        )
    for zone in config.safety.limit_zones:
        factor = coverage.zone_factor(command, zone, inputs.sight, config.geometry)
        slower.append(_limit(command, factor, StopCause.ZONE, "a limit zone that scanners cover, and nothing in it"))
    return slower + _unseen(inputs, config)


def _unseen(inputs: Inputs, config: FilterConfig) -> list[Finding]:
    """Of rule 4: where no scanner covers the path. Before any scan has arrived it does not apply."""
    command, sight, geometry = inputs.command, inputs.sight, config.geometry
    if all(scan.age_s == math.inf and not scan.dropped for scan in inputs.scans):
        return []
    unseen, slower = [], command
    if sight.fields:
        in_range = obstacle.range_share(command, sight, geometry)
        slower = command.scaled(in_range)
        if in_range < 1.0:
            unseen.append(_out_of_range(command, in_range, sight, config))
    gap = None if slower.is_zero else coverage.uncovered(slower, sight, geometry)
    return unseen if gap is None else [*unseen, _not_covered(gap, inputs, config)]


def _not_covered(gap: Gap, inputs: Inputs, config: FilterConfig) -> Finding:
    command, topics = inputs.command, ", ".join(gap.topics)
    if gap.why is Why.UNREAD:
        why = f"{gap.share:.0%} of the path are covered: {topics} looks at the rest, and has no readings there"
        return _blind(command, StopCause.SCAN_BLIND, why, "usable readings, or another direction", config)
    if not any(scan.is_fresh for scan in inputs.scans):
        why, cure = "no scanner has scans that count", "scans that can be used"
    elif gap.why is Why.LOST:
        why = f"{topics} looked where the command leads, and does not any more"
        cure = f"scans on {topics} as its first one was; after a change of the scanner: a new start of canbase"
    elif aged := [scan.topic for scan in inputs.scans if scan.is_fresh and not scan.knows_age]:
        why = f"how old the scans on {', '.join(aged)} are is unknown (same_clock false)"
        cure = "same_clock true, with clocks that agree"
    else:
        why, cure = "no scanner looks where the command leads", "a command to where a scanner looks"
    return _blind(command, StopCause.BLIND, why, cure, config)


def _out_of_range(command: Twist, share: float, sight: Sight, config: FilterConfig) -> Finding:
    """Faster than this the base would not stop within what its scanners see; slower than blind_mps it need not be."""
    allowed_mps = share * fastest_mps(config.geometry.box, command)
    ranges = ", ".join(f"{field.range_max_m:g} m" for field in sight.fields)
    why, cure = f"scanners with a range of {ranges} and no longer", "a slower command, or a scanner with a longer range"
    if allowed_mps < max(config.safety.blind_mps, config.standstill_mps):
        return _blind(command, StopCause.BLIND, why, cure, config)
    return replace(_limit(command, share, StopCause.BLIND, cure), detail=f"{why}: {_allowed(command, share)}")


def _limit(command: Twist, factor: float, cause: StopCause, clears_on: str) -> Finding:
    if factor >= 1.0:
        return PASSED
    return Finding(Action.LIMIT, cause, _allowed(command, factor), clears_on, factor)


def _allowed(command: Twist, factor: float) -> str:
    allowed = command.scaled(factor)
    return (
        f"{command.linear_mps:.2f} m/s, {command.angular_radps:.2f} rad/s ordered, "
        f"{allowed.linear_mps:.2f} m/s, {allowed.angular_radps:.2f} rad/s allowed"
    )


def _blind(command: Twist, cause: StopCause, why: str, clears_on: str, config: FilterConfig) -> Finding:
    blind_mps = config.safety.blind_mps
    if blind_mps < config.standstill_mps:
        return stop(cause, f"{why}, safety.blind_mps is {blind_mps:g}", clears_on)
    return _corners(command, blind_mps, config, cause, why, clears_on)


def _lowered(inputs: Inputs) -> Finding:
    limit, command = inputs.speed_limit, inputs.command
    limited = _limit(command, limit.share(command), StopCause.SPEED, "a slower command, or a higher speed_limit")
    return limited if limited is PASSED else replace(limited, detail=f"{inputs.speed_limit_by}: {limited.detail}")


def _commission(config: FilterConfig) -> tuple[str, str]:
    return f"{config.uncommissioned}, see safety.uncommissioned_mps", "canbase setup commission"


def _corners(command: Twist, mps: float, config: FilterConfig, cause: StopCause, why: str, clears_on: str) -> Finding:
    """No corner of the base faster than `mps`."""
    fastest = max(fastest_mps(config.geometry.box, command), sys.float_info.min)  # rounding makes 0 of the smallest
    limited = _limit(command, min(1.0, mps / fastest), cause, clears_on)
    return limited if limited is PASSED else replace(limited, detail=f"{why}: {limited.detail}")


def _within(twist: Twist, limits: SpeedLimit) -> Twist:
    """`twist`, without what the rounding of a scaled number left above the limits."""
    return Twist(
        math.copysign(min(abs(twist.linear_mps), limits.linear_mps), twist.linear_mps),
        math.copysign(min(abs(twist.angular_radps), limits.angular_radps), twist.angular_radps),
    )


def _growth(twist: Twist, inputs: Inputs, ceiling: Ceiling | None) -> tuple[Twist, Finding]:
    """Rule 5. From rest, and while both speeds grow in proportion, the curve is that of the command."""
    if ceiling is None:
        return twist, PASSED
    kept_mps = _kept(inputs.previous.linear_mps, twist.linear_mps)
    kept_radps = _kept(inputs.previous.angular_radps, twist.angular_radps)
    linear_mps, angular_radps = twist.linear_mps - kept_mps, twist.angular_radps - kept_radps
    share = obstacle.speed_factor(
        Twist(linear_mps, angular_radps),
        max(ceiling.acceleration_mps2 * inputs.since_s, math.ulp(0.0)),
        max(ceiling.angular_acceleration_radps2 * inputs.since_s, math.ulp(0.0)),
    )
    if share >= 1.0:
        return twist, PASSED
    grown = Twist(kept_mps + linear_mps * share, kept_radps + angular_radps * share)
    return grown, Finding(Action.LIMIT, StopCause.ACCELERATION, "speeding up", "the ordered speed", share)


def _kept(previous: float, asked: float) -> float:
    """How much of the last order is still in the new one: it can be passed at once."""
    return 0.0 if previous * asked <= 0.0 else math.copysign(min(abs(previous), abs(asked)), asked)


def _too_late(inputs: Inputs, config: FilterConfig) -> Finding:
    """Why the base brakes hard, to standstill."""
    geometry, where = config.geometry, _where(inputs.moving.twist)
    touch = first_touch(inputs.sight.points, geometry.box, inputs.moving.twist, geometry.stop_m / 2.0)
    distance = f": {touch.way_m:.2f} m free {where}" if math.isfinite(touch.way_m) else " to standstill"
    return stop(StopCause.OBSTACLE, f"brakes hard{distance}", "standstill, and more free way")


def _obstacle(twist: Twist, inputs: Inputs, config: FilterConfig) -> Finding:
    """An allowed speed below standstill is none: otherwise the base would creep towards the stop distance for ever."""
    if twist.is_zero:
        return PASSED
    geometry = config.geometry
    judgement = obstacle.judge(twist, inputs.moving, inputs.sight, geometry)
    free_m, where, speed_mps = judgement.touch.way_m, _where(twist), fastest_mps(geometry.box, twist)
    if judgement.share >= 1.0:
        return PASSED
    if judgement.share * speed_mps < config.standstill_mps:
        detail = f"{free_m:.2f} m free {where}, stop distance {geometry.stop_m:.2f} m"
        return stop(StopCause.OBSTACLE, detail, f"more free way {where}, or a command away from the obstacle")
    detail = f"{free_m:.2f} m free {where}: at most {judgement.share * speed_mps:.2f} m/s"
    return Finding(Action.SLOW, StopCause.OBSTACLE_NEAR, detail, f"more free way {where}", judgement.share)


def _where(twist: Twist) -> str:
    if twist.linear_mps == 0.0:
        return "around"
    way = "ahead" if twist.linear_mps > 0.0 else "behind"
    return way if twist.angular_radps == 0.0 else f"{way} on the arc"


def _silence(topic: str, age_s: float, timeout_s: float) -> str:
    if age_s == math.inf:
        return f"nothing received on {topic} yet"
    return f"no message on {topic} for {age_s:.2f} s (timeout {timeout_s:.2f} s)"
