"""The rows of `canbase doctor` about the bus and the drives on it. Pure: from received frames and reads to `Check`s."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from canbase_commissioning.bus_monitor import OURS, Listener
from canbase_commissioning.can_interface import Link
from canbase_config.bus_load import BUSY_LOAD, FULL_LOAD
from canbase_config.drive import Drive
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID, Robot
from canbase_doctor.check import RESTART, Check, fail, ok, warn
from canbase_doctor.inspection import Inspection, Part
from canbase_driver.cia301.emcy import emcy_text
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.cia402 import DriveState
from canbase_driver.supervision.bus_health import ControllerState
from canbase_driver.supervision.watchdog_link import (
    CAUSES,
    LEASE_AGE_UNKNOWN,
    RUNGS,
    TRIPPED,
    WATCHING,
    WatchdogCounters,
)

SHORT_QUEUE, GOOD_QUEUE, LONG_QUEUE = 32, 64, 100
"""Frames. Into the kernel's 10 a cycle of several axes does not fit; what waits in a long one without acknowledgement
goes out late."""
RUNS: Final = f"If it runs, it hangs: {RESTART}"
_SHOWN: Final = 4
TWICE: Final = 1.5
"""SYNCs for each that the driver sends: more are not its own, nor frames that were sent again."""
DRIVER_SILENT: Final = CAUSES[2]
BACK: Final = "motor_driver lives now: it hung or ended (its log), or frames get lost (cable, termination). Then"
CURES: Final = {
    CAUSES[1]: "does safety_filter run, with this lease.socket? It sent no leases. Then",
    DRIVER_SILENT: f"does motor_driver run? {RUNS}. Then",
    CAUSES[8]: "another program commands this bus, or frames come twice: end it, then",
    CAUSES[10]: "is this computer overloaded? Does the watchdog have real-time priority? Then",
}
"""By the cause of a trip that is about no drive; then a reset."""
_CUT_OFF: Final = (ControllerState.BUS_OFF, ControllerState.ERROR_PASSIVE, ControllerState.STOPPED)
"""Little or nothing gets through."""


@dataclass(frozen=True, slots=True)
class BusEvidence:
    """What doctor has seen of the bus until `now_s` [s, monotonic]."""

    robot: Robot
    heard: Listener
    now_s: float
    problem: str = ""
    """Why the bus cannot be used; empty: it can."""
    link: Link | None = None
    """Of a socketcan interface, where `ip` reports it."""
    inspections: Mapping[int, Inspection] = field(default_factory=dict)
    unread: Mapping[int, str] = field(default_factory=dict)
    """Nodes that could not be read, and why."""

    @property
    def canbase_runs(self) -> bool:
        """Whether frames of canbase's driver or watchdog were received."""
        return any(node_id in self.heard.nodes for node_id in OURS)


def bus_checks(seen: BusEvidence) -> list[Check]:
    """All rows, from what explains most to the rest."""
    if seen.problem:
        return [fail("CAN bus", seen.problem, "docs/wiring.md, Bring the interface up")]
    rows = [*_interface(seen), _load(seen), _masters(seen), *_watchdog(seen)]
    for node_id in sorted({drive.node_id for drive in seen.robot.drives}):
        rows += _node(seen, node_id, tuple(drive for drive in seen.robot.drives if drive.node_id == node_id))
    return rows + _strangers(seen)


def _interface(seen: BusEvidence) -> list[Check]:
    bus, link = seen.robot.bus, seen.link
    if bus.interface != "socketcan":
        return [ok("CAN interface", f"{bus.interface} {bus.channel}: no error counters available")]
    if link is None:
        return [warn("CAN interface", f"{bus.channel}: `ip` reports nothing about it", "install iproute2")]
    if not link.is_up:
        up = f"sudo ip link set {link.name} up type can bitrate {bus.bitrate} restart-ms 100"
        return [fail("CAN interface", f"{link.name} is down", up)]
    if link.kind != "can":
        return [ok("CAN interface", f"{link.name} is up: {link.kind}, without a controller")]
    return [_bit_rate(link, bus.bitrate), _controller(link), _settings_of(link)]


def _bit_rate(link: Link, wanted: int) -> Check:
    if link.bitrate == wanted:
        return ok("bit rate", f"{link.bitrate} bit/s")
    advice = f"make both and the drives the same: sudo ip link set {link.name} type can bitrate {wanted}"
    return fail("bit rate", f"{link.name} has {link.bitrate} bit/s, robot.yaml {wanted}", advice)


