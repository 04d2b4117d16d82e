"""From a `DriverSnapshot` to /diagnostics: levels, sentences and values. No node or clock.

One entry each for the loop, the bus, the watchdog and every drive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from canbase_config.bus_load import BUSY_LOAD
from canbase_config.diagnostics import BUS, MOTOR_DRIVER, WATCHDOG, drive_name, entry_name
from canbase_driver.causes import DriverCause
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.cia402 import DriveState
from canbase_driver.drives.drive_snapshot import DriveSnapshot
from canbase_driver.drives.health import Excess
from canbase_driver.snapshot import DriverSnapshot
from canbase_driver.supervision.bus_health import BusReport, ControllerState
from canbase_driver.supervision.watchdog_link import RUNGS, WatchdogReport
from canbase_runtime.driver_state import DriverState
from canbase_runtime.watchdog_view import WatchdogView

_FAULTS = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)
BUSY = "little is left for boots and tools; raise the bit rate, or lower rates.control_hz"
_PAUSE_WARNING_S = 0.05
"""A pause of the watchdog's loop that is worth a look: ten of its turns."""


def diagnostics_message(
    snapshot: DriverSnapshot,
    stamp: Time,
    *,
    robot: str = "robot",
    previous: DriverSnapshot | None = None,
    warnings: Sequence[Excess] = (),
    hardware_ids: Mapping[str, str] | None = None,
    bus_load: float = math.nan,
    busy_above: float = BUSY_LOAD,
) -> DiagnosticArray:
    """One entry for the loop, one for the bus, one for the watchdog, one per drive; `robot` makes their names unique.

    `previous` is the snapshot of the message before: a counter that grew since then is a warning, an old one is not.
    `warnings`: of `health`. `hardware_ids`: by joint. `bus_load`: the share of its time that frames took; NaN: unknown.
    `busy_above`: a greater share is a warning.
    """
    message = DiagnosticArray()
    message.header.stamp = stamp
    message.status = [
        _loop_entry(snapshot, previous or snapshot, robot),
        _bus_entry(snapshot.bus, (previous or snapshot).bus, robot, bus_load, busy_above),
        _watchdog_entry(snapshot.watchdog, (previous or snapshot).watchdog, robot),
        *(_drive_entry(drive, snapshot.state, robot, warnings, hardware_ids or {}) for drive in snapshot.drives),
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
    events, before = _loop_events(snapshot), _loop_events(previous)
    level, sentence = _with_news(*_driver_state(snapshot), events, before)
    values = {
        "state": snapshot.state.name,
        "cause": snapshot.finding.cause.value,
        "clears on": snapshot.finding.clears_on,
        "standstill": snapshot.standstill,
        "standstill assumed, not measured": snapshot.standstill_assumed,
        "odometry valid": snapshot.odometry.valid,
        "command age [s]": snapshot.command.age_s,
        "command fresh": snapshot.command.fresh,
        "cycles": snapshot.cycle.cycles,
        "greatest lateness [s]": snapshot.cycle.lateness_max_s,
        **_named(events),
    }
    return _entry(level, entry_name(robot, MOTOR_DRIVER), sentence, robot, values)


def _loop_events(snapshot: DriverSnapshot) -> dict[str, int]:
    return snapshot.command.events | snapshot.cycle.events | snapshot.odometry.events


def _driver_state(snapshot: DriverSnapshot) -> tuple[bytes, str]:
    if snapshot.state is DriverState.ENABLED:
        return DiagnosticStatus.OK, "All drives are enabled."
    waits = snapshot.state is DriverState.DISARMED  # for a zero command, for example: nothing is defective
    missing = snapshot.finding.cause is DriverCause.DRIVE_MISSING
    level = DiagnosticStatus.WARN if (snapshot.state.passes or waits) and not missing else DiagnosticStatus.ERROR
    detail = f": {snapshot.finding.detail.rstrip('.')}" if snapshot.finding.detail else ""
    clears = f" It ends with: {snapshot.finding.clears_on}." if snapshot.finding.clears_on else ""
    return level, f"{snapshot.state.name.capitalize()} ({snapshot.finding.cause.value}){detail}.{clears}"


def _bus_entry(bus: BusReport, previous: BusReport, robot: str, load: float, busy_above: float) -> DiagnosticStatus:
    if bus.problem:
        level, sentence = DiagnosticStatus.ERROR, f"The bus has failed: {bus.problem.rstrip('.')}."
    elif bus.controller is not ControllerState.ERROR_ACTIVE:
        level, sentence = DiagnosticStatus.WARN, f"The CAN controller is {bus.controller.value}: check the cable."
    elif load > busy_above:
        level, sentence = DiagnosticStatus.WARN, f"Frames take {load:.0%} of the bus's time: {BUSY}."
    else:
        level, sentence = DiagnosticStatus.OK, "The bus works."
    level, sentence = _with_news(level, sentence, bus.events, previous.events)
    values = {
        "problem": bus.problem,
        "controller": bus.controller.value,
        "load [%]": 100.0 * load,
        **_named(bus.events),
    }
    return _entry(level, entry_name(robot, BUS), sentence, robot, values)


def _watchdog_entry(watchdog: WatchdogReport, previous: WatchdogReport, robot: str) -> DiagnosticStatus:
    events, rung = watchdog.counters.events, watchdog.rung
    level, sentence = _with_news(*_watchdog_state(watchdog), events, previous.counters.events)
    values = {
        "state": watchdog.view.value,
        "cause": watchdog.cause,
        "rung of its ladder": RUNGS[rung] if rung < len(RUNGS) else rung,
        "last frame": _last_received(watchdog.age_s),
        "age of the last lease [s]": watchdog.lease_age_s,
        "longest pause of its loop [s]": watchdog.pause_max_s,
        **_named(events),
    }
    return _entry(level, entry_name(robot, WATCHDOG), sentence, robot, values)


def _watchdog_state(watchdog: WatchdogReport) -> tuple[bytes, str]:
    if watchdog.view is WatchdogView.TRIPPED:
        return DiagnosticStatus.ERROR, f"The watchdog has tripped: {watchdog.cause}. Remove the cause, then reset."
    if watchdog.view is not WatchdogView.OK:
        received = _last_received(watchdog.age_s)
        sentence = f"The watchdog is missing: its state frame was {received}. Is its process running, and on this bus?"
        return DiagnosticStatus.ERROR, sentence
    if watchdog.pause_max_s > _PAUSE_WARNING_S:
        return DiagnosticStatus.WARN, f"The watchdog watches, but its loop paused {watchdog.pause_max_s:.3f} s."
    return DiagnosticStatus.OK, "The watchdog watches."


def _with_news(level: bytes, sentence: str, events: Mapping[str, int], before: Mapping[str, int]) -> tuple[bytes, str]:
    """A counter that grew since the report before is a warning at least."""
    grown = {name: count - before[name] for name, count in events.items() if count > before[name]}
    if not grown:
        return level, sentence
    news = ", ".join(f"{count} more {name}" for name, count in _named(grown).items())
    return max(level, DiagnosticStatus.WARN), f"{sentence} Since the last report: {news}."


def _named(events: Mapping[str, int]) -> dict[str, int]:
    """As people read their names."""
    return {name.replace("_", " "): count for name, count in events.items()}


def _drive_entry(
    drive: DriveSnapshot,
    state: DriverState,
    robot: str,
    warnings: Sequence[Excess],
    hardware_ids: Mapping[str, str],
) -> DiagnosticStatus:
    level, sentence = _drive_state(drive, state)
    if excesses := [warning.text for warning in warnings if warning.joint == drive.joint]:
        level, sentence = max(level, DiagnosticStatus.WARN), f"{sentence} Measured: {'; '.join(excesses)}."
    values = {
        "node": drive.node_id,
        "axis": drive.axis,
        "NMT state": drive.nmt_text,
        "CiA 402 state": drive.state_text,
        "statusword": f"{drive.statusword:04X}h",
        "error code": f"{drive.error_code:04X}h",
        "target [rad/s]": drive.target_radps,
        "velocity [rad/s]": drive.velocity_radps,
        "position [rad]": drive.position_rad,
        "last status TPDO": _last_received(drive.feedback_age_s),
        "last heartbeat": _last_received(drive.heartbeat_age_s),
        "stops by itself": drive.self_stop or "no",
        "warning (bit 7)": drive.warning,
        "internal limit (bit 11)": drive.internal_limit,
        **_measured(drive),
        **named_values(drive),
        "lacking or refused": "; ".join(drive.boot_notes) or "nothing",
        "changed by the boot": "; ".join(drive.boot_changes) or "nothing",
        "last boot": drive.boot_problem or "well",
    }
    hardware_id = hardware_ids.get(drive.joint) or f"{robot} node {drive.node_id} axis {drive.axis}"
    return _entry(level, drive_name(robot, drive.joint), sentence, hardware_id, values)


def _drive_state(drive: DriveSnapshot, state: DriverState) -> tuple[bytes, str]:
    if drive.error_code or drive.state in _FAULTS:
        return DiagnosticStatus.ERROR, f"Error {drive.error_code:04X}h: {drive.error_text or drive.state_text}."
    words = drive.state_text.capitalize()
    if drive.boot_problem:
        return DiagnosticStatus.ERROR, f"Its last boot failed: {drive.boot_problem.rstrip('.')}."
    if math.isnan(drive.feedback_age_s):
        return DiagnosticStatus.ERROR, f"No feedback yet; its heartbeat was {_last_received(drive.heartbeat_age_s)}."
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
        "effort at the wheel [N·m]": drive.effort_nm,
        "current [A]": drive.current_a,
        "temperature [°C]": drive.temperature_c,
    }
    return {name: value for name, value in values.items() if not math.isnan(value)}


