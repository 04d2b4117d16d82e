"""When the watchdog trips: an ordered table of checks on bus and leases. What it does then: ladder.py.

Each check names when it trips, and when its cause still stands, which keeps a reset away.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog.motion_evidence import BOTH_WAYS
from canbase_watchdog.power_and_motion import commanded, in_motion, moving
from canbase_watchdog.trip_cause import FINE, TripCause, Verdict
from canbase_watchdog.view import NEVER, Axis, BusView, Node, View

SIGN_S = 1.0
"""A sign of another master, or of a drive that restarted, counts for this long [s]."""


def _lease_is_lost(view: View, config: WatchdogConfig, now_s: float) -> bool:
    return now_s >= max(view.lease_at, view.started_at) + config.lease_timeout_s


def lease_lost(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    """The lease has run out, and a wheel moves or is ordered to."""
    axis = in_motion(view, config) if _lease_is_lost(view, config, now_s) else None
    if axis is None:
        return FINE
    detail = (
        f"no valid lease for {now_s - view.lease_at:.3f} s (allowed {config.lease_timeout_s:.3f} s) while "
        f"{axis.drive.joint} turns at {axis.velocity_mps:.3f} m/s, ordered {axis.target_mps:.3f} m/s"
    )
    return Verdict(TripCause.LEASE_LOST, 0, detail)


def _driver_is_silent(view: View, since: float, config: WatchdogConfig, now_s: float) -> bool:
    """Its heartbeat or its SYNC is missing: both come from its control loop itself."""
    return now_s >= max(min(view.bus.driver_at, view.bus.sync_at), since) + config.drive_heartbeat_s


def _driver_silent(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    if not _driver_is_silent(view, NEVER, config, now_s):
        return FINE
    for axis in view.axes:
        since = max(axis.enabled_since, view.started_at)
        if (axis.enabled or moving(axis, config)) and _driver_is_silent(view, since, config, now_s):
            bus = view.bus
            detail = (
                f"driver's heartbeat is {now_s - bus.driver_at:.3f} s old, its SYNC {now_s - bus.sync_at:.3f} s "
                f"(allowed {config.drive_heartbeat_s:.3f} s) while {axis.drive.joint} has power"
            )
            return Verdict(TripCause.DRIVER_SILENT, 0, detail)
    return FINE


def _driver_still_silent(view: View, node_id: int, config: WatchdogConfig, now_s: float) -> bool:
    return now_s >= view.bus.driver_at + config.drive_heartbeat_s


def _unfed(axis: Axis, view: View, config: WatchdogConfig, now_s: float) -> bool:
    """SYNCs go on and its TPDOs do not answer them."""
    missed = now_s >= max(axis.fed_at, axis.enabled_since, view.bus.sync_since) + config.feedback_timeout_s
    return missed and now_s < view.bus.sync_at + config.feedback_timeout_s


def _heartbeat_missing(node: Node, axis: Axis, config: WatchdogConfig, now_s: float) -> bool:
    return now_s >= max(node.heartbeat_at, axis.enabled_since) + config.drive_heartbeat_s


def _has_restarted(view: View, node_id: int, config: WatchdogConfig, now_s: float) -> bool:
    return now_s < view.node(node_id).boot_up_at + SIGN_S


def _drive_restarted(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    """A drive that restarts has no power: this one reported that it has. Or there are two drives with its node id."""
    for axis in view.axes:
        node_id = axis.drive.node_id
        if _has_restarted(view, node_id, config, now_s) and view.enabled:
            detail = (
                f"node {node_id} ({axis.drive.joint}) sends a boot-up while it is enabled: it has restarted (supply?), "
                "or two drives have this node id"
            )
            return Verdict(TripCause.DRIVE_RESTARTED, node_id, detail)
    return FINE


def _drive_silent(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    for axis in view.axes:
        if not axis.enabled:
            continue
        node = view.node(axis.drive.node_id)
        if _unfed(axis, view, config, now_s) or _heartbeat_missing(node, axis, config, now_s):
            detail = (
                f"{axis.drive.joint} is enabled, its feedback is {now_s - axis.fed_at:.3f} s old (allowed "
                f"{config.feedback_timeout_s:.3f} s), its heartbeat {now_s - node.heartbeat_at:.3f} s "
                f"(allowed {config.drive_heartbeat_s:.3f} s)"
            )
            return Verdict(TripCause.DRIVE_SILENT, node.node_id, detail)
    return FINE


def _allowed(axis: Axis, view: View, config: WatchdogConfig) -> tuple[float, float]:
    """Least and greatest target of a wheel [m/s] by the leases, without tolerance."""
    low, high = view.bounds.wheel(config.track_m / 2.0 if axis.drive.side == "right" else -config.track_m / 2.0)
    return max(low, -config.max_wheel_mps), min(high, config.max_wheel_mps)


def _target_outside(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    """Not debounced: a setpoint is a number that the driver computed, without noise."""
    for axis in view.axes:
        if not (axis.enabled or axis.asks_for_power):
            continue
        low, high = _allowed(axis, view, config)
        share = config.target_tolerance_share * max(-low, high)
        slack = config.target_tolerance_mps + abs(axis.drive.mps_per_bit) + share
        if not low - slack <= axis.target_mps <= high + slack:
            detail = (
                f"{axis.drive.joint} is ordered {axis.target_mps:.3f} m/s, "
                f"the leases allow {low:.3f} to {high:.3f} m/s (tolerance {slack:.3f} m/s)"
            )
            return Verdict(TripCause.TARGET_OUTSIDE, axis.drive.node_id, detail)
    for sign in OF_THE_SETPOINTS:
        detail = sign.detail(view)
        if detail:
            return Verdict(TripCause.TARGET_OUTSIDE, 0, detail)
    return FINE


@dataclass(frozen=True, slots=True)
class BaseSign:
    """One thing that is wrong with the setpoints of all wheels together. `detail`: in words; empty: it is not so."""

    name: str
    detail: Callable[[View], str]


OF_THE_SETPOINTS = (
    BaseSign("ramp_to_zero", lambda view: view.ramp_to_zero),
    BaseSign(
        "setpoint_at_rest",
        lambda view: f"{view.setpoint_at_rest}, while the leases allow no motion" if view.setpoint_at_rest else "",
    ),
    BaseSign("left_right", lambda view: f"left and right wheels are ordered {view.skew}" if view.skew else ""),
)
AGAINST = "; by 606Ch it turns the other way: see `direction` in robot.yaml, motor phases, encoder"


def _motion_outside(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    for axis in view.axes:
        feedback = axis.feedback
        if axis.powered and feedback.outside_samples >= config.feedback_samples:
            detail = (
                f"{axis.drive.joint} turns at {axis.velocity_mps:.3f} m/s, "
                f"its setpoints allow {feedback.low_mps:.3f} to {feedback.high_mps:.3f} m/s "
                f"(watchdog.drive_lag_s {config.drive_lag_s:g} s)"
                + (AGAINST if axis.velocity_mps * axis.setpoint_mps < 0.0 else "")
            )
            return Verdict(TripCause.MOTION_OUTSIDE, axis.drive.node_id, detail)
    return FINE


def _overspeed(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    for axis in view.axes:
        if axis.powered and axis.feedback.overspeed_samples >= config.feedback_samples:
            limit_mps = config.overspeed_factor * config.max_wheel_mps
            detail = f"{axis.drive.joint} turns at {axis.velocity_mps:.3f} m/s (allowed {limit_mps:.3f} m/s)"
            return Verdict(TripCause.OVERSPEED, axis.drive.node_id, detail)
    return FINE


@dataclass(frozen=True, slots=True)
class WheelSign:
    """One thing that is wrong with what a wheel shows. `detail`: in words; empty: it is not so."""

    name: str
    detail: Callable[[Axis, WatchdogConfig], str]


def _first(signs: tuple[WheelSign, ...], axis: Axis, config: WatchdogConfig) -> str:
    for sign in signs:
        detail = sign.detail(axis, config)
        if detail:
            return f"{axis.drive.joint} {detail}"
    return ""


def _feedback_implausible(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    for axis in view.axes:
        detail = _first(IMPLAUSIBLE, axis, config) if axis.powered else ""
        if detail:
            return Verdict(TripCause.FEEDBACK_IMPLAUSIBLE, axis.drive.node_id, detail)
    return FINE


def _halted(axis: Axis, config: WatchdogConfig) -> str:
    if axis.evidence.halted_samples < config.feedback_samples:
        return ""
    return (
        f"reports standstill at once, and no motion since, with {axis.evidence.setpoint_mps:.3f} m/s ordered: "
        f"no wheel stops so fast (watchdog.jolt_mps2 {config.jolt_mps2:g} m/s²)"
    )


def _velocity_jumps(axis: Axis, config: WatchdogConfig) -> str:
    if axis.evidence.velocity_jumps < config.jolts:
        return ""
    return (
        f"reports {axis.velocity_mps:.3f} m/s, and {axis.evidence.velocity_jumps} changes of speed that no wheel can "
        f"do (watchdog.jolt_mps2 {config.jolt_mps2:g} m/s²)"
    )


def _ghost(axis: Axis, config: WatchdogConfig) -> str:
    ghost = axis.evidence.ghost
    if not ghost.is_one:
        return ""
    return (
        f"reports {axis.velocity_mps:.4f} m/s, {ghost.travel_m:.4f} m in all, and its encoder (6064h) does not move: "
        "one of them is wrong; see encoder, 606Ch"
    )


def _drift(axis: Axis, config: WatchdogConfig) -> str:
    if axis.feedback.implausible_samples < config.feedback_samples:
        return ""
    return (
        f"reports {axis.velocity_mps:.3f} m/s, and its encoder contradicts it: "
        f"{axis.feedback.drift_m:.3f} m apart (allowed {config.travel_tolerance_m:.3f} m)"
    )


IMPLAUSIBLE = (
    WheelSign("halted", _halted),
    WheelSign("velocity_jumps", _velocity_jumps),
    WheelSign("ghost", _ghost),
    WheelSign("drift", _drift),
)
"""What is wrong with the sensor of a wheel with power."""


def _motion_missing(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    for axis in view.axes:
        detail = _first(MISSING, axis, config) if axis.enabled else ""
        if detail:
            return Verdict(TripCause.MOTION_MISSING, axis.drive.node_id, detail)
    return FINE


MISSING_LOOK = "see encoder, motor, wheel, or a brake that opens late (watchdog.motion_missing_s)"


def _unseen(axis: Axis, config: WatchdogConfig) -> str:
    evidence = axis.evidence
    if not evidence.unseen:
        return ""
    return (
        f"is ordered {evidence.setpoint_mps:.3f} m/s, and its encoder has not moved for "
        f"{max(evidence.unseen_s, evidence.both_s):.3f} s and {evidence.both_m:.3f} m of its orders (allowed "
        f"{config.motion_missing_s:.3f} s and {config.motion_missing_m:.3f} m, to and fro {BOTH_WAYS:g} times that "
        f"way: watchdog.motion_missing_m); it reports "
        f"{axis.velocity_mps:.3f} m/s: {MISSING_LOOK}"
    )


def _vain(axis: Axis, config: WatchdogConfig) -> str:
    if axis.torque.vain_s < config.motion_missing_s:
        return ""
    return (
        f"is pushed with {_torque(axis)} and shows no motion for {axis.torque.vain_s:.3f} s (allowed "
        f"{config.motion_missing_s:.3f} s), ordered {axis.evidence.setpoint_mps:.3f} m/s: "
        f"{MISSING_LOOK}"
    )


def _strained(axis: Axis, config: WatchdogConfig) -> str:
    evidence = axis.evidence
    if evidence.strained_s < config.motion_missing_s:
        return ""
    return (
        f"is pushed with {_torque(axis)} and gets no faster than {axis.velocity_mps:.3f} m/s for "
        f"{evidence.strained_s:.3f} s (allowed {config.motion_missing_s:.3f} s), ordered "
        f"{evidence.setpoint_mps:.3f} m/s: its encoder may lose counts, or its load is too heavy"
    )


def _behind(axis: Axis, config: WatchdogConfig) -> str:
    evidence = axis.evidence
    if evidence.behind_s < config.slow_wheel_s:
        return ""
    return (
        f"turns at {axis.velocity_mps:.3f} m/s, its setpoints order {evidence.ordered_mps:.3f} m/s for "
        f"{evidence.behind_s:.3f} s (allowed {config.slow_wheel_s:.3f} s; slow ramps: watchdog.slowest_ramp_mps2)"
    )


MISSING = (
    WheelSign("unseen", _unseen),
    WheelSign("vain", _vain),
    WheelSign("strained", _strained),
    WheelSign("behind", _behind),
)
"""What of the ordered motion an enabled wheel does not show."""


def _torque(axis: Axis) -> str:
    share = axis.torque.share
    return "a torque that the drive does not report" if share is None else f"{share:.0%} of the rated torque"


def _power_at_stand(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    for axis in view.axes:
        if axis.powered and axis.torque.overdue_s >= config.stand_answer_s:
            detail = (
                f"{axis.drive.joint} is ordered {axis.setpoint_mps:.3f} m/s, reports {axis.velocity_mps:.3f} m/s and "
                f"has been held with {_torque(axis)} for {axis.torque.overdue_s:.3f} s (allowed "
                f"{config.stand_answer_s:.3f} s) without release of the wheel: its encoder may be dead "
                "(watchdog.stand_proof, watchdog.stand_answer_s)"
            )
            return Verdict(TripCause.POWER_AT_STAND, axis.drive.node_id, detail)
    return FINE


def _twist_outside(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    if not view.twist:
        return FINE
    return Verdict(TripCause.TWIST_OUTSIDE, 0, f"the base does not move as ordered: {view.twist}")


def _cycles(config: WatchdogConfig) -> float:
    """This many SYNCs take as long as feedback may be missing."""
    return config.feedback_timeout_s * config.control_hz


def _setpoint_missing(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    for axis in view.axes:
        if axis.enabled and axis.missed_setpoints >= _cycles(config):
            detail = (
                f"{axis.drive.joint} is enabled, and SYNCs come without setpoints for it: "
                f"the last one is {now_s - axis.setpoint_at:.3f} s old (allowed {config.feedback_timeout_s:.3f} s)"
            )
            return Verdict(TripCause.SETPOINT_MISSING, axis.drive.node_id, detail)
    return FINE


_TWO_DRIVES = (
    "two drives answer as node {0}, that of {1}: give each its own id (canbase bus scan names them). If there is one "
    "alone, a gateway, a bridge or a second interface sends its frames again: take it out"
)
_COPIED_ANSWERS = (
    "node {0}, that of {1}, answers twice, with the same data within 2 ms: take out the gateway, the bridge "
    "or the second interface that sends its frames again. If there is none, two drives have this id (canbase bus scan "
    "names them): give each its own"
)


def _answered_twice(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    for axis in view.axes:
        if axis.enabled and axis.double_answers >= _cycles(config):
            template = _COPIED_ANSWERS if now_s - axis.copied_at <= config.feedback_timeout_s else _TWO_DRIVES
            detail = template.format(axis.drive.node_id, axis.drive.joint)
            return Verdict(TripCause.ANSWERED_TWICE, axis.drive.node_id, detail)
    return FINE


def _drive_down(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    """The driver has `feedback_timeout_s` to stop the others by itself. Fault or off: the base turns all the same."""
    down = [axis for axis in view.axes if not axis.enabled]
    if not down:
        return FINE
    driven = [axis for axis in view.axes if axis.enabled and (moving(axis, config) or commanded(axis, config))]
    for axis in down:
        for other in driven:
            since = max(axis.disabled_since, other.enabled_since)
            if now_s >= since + config.feedback_timeout_s:
                state = "unknown" if axis.state is None else axis.state.name.lower().replace("_", " ")
                detail = (
                    f"{axis.drive.joint} is not enabled (state: {state}) while {other.drive.joint} turns at "
                    f"{other.velocity_mps:.3f} m/s, ordered {other.target_mps:.3f} m/s"
                )
                return Verdict(TripCause.DRIVE_DOWN, axis.drive.node_id, detail)
    return FINE


def _foreign_is_near(view: View, node_id: int, config: WatchdogConfig, now_s: float) -> bool:
    return view.bus.foreign is not None and now_s < view.bus.foreign.at + SIGN_S


def _foreign_master(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    sign = view.bus.foreign
    if sign is None or now_s >= sign.at + SIGN_S or not view.enabled:
        return FINE
    return Verdict(TripCause.FOREIGN_MASTER, sign.node_id, _OF_A_SIGN[sign.copied].format(sign.detail))


_OF_A_SIGN = {
    None: "another master or process commands the drives: {}",
    False: (
        "another master is on the bus, or frames are sent again: {}. Our frames have no copies within 2 ms: find the "
        "other master (canbase bus scan) and stop it. If there is none, take out the gateway, the bridge or the second "
        "interface that sends frames again"
    ),
    True: (
        "frames come twice, or another master is on the bus: {}. SYNCs and other frames of ours come again "
        "within 2 ms: take out the gateway, the bridge or the second interface that sends frames again (candump shows "
        "them twice). If there is none, stop the other master"
    ),
}
"""By Sign.copied: what it may be, the likelier first, and what to do about each."""


def _bus_is_failed(view: View, node_id: int, config: WatchdogConfig, now_s: float) -> bool:
    return now_s >= view.bus_failed_since + config.bus_failed_s


def _bus_failed(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    if not _bus_is_failed(view, 0, config, now_s) or not view.enabled:
        return FINE
    detail = f"the bus takes no frames for {now_s - view.bus_failed_since:.3f} s (allowed {config.bus_failed_s:.3f} s)"
    return Verdict(TripCause.BUS_FAILED, 0, detail)


def _loop_late(view: View, config: WatchdogConfig, now_s: float) -> Verdict:
    if view.tick_gap_s <= config.loop_late_s or not view.enabled:
        return FINE
    detail = f"own loop did not run for {view.tick_gap_s:.3f} s (allowed {config.loop_late_s:.3f} s)"
    return Verdict(TripCause.LOOP_LATE, 0, detail)


def _over(view: View, node_id: int, config: WatchdogConfig, now_s: float) -> bool:
    """Nothing is left of the cause when the wheels stand and nothing is ordered, which each reset needs anyway."""
    return False


@dataclass(frozen=True, slots=True)
class Check:
    """One row: `trips` finds the cause; `stands`: for the node that it was about, whether it still holds.

    `clears_on`: what a reset needs besides standing wheels and no ordered velocity, in words.
    """

    cause: TripCause
    trips: Callable[[View, WatchdogConfig, float], Verdict]
    stands: Callable[[View, int, WatchdogConfig, float], bool]
    clears_on: str
    by_bus: bool = False
    """It looks at the bus alone: what is fine there stays so until a frame comes."""


CHECKS = (
    Check(TripCause.BUS_FAILED, _bus_failed, _bus_is_failed, "the bus takes frames again"),
    Check(TripCause.LOOP_LATE, _loop_late, _over, "nothing else"),
    Check(TripCause.FOREIGN_MASTER, _foreign_master, _foreign_is_near, "no such frame has come for 1 s"),
    Check(
        TripCause.LEASE_LOST,
        lease_lost,
        lambda view, node_id, config, now_s: _lease_is_lost(view, config, now_s),
        "leases arrive",
    ),
    Check(TripCause.DRIVER_SILENT, _driver_silent, _driver_still_silent, "the driver's heartbeat is back"),
    Check(
        TripCause.DRIVE_RESTARTED,
        _drive_restarted,
        _has_restarted,
        "its last boot-up is 1 s ago; see supply and node ids",
    ),
    Check(
        TripCause.DRIVE_SILENT,
        _drive_silent,
        lambda view, node_id, config, now_s: now_s >= view.node(node_id).last_frame_at + config.drive_heartbeat_s,
        "the drive answers again",
    ),
    Check(
        TripCause.ANSWERED_TWICE,
        _answered_twice,
        _over,
        "nothing else; end what answers twice first",
        by_bus=True,
    ),
    Check(TripCause.SETPOINT_MISSING, _setpoint_missing, _over, "nothing else", by_bus=True),
    Check(TripCause.DRIVE_DOWN, _drive_down, _over, "nothing else; the driver resets the drive's fault after it"),
    Check(
        TripCause.FEEDBACK_IMPLAUSIBLE,
        _feedback_implausible,
        _over,
        "nothing else; check the encoder, and whether velocity_unit and counts_per_motor_rev are those of the drive",
        by_bus=True,
    ),
    Check(
        TripCause.MOTION_MISSING,
        _motion_missing,
        _over,
        "nothing else; look at encoder, motor and wheel first",
        by_bus=True,
    ),
    Check(
        TripCause.POWER_AT_STAND,
        _power_at_stand,
        _over,
        "nothing else; look at the encoder and the driver first",
        by_bus=True,
    ),
    Check(TripCause.TARGET_OUTSIDE, _target_outside, _over, "nothing else"),
    Check(TripCause.OVERSPEED, _overspeed, _over, "nothing else", by_bus=True),
    Check(TripCause.MOTION_OUTSIDE, _motion_outside, _over, "nothing else", by_bus=True),
    Check(TripCause.TWIST_OUTSIDE, _twist_outside, _over, "nothing else"),
)
"""The first row that trips is the cause: where one failure shows in several rows, the one that explains it most comes
first. A cause without a row does not stand: nothing of it is left to see."""


def decide(view: View, config: WatchdogConfig, now_s: float, fine: BusView | None = None) -> Verdict:
    """The first cause to trip in what is seen at the monotonic time `now_s` [s], or FINE. `fine`: a bus that was."""
    known = view.bus is fine
    for check in CHECKS:
        if known and check.by_bus:
            continue
        verdict = check.trips(view, config, now_s)
        if verdict.cause is not TripCause.NONE:
            return verdict
    return FINE


def stands(verdict: Verdict, view: View, config: WatchdogConfig, now_s: float) -> bool:
    """True while the cause of a trip is still there at the monotonic time `now_s` [s]."""
    rows = (check for check in CHECKS if check.cause is verdict.cause)
    return any(check.stands(view, verdict.node_id, config, now_s) for check in rows)


def clears_on(verdict: Verdict) -> str:
    """What a reset needs besides standing wheels and no ordered velocity."""
    return next((check.clears_on for check in CHECKS if check.cause is verdict.cause), "nothing else")


def next_expiry(lease_at: float, driver_at: float, config: WatchdogConfig, now_s: float) -> float:
    """When the lease or the driver times out next if nothing comes [s]: a tick just then stops without delay."""
    ends = (lease_at + config.lease_timeout_s, driver_at + config.drive_heartbeat_s)
    return min((end for end in ends if end > now_s), default=now_s + config.lease_timeout_s)
