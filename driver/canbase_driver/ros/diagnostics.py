"""From a `DriverSnapshot` to /diagnostics: levels, sentences and values. No node or clock.

One entry each for the loop, the bus, the watchdog and every drive.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from canbase_driver.causes import Cause
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.cia402 import DriveState
from canbase_driver.snapshot import DriverSnapshot, DriveSnapshot
from canbase_driver.supervision.bus_health import ControllerState
from canbase_runtime.driver_state import DriverState
from canbase_runtime.watchdog_view import WatchdogView

_LOOP_COUNTERS = ("commands_refused", "overruns", "travel_losses")
_BUS_COUNTERS = ("frames_dropped", "send_errors", "receive_errors", "error_frames", "bus_failures")
_WATCHDOG_COUNTERS = ("trips", "leases_refused", "frames_dropped", "bus_errors")
_TRANSIENT = {DriverState.BOOTING, DriverState.DISARMED, DriverState.ENABLING, DriverState.STOPPING}
_FAULTS = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)
_RUNGS = ("none", "quick stop", "NMT pre-operational", "disable voltage", "heartbeat withheld", "NMT reset node")
_PAUSE_WARNING_S = 0.05
"""A pause of the watchdog's loop that is worth a look: ten of its turns."""


def diagnostics_message(
    snapshot: DriverSnapshot, stamp: Time, *, robot: str = "robot", previous: DriverSnapshot | None = None
) -> DiagnosticArray:
    """One entry for the loop, one for the bus, one for the watchdog, one per drive; `robot` makes their names unique.

    `previous` is the snapshot of the message before: a counter that grew since then is a warning, an old one is not.
    """
    message = DiagnosticArray()
    message.header.stamp = stamp
    message.status = [
        _loop_entry(snapshot, previous or snapshot, robot),
        _bus_entry(snapshot, previous or snapshot, robot),
        _watchdog_entry(snapshot, previous or snapshot, robot),
        *(_drive_entry(drive, snapshot.state, robot) for drive in snapshot.drives),
    ]
    return message


def unguarded(snapshot: DriverSnapshot) -> tuple[str, ...]:
    """A sentence for each drive that is booted and would not stop by itself when the computer or the cable fails."""
    if snapshot.state in (DriverState.OFFLINE, DriverState.BOOTING):
        return ()
    return tuple(
        f"{drive.joint} (node {drive.node_id}) WILL NOT STOP BY ITSELF when this computer or the cable fails "
        f"({'; '.join(drive.boot_notes) or '1016h, 6007h not set'}): only STO stops it then"
        for drive in snapshot.drives
        if drive.configured and drive.nmt_state is NmtState.OPERATIONAL and not drive.stops_by_itself
    )


def _loop_entry(snapshot: DriverSnapshot, previous: DriverSnapshot, robot: str) -> DiagnosticStatus:
    level, sentence = _driver_state(snapshot)
    level, sentence = _with_news(level, sentence, _grown(snapshot, previous, _LOOP_COUNTERS))
    values = {
        "state": snapshot.state.name,
        "cause": snapshot.cause.value,
        "clears on": snapshot.clears_on,
        "standstill": snapshot.standstill,
        "odometry valid": snapshot.odometry_valid,
        "command age [s]": snapshot.command_age_s,
        "command fresh": snapshot.command_fresh,
        "cycles": snapshot.cycles,
        "greatest lateness [s]": snapshot.cycle_lateness_max_s,
        **_counters(snapshot, _LOOP_COUNTERS),
    }
    return _entry(level, f"{robot}: motor_driver", sentence, robot, values)


def _driver_state(snapshot: DriverSnapshot) -> tuple[bytes, str]:
    if snapshot.state is DriverState.ENABLED:
        return DiagnosticStatus.OK, "All drives are enabled."
    passing = snapshot.state in _TRANSIENT and snapshot.cause is not Cause.DRIVE_MISSING
    level = DiagnosticStatus.WARN if passing else DiagnosticStatus.ERROR
    detail = f": {snapshot.detail.rstrip('.')}" if snapshot.detail else ""
    clears = f" It ends with: {snapshot.clears_on}." if snapshot.clears_on else ""
    return level, f"{snapshot.state.name.capitalize()} ({snapshot.cause.value}){detail}.{clears}"


def _bus_entry(snapshot: DriverSnapshot, previous: DriverSnapshot, robot: str) -> DiagnosticStatus:
    if snapshot.bus_problem:
        level, sentence = DiagnosticStatus.ERROR, f"The bus has failed: {snapshot.bus_problem.rstrip('.')}."
    elif snapshot.controller is ControllerState.ERROR_ACTIVE:
        level, sentence = DiagnosticStatus.OK, "The bus works."
    else:
        level, sentence = DiagnosticStatus.WARN, f"The CAN controller is {snapshot.controller.value}: check the cable."
    level, sentence = _with_news(level, sentence, _grown(snapshot, previous, _BUS_COUNTERS))
    values = {"problem": snapshot.bus_problem, "controller": snapshot.controller.value} | _counters(
        snapshot, _BUS_COUNTERS
    )
    return _entry(level, f"{robot}: bus", sentence, robot, values)