def named_values(drive: DriveSnapshot) -> dict[str, float]:
    """What robot.yaml wants published of the drive, by name and unit; NaN: it is not known now."""
    return {f"{each.name} [{each.unit}]" if each.unit else each.name: each.value for each in drive.values}


def values_message(snapshot: DriverSnapshot, stamp: Time, robot: str) -> DiagnosticArray:
    """motor_driver/values: one entry for each drive with named values, in the form that plotting tools read."""
    message = DiagnosticArray()
    message.header.stamp = stamp
    message.status = [
        _entry(
            DiagnosticStatus.STALE if any(math.isnan(each.value) for each in drive.values) else DiagnosticStatus.OK,
            drive_name(robot, drive.joint),
            "",
            f"{robot} node {drive.node_id} axis {drive.axis}",
            named_values(drive),
        )
        for drive in snapshot.drives
        if drive.values
    ]
    return message


def _last_received(age_s: float) -> str:
    return "never received" if math.isnan(age_s) else f"received {age_s:.3f} s ago"


def _entry(level: bytes, name: str, sentence: str, hardware_id: str, values: Mapping[str, object]) -> DiagnosticStatus:
    entry = DiagnosticStatus(level=level, name=name, message=sentence, hardware_id=hardware_id)
    entry.values = [KeyValue(key=key, value=_text(value)) for key, value in values.items()]
    return entry


def _text(value: object) -> str:
    """A number with as many digits as somebody reads; anything else as Python writes it."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