def _controller(link: Link) -> Check:
    told = ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in link.counters.items())
    found = f"{link.state.value}; error counters: sending {link.send_errors}, receiving {link.receive_errors}"
    found += f"; since it is up: {told}" if told else ""
    wiring = "cable, termination (60 Ω between CAN_H and CAN_L), bit rate, and is a drive switched on?"
    if link.state in _CUT_OFF:
        return fail("CAN controller", found, wiring)
    if link.state is not ControllerState.ERROR_ACTIVE or link.send_errors or link.receive_errors:
        return warn("CAN controller", found, wiring)
    if link.counters.get("bus_off", 0):
        return warn("CAN controller", found, f"it was bus-off before; {wiring}")
    return ok("CAN controller", found)


def _settings_of(link: Link) -> Check:
    missing = [] if link.restart_ms else [f"sudo ip link set {link.name} type can restart-ms 100 (else bus-off stays)"]
    if link.queue_length < SHORT_QUEUE:
        missing.append(f"sudo ip link set {link.name} txqueuelen {GOOD_QUEUE} (frames of one cycle are refused)")
    if link.queue_length > LONG_QUEUE:
        missing.append(f"sudo ip link set {link.name} txqueuelen {GOOD_QUEUE} (old setpoints wait in a long one)")
    found = f"restart-ms {link.restart_ms}, txqueuelen {link.queue_length}"
    return warn("interface settings", found, "; ".join(missing)) if missing else ok("interface settings", found)


def _load(seen: BusEvidence) -> Check:
    heard, seconds = seen.heard, max(seen.now_s - seen.heard.since, 1e-3)
    load = heard.load(seen.robot.bus.bitrate, seen.now_s)
    found = f"{heard.frames / seconds:.0f} frames a second, at most {load:.0%} of {seen.robot.bus.bitrate} bit/s"
    if load > FULL_LOAD:
        return fail("bus load", found, "a higher bit rate, a lower rates.control_hz, or fewer PDOs of other nodes")
    if load > BUSY_LOAD:
        return warn("bus load", found, "little room is left: heartbeats go last")
    return ok("bus load", found)


def _masters(seen: BusEvidence) -> Check:
    """Beside canbase's own driver no other master may command; without it none at all."""
    signs = seen.heard.masters(seen.now_s)
    if not seen.canbase_runs and signs:
        return fail("masters", "; ".join(signs), "another program commands this bus: end it before canbase drives")
    if not seen.canbase_runs:
        return ok("masters", "none; canbase's driver does not run, so the drives were looked at alone")
    own_hz = seen.robot.rates.control_hz if seen.heard.driver_lives else 0.0
    sync_hz = seen.heard.sync_hz(seen.now_s)
    if sync_hz > TWICE * own_hz:
        found = f"SYNC, {sync_hz:.0f} a second, of which canbase's driver sends {own_hz:.0f}"
        return fail("masters", found, "another program commands this bus too: end it")
    ours = [text for node_id, text in OURS.items() if node_id in seen.heard.nodes]
    return ok("masters", " and ".join(ours))


def _watchdog(seen: BusEvidence) -> list[Check]:
    state = seen.heard.watchdog
    if state is None:
        if not seen.canbase_runs:
            return []
        return [
            fail(
                "watchdog's state (1FEh)",
                "never received",
                f"start canbase serve watchdog with this robot.yaml. {RUNS}",
            )
        ]
    age_s = seen.now_s - seen.heard.watchdog_at
    lease = "none yet" if state.lease_age_ms == LEASE_AGE_UNKNOWN else f"{state.lease_age_ms} ms old"
    found = f"{('starting', 'watching', 'tripped')[state.state]}, received {age_s * 1000:.0f} ms ago; lease {lease}"
    rows = [_watchdog_state(seen, found, age_s)]
    if WATCHDOG_NODE_ID not in seen.heard.nodes:
        rows.append(fail("watchdog's heartbeat (77Eh)", "not received", "it withholds it after a trip: canbase reset"))
    if DRIVER_NODE_ID not in seen.heard.nodes:
        rows.append(fail("driver's heartbeat (77Fh)", "not received", f"start motor_driver. {RUNS}"))
    return [*rows, *([_counters(seen.heard.counters)] if seen.heard.counters else [])]


