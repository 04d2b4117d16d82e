"""What the boot sets in a node without torque: how it moves, and when it stops by itself. CiA 301, CiA 402-2.

Which of the objects exist, where and in which unit, is in the drive's profile. The sequence is `sequence.py`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from canbase_config.commissioned import is_proven
from canbase_config.drive import Drive
from canbase_config.object_map import MODE, MODE_DISPLAY, TARGET_VELOCITY, place
from canbase_config.profile import Profile, SdoWrite
from canbase_config.robot import CYCLIC, DRIVER_NODE_ID, WATCHDOG_NODE_ID, Robot
from canbase_config.watchdog import LIFE_TIME_FACTOR, guard_time_ms
from canbase_driver.boot.advice import GUARDING_ALONE
from canbase_driver.boot.steps import MODE_POLLS, BootError, NodeAccess, Steps
from canbase_driver.boot.vl_settings import KeptRamp, configure_vl, set_vl_ramp
from canbase_driver.cia301.sdo_client import VALUE_INVALID, VALUE_TOO_HIGH, VALUE_TOO_LOW, Read, SdoAborted, Write
from canbase_driver.drive_units import AxisUnits

GUARD_TIME, LIFE_TIME = 0x100C, 0x100D
HEARTBEAT_CONSUMER, HEARTBEAT_PRODUCER, SYNC_COUNTER, ERROR_BEHAVIOUR = 0x1016, 0x1017, 0x1019, 0x1029
ABORT_CONNECTION_OPTION, QUICK_STOP_OPTION, FAULT_REACTION_OPTION = 0x6007, 0x605A, 0x605E
PROFILE_ACCELERATION, PROFILE_DECELERATION, QUICK_STOP_DECELERATION = 0x6083, 0x6084, 0x6085
INTERPOLATION = 0x60C2
STOPPING_LIMITS = {
    PROFILE_DECELERATION: "deceleration_mps2",
    QUICK_STOP_DECELERATION: "emergency_deceleration_mps2",
}
"""Which limit of robot.yaml a drive must brake with at least by its own ramps, whatever it refuses."""
KEPT_SHARE = 0.95
"""Of that limit: drives round."""
COASTS = 0

ENTER_PRE_OPERATIONAL_ON_LOSS = 0
MILLISECONDS = -3
"""60C2h:2, exponent of the period; some drives accept no other."""
FAULT_SIGNAL = 1
"""6007h: some drives take an NMT reset for the loss of their master then, and go into fault."""
NO_ACTION = 0

HEARTBEATS_WANTED, HEARTBEATS_NEEDED = 3, 2
"""In the time after which a drive without a heartbeat counts as lost (timeouts.drive_heartbeat_s)."""
HEARTBEAT_PERIODS_MS = (10, 20, 25, 40, 50, 64, 80, 100, 125, 128, 150, 160, 200, 250, 256, 320, 400, 500)
"""Values of 1017h that are tried where a drive refuses the wanted one: those that steps and limits of drives allow."""
VALUE_REFUSED = (VALUE_INVALID, VALUE_TOO_HIGH, VALUE_TOO_LOW)


class StopsBy(Enum):
    """By what a drive stops itself without commands."""

    NOTHING = "nothing"
    WATCHDOG_HEARTBEAT = "heartbeat of the watchdog"
    NODE_GUARDING = "node guarding by the watchdog"
    OWN_TIMEOUT = "the drive's own command timeout"
    AS_PROVEN = "as canbase setup commission has proven"


@dataclass(frozen=True, slots=True)
class SelfStopSet:
    """What the boot set and read back. `text`: for people, with the objects; empty for NOTHING."""

    by: StopsBy
    text: str


STOPS_BY_NOTHING = SelfStopSet(StopsBy.NOTHING, "")


def configure_motion(node: NodeAccess, drive: Drive, robot: Robot) -> Steps[None]:
    """Mode, ramps, and no target: one of an earlier life would move the drive as soon as it is enabled."""
    kind, mode = drive.kind, drive.used_mode
    at = place(kind, MODE_DISPLAY, drive.axis)
    shown_at = Read(at.index, at.sub) if kind.options.mode_display in ("yes", "probe") else None
    node.mode_polls = MODE_POLLS if kind.options.mode_display == "yes" else 1
    yield from node.set(write_at(drive, MODE, mode), shown_at=shown_at)
    if mode == CYCLIC:
        cycle_ms = round(1000.0 / robot.rates.control_hz)
        yield from node.set_if_present(Write(INTERPOLATION, 1, cycle_ms, 1), kind.options.interpolation)
        yield from node.set_if_present(Write(INTERPOLATION, 2, MILLISECONDS, 1), kind.options.interpolation)
    if kind.is_vl:
        yield from configure_vl(node, drive, robot)
    yield from node.set(write_at(drive, TARGET_VELOCITY, 0))
    yield from _configure_ramps(node, drive, robot)


def configure_self_stop(node: NodeAccess, drives: tuple[Drive, ...], robot: Robot) -> Steps[SelfStopSet]:
    """Sets and reads back what makes the drive stop by itself."""
    kind, timeout_ms = drives[0].kind, round(1000 * robot.timeouts.drive_heartbeat_s)
    guarded = kind.self_stop.node_guarding
    if guarded:
        stops = yield from _be_guarded(node, robot.timeouts.drive_heartbeat_s)
    else:
        yield from _produce_heartbeat(node, timeout_ms)
        stops = yield from _watch_heartbeats(node, kind, timeout_ms)
    enters = Write(ERROR_BEHAVIOUR, 1, ENTER_PRE_OPERATIONAL_ON_LOSS, 1)
    yield from node.set_if_present(enters, kind.self_stop.error_behaviour)
    options = kind.options
    for drive in drives:
        took = yield from node.set_if_present(on_loss(drive), kind.self_stop.abort_connection)
        stops = took and stops
        quick_stop = write_at(drive, QUICK_STOP_OPTION, options.quick_stop_code)
        if not (yield from node.set_if_present(quick_stop, options.quick_stop)):
            yield from _refuse_coasting(node, drive)
        reaction = write_at(drive, FAULT_REACTION_OPTION, options.fault_reaction_code)
        yield from node.set_if_present(reaction, options.fault_reaction)
    by_vendor = yield from _set_vendor_watchdog(node, kind, robot)
    if stops and guarded:
        return SelfStopSet(StopsBy.NODE_GUARDING, "node guarding by the watchdog (100Ch, 100Dh, 6007h)")
    if stops:
        return SelfStopSet(StopsBy.WATCHDOG_HEARTBEAT, "heartbeat of the watchdog (1016h, 6007h)")
    if by_vendor:
        return SelfStopSet(StopsBy.OWN_TIMEOUT, by_vendor)
    return (yield from _as_proven(node, drives, robot))


def configure_sync(node: NodeAccess, kind: Profile, counter: int | None) -> Steps[None]:
    """1019h as `bus.sync_counter` has it; a SYNC of another length than a drive expects is an error to it."""
    if counter is not None:
        yield from node.set(Write(SYNC_COUNTER, 0, counter, 1))
        return
    kept = 0 if kind.options.sync_counter == "no" else (yield from node.read_if_present(SYNC_COUNTER))
    if kept and not (yield from node.set_if_present(Write(SYNC_COUNTER, 0, 0, 1))):
        node.notes.append(
            f"1019h:0 stays at {kept}, and it may take no SYNC without a counter: set `bus.sync_counter: {kept}` in "
            "robot.yaml, or 1019h:0 to 0 with the manufacturer's tool"
        )


def write_all(node: NodeAccess, writes: tuple[SdoWrite, ...]) -> Steps[None]:
    """What the profile wants written besides."""
    for entry in writes:
        write = Write(entry.index, entry.sub, entry.value, entry.bits // 8)
        if entry.optional:
            yield from node.set_if_present(write)
        else:
            yield from node.set(write)


def on_loss(drive: Drive) -> Write:
    """6007h: what the drive does when its master is lost."""
    return write_at(drive, ABORT_CONNECTION_OPTION, drive.kind.self_stop.abort_connection_code)


def harmless_on_loss(drive: Drive) -> Write:
    """6007h for the time of an NMT reset, in which nothing has torque: no fault for it."""
    code = drive.kind.self_stop.abort_connection_code
    return write_at(drive, ABORT_CONNECTION_OPTION, NO_ACTION if code == FAULT_SIGNAL else code)


def write_at(drive: Drive, index: int, value: int) -> Write:
    """A write to object `index` of the drive's axis."""
    at = place(drive.kind, index, drive.axis)
    return Write(at.index, at.sub, value, at.bits // 8)


def _configure_ramps(node: NodeAccess, drive: Drive, robot: Robot) -> Steps[None]:
    """Raises BootError when the drive keeps a softer stop: its way would be longer than all others count with."""
    for index, mps2 in _needed_mps2(robot).items():
        set_ramp = set_vl_ramp if drive.kind.is_vl else _set_ramp
        kept = yield from set_ramp(node, drive, robot, index, mps2)
        key = STOPPING_LIMITS.get(index)
        if kept is None or key is None:
            continue
        needed, has = _needed_mps2(robot)[index], kept.mps2
        if has is None:
            value = AxisUnits(drive, robot.base).acceleration_raw(needed)
            where = ", in a curve or an emergency" if needed > getattr(robot.limits, key) else ""
            least = f"{needed:g} m/s² (limits.{key}{where}), a value of {value}{kept.what}"
            node.notes.append(
                f"how hard {drive.joint} brakes is unknown: it must be at least {least}; "
                "set it with the manufacturer's tool"
            )
            continue
        if has >= KEPT_SHARE * needed:
            continue
        problem = f"{kept.what}: {drive.joint} brakes with {has:.3g} m/s² by it"
        hint = f"Set the object with the manufacturer's tool, or {_slower(robot, key, has)}"
        raise BootError(node.node_id, problem, hint)


def _slower(robot: Robot, key: str, has_mps2: float) -> str:
    """Which limits of robot.yaml fit a wheel that brakes with `has_mps2`. In a curve both decelerations add up."""
    limits = robot.limits
    if key == "deceleration_mps2":
        straight, turning, hardest = (
            limits.deceleration_mps2,
            limits.angular_deceleration_radps2,
            limits.emergency_deceleration_mps2,
        )
        share = min(1.0, has_mps2 / (straight + turning * robot.base.track_m / 2))
        return (
            f"set `limits.deceleration_mps2: {_floor(share * straight):g}`, `limits.angular_deceleration_radps2: "
            f"{_floor(share * turning):g}` and `limits.emergency_deceleration_mps2: {_floor(min(hardest, has_mps2)):g}`"
            f" in robot.yaml, where they are {straight:g}, {turning:g} and {hardest:g}"
        )
    text = f"set `limits.{key}: {_floor(has_mps2):g}` in robot.yaml, where it is {getattr(limits, key):g}"
    if has_mps2 < (ordinary := limits.deceleration_mps2) < getattr(limits, key):
        text += f", and `limits.deceleration_mps2` to no more, where it is {ordinary:g}"
    return text


def _floor(value: float) -> float:
    return math.floor(1000.0 * value) / 1000.0


def _set_ramp(node: NodeAccess, drive: Drive, robot: Robot, index: int, mps2: float) -> Steps[KeptRamp | None]:
    """Returns what the drive keeps where it does not take it; None: it took it, or its profile says it has none."""
    units, presence = AxisUnits(drive, robot.base), drive.kind.options.ramps
    write = write_at(drive, index, units.acceleration_raw(mps2))
    if (yield from node.set_if_present(write, presence)):
        return None
    if presence == "no" or index not in STOPPING_LIMITS:
        return None
    raw = yield from node.read_if_present(write.index, write.sub)
    if raw is None:
        return KeptRamp(" in the unit of its profile")
    return KeptRamp(f"{write.index:04X}h:{write.sub} stays at {raw}", units.acceleration_mps2(raw))


def _refuse_coasting(node: NodeAccess, drive: Drive) -> Steps[None]:
    """605Ah of 0 that the drive keeps: a quick stop takes the power away, and the wheel rolls out."""
    at = place(drive.kind, QUICK_STOP_OPTION, drive.axis)
    if drive.kind.options.quick_stop == "no":
        return
    option = yield from node.read_if_present(at.index, at.sub)
    if option is None:
        node.notes.append(
            f"how a quick stop ends is unknown: it must brake {drive.joint} and not let it coast; make sure by the "
            "manual, then press the emergency stop once at low speed"
        )
    if option != COASTS:
        return
    problem = f"{at.index:04X}h:{at.sub} stays at 0: a quick stop lets {drive.joint} coast"
    hint = (
        "Set it to 2 with the manufacturer's tool; to let it roll out, set options.quick_stop: no in its drive profile"
    )
    raise BootError(node.node_id, problem, hint)


def _needed_mps2(robot: Robot) -> dict[int, float]:
    """What a wheel needs at most: in a curve the ramps of both speeds add up. The driver shapes the speed, in an
    emergency too: the drive's own ramps bound a step, and must never lag behind."""
    limits, arm_m = robot.limits, robot.base.track_m / 2
    faster = limits.acceleration_mps2 + limits.angular_acceleration_radps2 * arm_m
    slower = limits.deceleration_mps2 + limits.angular_deceleration_radps2 * arm_m
    hardest = limits.emergency_deceleration_mps2
    return {
        PROFILE_ACCELERATION: max(faster, hardest),
        PROFILE_DECELERATION: max(slower, hardest),
        QUICK_STOP_DECELERATION: hardest,
    }


def _produce_heartbeat(node: NodeAccess, timeout_ms: int) -> Steps[None]:
    """1017h, or the nearest period that the drive takes. Raises BootError when it takes none that is short enough.

    A drive that lacks the object, or refuses it for another reason, may produce a heartbeat all the same: a note.
    """
    wanted, longest = round(timeout_ms / HEARTBEATS_WANTED), timeout_ms // HEARTBEATS_NEEDED
    others = sorted((ms for ms in HEARTBEAT_PERIODS_MS if ms <= longest), key=lambda ms: abs(ms - wanted))
    refusal = ""
    for period_ms in (wanted, *others):
        try:
            yield from node.set(Write(HEARTBEAT_PRODUCER, 0, period_ms, 2), unread=True)
        except SdoAborted as refused:
            refusal = refusal or f"1017h:0: {refused.text}"
            if refused.code not in VALUE_REFUSED:
                node.notes.append(
                    f"1017h:0: {refused.text}; so its heartbeat must come by itself, within {longest} ms: set that "
                    f"with the manufacturer's tool; {GUARDING_ALONE}"
                )
                return
        except BootError as other:
            refusal = refusal or other.problem
            if 0 < ((yield from node.read_if_present(HEARTBEAT_PRODUCER)) or 0) <= longest:
                node.notes.append(f"{other.problem}: that is short enough")
                return
        else:
            if period_ms != wanted:
                node.notes.append(f"1017h:0: heartbeat every {period_ms} ms, {wanted} ms was refused")
            return
    yield from _refuse_heartbeat(node, longest, refusal)


def _refuse_heartbeat(node: NodeAccess, longest_ms: int, refusal: str) -> Steps[None]:
    """Raises BootError: it may take a longer period, which timeouts.drive_heartbeat_s allows."""
    problem = f"it takes no heartbeat period of at most {longest_ms} ms ({refusal})"
    taken_ms = 0
    for period_ms in HEARTBEAT_PERIODS_MS:
        if period_ms > longest_ms and (yield from node.tries(Write(HEARTBEAT_PRODUCER, 0, period_ms, 2))):
            taken_ms = period_ms
            break
    has_ms = (yield from node.read_if_present(HEARTBEAT_PRODUCER)) or taken_ms
    if longest_ms < has_ms <= HEARTBEAT_PERIODS_MS[-1]:
        key = f"`timeouts.drive_heartbeat_s: {HEARTBEATS_NEEDED * has_ms / 1000:g}`"
        raise BootError(node.node_id, problem, f"It keeps {has_ms} ms: set {key} in robot.yaml")
    tool = f"set 1017h:0 to 1 to {longest_ms} with the manufacturer's tool"
    none = (
        f"Nor any up to {HEARTBEAT_PERIODS_MS[-1]} ms: {tool}, or, {GUARDING_ALONE}; without either it cannot be used"
    )
    raise BootError(node.node_id, problem, none)


def _be_guarded(node: NodeAccess, timeout_s: float) -> Steps[bool]:
    """100Ch, 100Dh: the drive monitors the requests of the watchdog. Monitoring begins with the first one (CiA 301).

    A node that produces heartbeats does not answer them. Raises BootError when the drive keeps other values.
    """
    yield from node.set_if_present(Write(HEARTBEAT_PRODUCER, 0, 0, 2))
    yield from node.set(Write(GUARD_TIME, 0, guard_time_ms(timeout_s), 2), unread=True)
    yield from node.set(Write(LIFE_TIME, 0, LIFE_TIME_FACTOR, 1), unread=True)
    return True


def _watch_heartbeats(node: NodeAccess, kind: Profile, timeout_ms: int) -> Steps[bool]:
    """With one entry the drive watches the watchdog, which stops its heartbeat when the driver's stops. True: it is
    watched.

    No node may be in two entries, so those of an earlier life go first.
    """
    known = kind.self_stop.heartbeat_entries
    entries = 0 if known == 0 else (yield from node.read_if_present(HEARTBEAT_CONSUMER)) or 0
    if entries == 0:
        guarding = "where it has node guarding, set `self_stop.node_guarding: true` in its drive profile"
        node.notes.append(f"1016h: the drive monitors no heartbeat, and none stops it; {guarding}")
        return False
    watchdog, driver = (node_id << 16 | timeout_ms for node_id in (WATCHDOG_NODE_ID, DRIVER_NODE_ID))
    if entries == 2 and node.was_reset and (yield from _takes(node, watchdog, driver)):
        return True
    left: int | None = None
    for sub in range(2, entries + 1):
        entry = yield from node.read_if_present(HEARTBEAT_CONSUMER, sub)
        is_ours = sub == 2 and entry == driver
        if entry and not is_ours:
            yield from node.set_if_present(Write(HEARTBEAT_CONSUMER, sub, 0, 4), known=entry)
        elif sub == 2:
            left = entry
    is_watched = yield from node.set_if_present(Write(HEARTBEAT_CONSUMER, 1, watchdog, 4))
    if entries > 1:
        yield from node.set_if_present(Write(HEARTBEAT_CONSUMER, 2, driver, 4), known=left)
    return is_watched


def _takes(node: NodeAccess, *entries: int) -> Steps[bool]:
    """1016h:1, 1016h:2 as most drives have it after a reset: empty. False: refused, or not kept."""
    try:
        for sub, entry in enumerate(entries, start=1):
            yield from node.set(Write(HEARTBEAT_CONSUMER, sub, entry, 4), unread=True)
    except (SdoAborted, BootError):
        return False
    return True


def _as_proven(node: NodeAccess, drives: tuple[Drive, ...], robot: Robot) -> Steps[SelfStopSet]:
    """What commissioning has seen these drives do, where the boot cannot set or read what makes them stop.

    What it can set, and was refused, made no drive stop: then the proof was about another state of the drive.
    """
    own = drives[0].kind.self_stop
    is_ours = own.node_guarding or (own.vendor_watchdog is not None and own.vendor_watchdog.index is not None)
    if is_ours or not is_proven(robot) or (yield from _could_watch(node, drives[0])):
        return STOPS_BY_NOTHING
    return SelfStopSet(StopsBy.AS_PROVEN, StopsBy.AS_PROVEN.value)


def _could_watch(node: NodeAccess, drive: Drive) -> Steps[bool]:
    """It has both objects that make it stop for a lost heartbeat: one of them was refused."""
    own, option = drive.kind.self_stop, on_loss(drive)
    if own.heartbeat_entries == 0 or own.abort_connection == "no":
        return False
    entries = yield from node.read_if_present(HEARTBEAT_CONSUMER)
    return bool(entries) and (yield from node.read_if_present(option.index, option.sub)) is not None


def _set_vendor_watchdog(node: NodeAccess, kind: Profile, robot: Robot) -> Steps[str]:
    """The manufacturer's own command timeout; what is not proven to stop the motor is only noted."""
    watchdog, timeout_s = kind.self_stop.vendor_watchdog, robot.timeouts.drive_heartbeat_s
    if watchdog is None:
        return ""
    if watchdog.index is None:
        node.notes.append(
            f"the drive's own watchdog: {watchdog.text}; it needs {1000 * timeout_s:.0f} ms "
            "(timeouts.drive_heartbeat_s); canbase setup commission proves it"
        )
        return ""
    write = Write(watchdog.index, watchdog.sub, round(watchdog.per_s * timeout_s), watchdog.bits // 8)
    if not (yield from node.set_if_present(write)):
        return ""
    if kind.is_unproven("self_stop.vendor_watchdog") and not is_proven(robot):
        node.notes.append(
            f"{write}: {watchdog.text} is set, but not proven to stop the motor: canbase setup commission proves it"
        )
        return ""
    return f"{watchdog.text} ({write})"