def _watchdog_entry(snapshot: DriverSnapshot, previous: DriverSnapshot, robot: str) -> DiagnosticStatus:
    heard = _heard(snapshot.watchdog_age_s)
    level, sentence = _watchdog_state(snapshot, heard)
    names = [f"watchdog_{name}" for name in _WATCHDOG_COUNTERS]
    grown = {name.removeprefix("watchdog_"): count for name, count in _grown(snapshot, previous, names).items()}
    level, sentence = _with_news(level, sentence, grown)
    rung = snapshot.watchdog_rung
    values = {
        "state": snapshot.watchdog.value,
        "cause": snapshot.watchdog_cause,
        "rung of its ladder": _RUNGS[rung] if rung < len(_RUNGS) else rung,
        "last heard": heard,
        "age of the last lease [s]": snapshot.watchdog_lease_age_s,
        "longest pause of its loop [s]": snapshot.watchdog_pause_max_s,
        **{name.replace("_", " "): getattr(snapshot, f"watchdog_{name}") for name in _WATCHDOG_COUNTERS},
    }
    return _entry(level, f"{robot}: watchdog", sentence, robot, values)


def _watchdog_state(snapshot: DriverSnapshot, heard: str) -> tuple[bytes, str]:
    if snapshot.watchdog is WatchdogView.MISSING:
        sentence = f"The watchdog is missing: its state frame was {heard}. Is its process running, and on this bus?"
        return DiagnosticStatus.ERROR, sentence
    if snapshot.watchdog is WatchdogView.TRIPPED:
        sentence = f"The watchdog has tripped: {snapshot.watchdog_cause}. Remove the cause, then reset."
        return DiagnosticStatus.ERROR, sentence
    if snapshot.watchdog_pause_max_s > _PAUSE_WARNING_S:
        return (
            DiagnosticStatus.WARN,
            f"The watchdog watches, but its loop paused {snapshot.watchdog_pause_max_s:.3f} s.",
        )
    return DiagnosticStatus.OK, "The watchdog watches."


def _grown(snapshot: DriverSnapshot, previous: DriverSnapshot, names: Iterable[str]) -> dict[str, int]:
    """The counters that grew, and by how much."""
    differences = {name: getattr(snapshot, name) - getattr(previous, name) for name in names}
    return {name: difference for name, difference in differences.items() if difference > 0}


def _with_news(level: bytes, sentence: str, grown: Mapping[str, int]) -> tuple[bytes, str]:
    """A counter that grew is a warning at least."""
    if not grown:
        return level, sentence
    news = ", ".join(f"{count} more {name.replace('_', ' ')}" for name, count in grown.items())
    return max(level, DiagnosticStatus.WARN), f"{sentence} Since the last report: {news}."


def _counters(snapshot: DriverSnapshot, names: Iterable[str]) -> dict[str, int]:
    return {name.replace("_", " "): getattr(snapshot, name) for name in names}


def _drive_entry(drive: DriveSnapshot, state: DriverState, robot: str) -> DiagnosticStatus:
    level, sentence = _drive_state(drive, state)
    values = {
        "NMT state": drive.nmt_text,
        "CiA 402 state": drive.state_text,
        "statusword": f"{drive.statusword:04X}h",
        "error code": f"{drive.error_code:04X}h",
        "target [rad/s]": drive.target_radps,
        "velocity [rad/s]": drive.velocity_radps,
        "position [rad]": drive.position_rad,
        "last status TPDO": _heard(drive.feedback_age_s),
        "last heartbeat": _heard(drive.heartbeat_age_s),
        "stops by itself": drive.self_stop or "no",
        "warning (bit 7)": drive.warning,
        "internal limit (bit 11)": drive.internal_limit,
        **_measured(drive),
        "lacking or refused": "; ".join(drive.boot_notes) or "nothing",
        "changed by the boot": "; ".join(drive.boot_changes) or "nothing",
        "last boot": drive.boot_problem or "well",
    }
    place = f"node {drive.node_id} axis {drive.axis}"
    return _entry(level, f"{robot}: drive {drive.joint}", sentence, f"{robot} {place}", values)


def _drive_state(drive: DriveSnapshot, state: DriverState) -> tuple[bytes, str]:
    if drive.error_code or drive.state in _FAULTS:
        return DiagnosticStatus.ERROR, f"Error {drive.error_code:04X}h: {drive.error_text or drive.state_text}."
    words = drive.state_text.capitalize()
    if drive.boot_problem:
        return DiagnosticStatus.ERROR, f"Its last boot failed: {drive.boot_problem.rstrip('.')}."
    if math.isnan(drive.feedback_age_s):
        return DiagnosticStatus.ERROR, f"No feedback yet; its heartbeat was {_heard(drive.heartbeat_age_s)}."
    if state is DriverState.ENABLED and not drive.stops_by_itself:
        return DiagnosticStatus.WARN, f"{words}, but it would not stop by itself without us (1016h)."
    if drive.warning:
        return DiagnosticStatus.WARN, f"{words}, but it warns of something (statusword bit 7)."
    return DiagnosticStatus.OK, f"{words}, {drive.nmt_text}."


def _measured(drive: DriveSnapshot) -> dict[str, float]:
    """What the drive measures besides its motion, where it does."""
    values = {
        "voltage [V]": drive.voltage_v,
        "torque [% of the rated one]": 100.0 * drive.torque_share,
        "current [A]": drive.current_a,
        "temperature [°C]": drive.temperature_c,
    }
    return {name: value for name, value in values.items() if not math.isnan(value)}


def _heard(age_s: float) -> str:
    return "never heard" if math.isnan(age_s) else f"heard {age_s:.3f} s ago"


def _entry(level: bytes, name: str, sentence: str, hardware_id: str, values: Mapping[str, object]) -> DiagnosticStatus:
    entry = DiagnosticStatus(level=level, name=name, message=sentence, hardware_id=hardware_id)
    entry.values = [KeyValue(key=key, value=_text(value)) for key, value in values.items()]
    return entry


def _text(value: object) -> str:
    """A number with as many digits as somebody reads; anything else as Python writes it."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