def _watchdog_state(seen: BusEvidence, found: str, age_s: float) -> Check:
    name, state = "watchdog's state (1FEh)", seen.heard.watchdog
    if state is None or age_s > seen.robot.timeouts.watchdog_s:
        return fail(name, found, f"it has ended or hangs: {RESTART}; the drives stop by themselves")
    if state.state == TRIPPED:
        about = f" of node {state.node_id}" if state.node_id else ""
        rung = RUNGS[state.rung] if state.rung < len(RUNGS) else str(state.rung)
        back = seen.heard.driver_lives and state.cause_text == DRIVER_SILENT
        cure = BACK if back else CURES.get(state.cause_text, "remove the cause,")
        return fail(name, f"{found}; cause: {state.cause_text}{about}, rung: {rung}", f"{cure} canbase reset")
    return ok(name, found) if state.state == WATCHING else warn(name, found, "look again in a second")


def _counters(counters: WatchdogCounters) -> Check:
    found = (
        f"trips {counters.trips}, leases refused {counters.leases_refused}, frames dropped {counters.frames_dropped}, "
        f"bus errors {counters.bus_errors}, longest pause of its loop {counters.pause_max_ms} ms"
    )
    if counters.leases_refused or counters.bus_errors:
        return warn("watchdog's counters (2FEh)", found, "docs/bus.md explains them")
    return ok("watchdog's counters (2FEh)", found)


def _node(seen: BusEvidence, node_id: int, drives: tuple[Drive, ...]) -> list[Check]:
    name = f"node {node_id} ({', '.join(drive.joint for drive in drives)})"
    inspection = seen.inspections.get(node_id)
    if inspection is None:
        return [_unread(seen, name, node_id)]
    return [
        _identity(name, inspection, drives),
        _life(seen, name, inspection),
        _configured(seen, f"{name}: configuration", node_id, inspection.settings),
        _configured(seen, f"{name}: PDO mapping", node_id, inspection.pdos),
        _self_stop(seen, f"{name}: stops by itself", inspection),
    ]


def _unread(seen: BusEvidence, name: str, node_id: int) -> Check:
    why = seen.unread.get(node_id, "it was not queried")
    if node_id in seen.heard.nodes:
        return warn(name, f"it sends frames, {_ages(seen, node_id)}; {why}", AGAIN if why == IN_USE else NO_ANSWER)
    cure = "power, cable, termination, bit rate, node id; canbase bus scan shows who answers"
    if seen.robot.bus.is_virtual:
        cure = "do the simulated drives run (canbase up, or canbase serve sim), on this bus?"
    return fail(name, f"no frame received; {why}", cure)


def _identity(name: str, found: Inspection, drives: tuple[Drive, ...]) -> Check:
    profile = drives[0].profile
    told = ":".join("–" if n is None else f"{n:X}" for n in _numbers(found))
    if found.wrong_identity:
        return fail(name, found.wrong_identity, "another drive has this node id, or `identity` in robot.yaml is wrong")
    if found.guessed is not None and found.guessed != profile and not profile.endswith((".yaml", ".yml")):
        return warn(
            name, f"{told}; it looks like a {found.guessed}", f"robot.yaml has profile {profile}: is that right?"
        )
    return ok(name, f"{told}, profile {profile}")


def _numbers(found: Inspection) -> tuple[int | None, ...]:
    identity = found.identity
    return identity.vendor_id, identity.product_code, identity.revision, identity.serial


def _life(seen: BusEvidence, name: str, found: Inspection) -> Check:
    states = ", ".join("unknown state" if s is None else s.text for s in found.states.values())
    told = f"{states}; {_ages(seen, found.node_id)}"
    codes = {joint: code for joint, code in found.error_codes.items() if code}
    if any(state in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE) for state in found.states.values()):
        why = ", ".join(f"{code:04X}h {emcy_text(code)}" for code in codes.values()) or "603Fh has no code"
        return fail(f"{name}: state", f"{told}; {why}", "remove the cause, canbase reset")
    emcy = seen.heard.nodes[found.node_id].emcy if found.node_id in seen.heard.nodes else None
    if emcy is not None:
        return warn(f"{name}: state", f"{told}; EMCY {emcy.text}", "remove the cause")
    node = seen.heard.nodes.get(found.node_id)
    if seen.heard.driver_lives and (node is None or node.nmt_state is not NmtState.OPERATIONAL):
        told = f"{told}; it is not in NMT operational beside a driver"
        if seen.heard.watchdog is not None and seen.heard.watchdog.state == TRIPPED:
            return warn(f"{name}: state", told, "the watchdog stopped it: canbase reset boots it again")
        if _is_configured(found):
            return warn(f"{name}: state", told, WAITS)
        return fail(f"{name}: state", told, NOT_BOOTED)
    return ok(f"{name}: state", told)


