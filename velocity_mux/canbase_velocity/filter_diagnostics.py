"""The entry of safety_filter in /diagnostics: from a decision and what it was made of. No node, no clock.

An obstacle and a pressed emergency stop are the filter at work: a warning. A sensor that is required and does not
report is an error, also while nothing is ordered.
"""

from __future__ import annotations

import math

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from canbase_config.diagnostics import SAFETY_FILTER, entry_name
from canbase_runtime.stop_cause import SCAN_LOST, StopCause
from canbase_velocity.decision import Action, Decision
from canbase_velocity.estop import EstopState
from canbase_velocity.safety_filter import Inputs, ScanState

_ERRORS = SCAN_LOST | {
    StopCause.SCAN_BLIND,
    StopCause.ESTOP_STALE,
    StopCause.COMMAND_STALE,
    StopCause.COMMAND_INVALID,
    StopCause.UNKNOWN,
}
"""Something that is needed does not work."""
_WARNINGS = frozenset({StopCause.ESTOP, StopCause.OBSTACLE, StopCause.SHUTDOWN})
"""The base is stopped, and that is right."""


def diagnostics(
    decision: Decision, inputs: Inputs, robot: str, lease_errors: int, new_lease_errors: int, stamp: Time
) -> DiagnosticArray:
    """One entry. `lease_errors`: leases that could not be delivered since start; `new_…`: since the last report."""
    level, sentence = _verdict(decision, inputs)
    if new_lease_errors:
        level = max(level, DiagnosticStatus.WARN)
        sentence += f" Since the last report: {new_lease_errors} more leases that the watchdog did not get."
    values = {
        "action": decision.action.name.lower(),
        "cause": decision.cause.value,
        "clears on": decision.clears_on,
        "emergency stop": inputs.estop.value,
        "ordered [m/s]": f"{decision.twist.linear_mps:.6g}",
        "ordered [rad/s]": f"{decision.twist.angular_radps:.6g}",
        "leases not delivered": str(lease_errors),
        "speed limit set by": inputs.speed_limit_by or "nobody",
        **{f"scanner {scan.topic}": _scanner(scan) for scan in inputs.scans},
    }
    status = DiagnosticStatus(
        level=level,
        name=entry_name(robot, SAFETY_FILTER),
        message=sentence,
        hardware_id=robot,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )
    message = DiagnosticArray(status=[status])
    message.header.stamp = stamp
    return message


def _verdict(decision: Decision, inputs: Inputs) -> tuple[bytes, str]:
    level, sentence = _decided(decision)
    holds = inputs.estop is not EstopState.FREE
    if level == DiagnosticStatus.OK and holds:
        level, sentence = DiagnosticStatus.WARN, f"{sentence} The emergency stop is {inputs.estop.value}."
    if dead := [scan for scan in inputs.scans if scan.required and not scan.is_fresh]:
        named = "; ".join(f"{scan.topic}: {_scanner(scan)}" for scan in dead)
        return DiagnosticStatus.ERROR, f"{sentence} Required scanners do not report: {named}."
    if problems := [why for why in (inputs.estop_crowd, inputs.estop_unarmed) if why]:
        return max(level, DiagnosticStatus.WARN), f"{sentence} {'; '.join(problems)}."
    return level, sentence


def _decided(decision: Decision) -> tuple[bytes, str]:
    if decision.cause in _ERRORS:
        level = DiagnosticStatus.ERROR
    else:
        level = DiagnosticStatus.WARN if decision.cause in _WARNINGS else DiagnosticStatus.OK
    if decision.action is Action.PASS:
        return level, "Commands pass."
    detail = f": {decision.detail.rstrip('.')}" if decision.detail else ""
    clears = f" It ends with: {decision.clears_on}." if decision.clears_on else ""
    return level, f"{_DONE[decision.action]} ({decision.cause.value}){detail}.{clears}"


_DONE = {
    Action.LIMIT: "Commands are limited",
    Action.SLOW: "Commands are slowed",
    Action.STOP: "Stopped",
}


def _scanner(scan: ScanState) -> str:
    """One scanner in words; `not scan.is_fresh` without a problem is age alone."""
    age = "no scan yet" if scan.age_s == math.inf else f"last scan {scan.age_s:.2f} s ago"
    usable = "" if scan.usable_share is None else f", {scan.usable_share:.0%} of its beams usable"
    why = scan.problem or scan.why_dropped
    return f"{age}{usable}, {scan.dropped} dropped{f' ({why})' if why else ''}"