def _is_configured(found: Inspection) -> bool:
    parts = (found.settings, found.pdos, found.self_stop_part)
    return not (found.wrong_identity or any(part.changes or part.problem for part in parts))


def _ages(seen: BusEvidence, node_id: int) -> str:
    node = seen.heard.nodes.get(node_id)
    if node is None:
        return "NMT state unknown, no heartbeat, no TPDO"
    beat, pdo = node.heartbeat_age_s(seen.now_s), node.pdo_age_s(seen.now_s)
    period = "" if math.isnan(node.period_s) else f" every {node.period_s * 1000:.0f} ms"
    heartbeat = "no heartbeat" if math.isnan(beat) else f"heartbeat{period}, {beat * 1000:.0f} ms old"
    tpdo = "no TPDO" if math.isnan(pdo) else f"TPDO {pdo * 1000:.0f} ms old"
    return f"{node.state_text}, {heartbeat}, {tpdo}"


NOT_BOOTED: Final = (
    "the driver could not boot this drive, or still boots it: the reason is in its log and in boot_problem of "
    "motor_driver/status"
)
WAITS: Final = (
    "it is configured as the driver does it: the driver starts it when all drives are ready; if it alone is left, the "
    "reason is in boot_problem of motor_driver/status"
)
IN_USE: Final = "its SDO channel is in use all the time: the driver boots it"
AGAIN: Final = "run doctor again when its SDO channel is free"
NO_ANSWER: Final = (
    "frames get lost (cable, termination, 60 Ω between CAN_H and CAN_L), or the drive answers late: "
    "`sdo.timeout_s` of its drive profile"
)


def _differs(seen: BusEvidence, name: str, node_id: int, told: str) -> Check:
    """Beside a running driver. A drive in NMT operational was booted by it, the others not.

    What a drive refuses, the boot notes or replaces. Nothing on the bus tells that from a change that came later.
    """
    node = seen.heard.nodes.get(node_id)
    if node is None or node.nmt_state is not NmtState.OPERATIONAL:
        return fail(name, told, NOT_BOOTED)
    advice = "restart motor_driver. What still differs, the drive refuses: the boot's notes in the driver's log say so"
    return warn(name, f"{told}. The drive refused it at its boot, or it has been changed since: cannot tell", advice)


def _configured(seen: BusEvidence, name: str, node_id: int, part: Part) -> Check:
    """Without a driver, a difference is what the driver writes at its start."""
    if part.problem:
        return fail(name, part.problem, "docs/drives.md lists what a drive must have")
    if not part.changes:
        return ok(name, "as in robot.yaml")
    told = f"{len(part.changes)} differences: {_some(part.changes)}"
    if seen.heard.driver_lives:
        return _differs(seen, name, node_id, told)
    return ok(name, f"{told}. The driver writes them at its start")


def _self_stop(seen: BusEvidence, name: str, found: Inspection) -> Check:
    if not found.self_stop:
        why = _some(found.self_stop_part.notes) or "it has no object for it"
        advice = "when the computer dies it keeps its last speed: only STO by a safety relay stops it then"
        return warn(name, f"NO: {why}", advice)
    set_now = not found.self_stop_part.changes
    if not set_now and seen.heard.driver_lives:
        changes = _some(found.self_stop_part.changes)
        return _differs(seen, name, found.node_id, f"not as the boot sets it: {changes}")
    when = "set" if set_now else "when the driver has set it"
    notes = f"; {_some(found.self_stop_part.notes)}" if found.self_stop_part.notes else ""
    return ok(name, f"by {found.self_stop}, {when}{notes}. canbase setup commission proves it")


def _some(texts: tuple[str, ...]) -> str:
    more = f"; {len(texts) - _SHOWN} more" if len(texts) > _SHOWN else ""
    return "; ".join(texts[:_SHOWN]) + more


def _strangers(seen: BusEvidence) -> list[Check]:
    known = {drive.node_id for drive in seen.robot.drives} | OURS.keys()
    others = sorted(set(seen.heard.nodes) - known)
    if not others:
        return []
    told = f"node {', '.join(map(str, others))} on the bus and not in robot.yaml"
    return [warn("other nodes", told, "canbase does not use them; canbase bus scan identifies them")]
