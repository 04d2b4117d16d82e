"""The watchdog proof: whether each drive stops by itself when no commands come any more, and how fast. Wheels up.

Two trials at a low speed. First this computer stops sending, as if it had failed; then only the watchdog's heartbeat is
missing, while setpoints go on, as at the last rung of the watchdog's ladder.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from canbase_commissioning.calibration import stop_time_s
from canbase_commissioning.guide import CommissionError, Script, Tell, Until, wait
from canbase_commissioning.powered_drives import PoweredDrives
from canbase_commissioning.session import NodeTask
from canbase_commissioning.wheel_probe import Sample, look, way_m
from canbase_config.drive import Drive
from canbase_config.robot import WATCHDOG_NODE_ID
from canbase_driver.boot.settings import StopsBy
from canbase_driver.cia301.sdo_client import SdoClient
from canbase_driver.cia402 import PowerGoal

SILENCE = "this computer stopped sending"
HEARTBEAT = "the watchdog's heartbeat stopped, with setpoints still sent"
SILENCE_S = 2.5
"""Nothing is sent for at least this long [s]: makers' own command timeouts are up to a second."""
STILL_S, STILL_M = 0.3, 0.002
"""It stands when it rolls less than this in this time."""
READY_S = 15.0
SPIN_S = 6.0
LATE_S = 0.3
"""A stop may take so much longer than heartbeat time and ramp: producer period, the drive's own clock, our reading."""
LOOK_TIMEOUT_S, LOOK_ATTEMPTS = 0.1, 5


@dataclass(frozen=True, slots=True)
class Outcome:
    """What one wheel did in one trial. Times in s since the trial began, way of the rim in m."""

    joint: str
    trial: str
    speed_mps: float
    stopped: bool
    time_s: float
    """When it stood; meaningless when it did not stop."""
    way_m: float
    limit_s: float
    sign: str
    """What the drive reported itself, and when; empty: nothing."""

    @property
    def is_late(self) -> bool:
        """It stopped, but later than heartbeat time and ramp explain."""
        return self.stopped and self.time_s > self.limit_s

    def __str__(self) -> str:
        if not self.stopped:
            return f"{self.joint} DID NOT STOP when {self.trial}: it rolled {abs(self.way_m):.2f} m and continued"
        said = f"; {self.sign}" if self.sign else ""
        after = f"{self.joint} was at standstill {self.time_s:.2f} s after {self.trial}"
        return f"{after}: {abs(self.way_m) * 1000:.0f} mm{said}"


def watches_watchdog(rig: PoweredDrives, joint: str) -> bool:
    """Whether the boot could set that the drive watches the watchdog's heartbeat (1016h), or its requests (100Ch)."""
    report = rig.report(joint)
    return report is not None and report.self_stop.by in (StopsBy.WATCHDOG_HEARTBEAT, StopsBy.NODE_GUARDING)


def prove(rig: PoweredDrives, speed_mps: float) -> Script[tuple[Outcome, ...]]:
    """Both trials; the second one with the drives that watch the watchdog. Raises CommissionError, RigError."""
    outcomes = yield from _silence(rig, speed_mps)
    yield from recover(rig)
    beating = [joint for joint in rig.axes if watches_watchdog(rig, joint)]
    if beating and all(outcome.stopped for outcome in outcomes):
        outcomes += yield from _without_heartbeat(rig, beating, speed_mps)
        yield from recover(rig)
    return tuple(outcomes)


def get_ready(rig: PoweredDrives) -> Script[None]:
    """Boots the drives. Raises CommissionError when they do not get ready."""
    rig.begin()
    held = yield Until(lambda _now: _begun(rig) and not rig.faults, READY_S)
    if not held:
        why = "; ".join(rig.faults) or rig.waiting_for() or "no reason is known"
        raise CommissionError(f"the drives were not ready within {READY_S:g} s: {why}. canbase doctor shows more")


def recover(rig: PoweredDrives) -> Script[None]:
    """After a trial: quick stop, then everything from the start."""
    rig.is_mute, rig.override = False, PowerGoal.QUICK_STOP
    yield Until(lambda _now: rig.standing, 1.0)
    yield wait(0.2)
    rig.reboot()
    yield from get_ready(rig)


def spin(rig: PoweredDrives, speeds_mps: Mapping[str, float]) -> Script[None]:
    """Brings wheels up to speed. Raises CommissionError when they do not get there."""
    rig.speeds_mps = dict(speeds_mps)
    fast = yield Until(lambda _now: all(_at_speed(rig, joint, v) for joint, v in speeds_mps.items()), SPIN_S)
    if not fast:
        slow = [joint for joint, v in speeds_mps.items() if not _at_speed(rig, joint, v)]
        states = ", ".join(f"{j}: {_state(rig, j)}, {rig.axes[j].velocity_mps:.3f} m/s" for j in slow)
        raise CommissionError(f"not up to speed ({states}): STO open, brake on, or limits set in the drive?")
    yield wait(0.3)


def _begun(rig: PoweredDrives) -> bool:
    rig.begin()
    return rig.ready


def _state(rig: PoweredDrives, joint: str) -> str:
    state = rig.axes[joint].state
    return "unknown state" if state is None else state.text


def _at_speed(rig: PoweredDrives, joint: str, speed_mps: float) -> bool:
    axis = rig.axes[joint]
    return rig.enabled(joint) and axis.velocity_mps * speed_mps > 0.0 and abs(axis.velocity_mps) > 0.8 * abs(speed_mps)


def _silence(rig: PoweredDrives, speed_mps: float) -> Script[list[Outcome]]:
    yield Tell(f"trial 1: {SILENCE}")
    yield from spin(rig, dict.fromkeys(rig.axes, speed_mps))
    before = yield from _looks(rig)
    began = _begin(rig)
    rig.is_mute = True
    yield wait(max(SILENCE_S, 2.0 * rig.robot.timeouts.drive_heartbeat_s + 1.0))
    after = yield from _looks(rig)
    yield wait(STILL_S)
    later = yield from _looks(rig)
    decel, outcomes = rig.robot.limits.emergency_deceleration_mps2, []
    for joint, axis in rig.axes.items():
        rolled_m = way_m(axis.drive, rig.robot, before[joint], after[joint])
        stopped = abs(way_m(axis.drive, rig.robot, after[joint], later[joint])) < STILL_M
        at_s = stop_time_s(abs(rolled_m), speed_mps, decel)
        outcomes.append(_outcome(rig, joint, SILENCE, speed_mps, began, stopped, at_s, rolled_m))
    return outcomes


def _without_heartbeat(rig: PoweredDrives, joints: list[str], speed_mps: float) -> Script[list[Outcome]]:
    yield Tell(f"trial 2: {HEARTBEAT}")
    yield from spin(rig, dict.fromkeys(joints, speed_mps))
    before = yield from _looks(rig)
    began = _begin(rig)
    rig.beats = rig.beats - {WATCHDOG_NODE_ID}
    stood: dict[str, tuple[float, Sample]] = {}
    last = before
    while len(stood) < len(joints) and rig.now_s < began + SILENCE_S:
        last = yield from _looks(rig)
        for joint in joints:
            if abs(last[joint].velocity_mps) < rig.robot.base.standstill_mps:
                stood.setdefault(joint, (rig.now_s - began, last[joint]))
            else:
                stood.pop(joint, None)
    outcomes = []
    for joint in joints:
        at_s, sample = stood.get(joint, (rig.now_s - began, last[joint]))
        rolled_m = way_m(rig.axes[joint].drive, rig.robot, before[joint], sample)
        outcomes.append(_outcome(rig, joint, HEARTBEAT, speed_mps, began, joint in stood, at_s, rolled_m))
    return outcomes


def _begin(rig: PoweredDrives) -> float:
    """When the trial begins."""
    rig.on_trial = True
    rig.signs.clear()
    return rig.now_s


def _outcome(
    rig: PoweredDrives,
    joint: str,
    trial: str,
    speed_mps: float,
    began: float,
    stopped: bool,
    time_s: float,
    rolled_m: float,
) -> Outcome:
    robot = rig.robot
    ramp_s = speed_mps / robot.limits.emergency_deceleration_mps2
    limit_s = robot.timeouts.drive_heartbeat_s + ramp_s + LATE_S
    sign = rig.signs.get(rig.axes[joint].drive.node_id)
    said = f"reported {sign[1]} after {sign[0] - began:.2f} s" if sign and sign[0] >= began else ""
    return Outcome(
        joint=joint,
        trial=trial,
        speed_mps=speed_mps,
        stopped=stopped,
        time_s=time_s,
        way_m=rolled_m,
        limit_s=limit_s,
        sign=said,
    )


def _looks(rig: PoweredDrives) -> Script[dict[str, Sample]]:
    """One look at each wheel, node by node at once, axis by axis of a node."""
    found: dict[str, Sample] = {}
    for number in range(2):
        drives = [axis.drive for axis in rig.axes.values() if _turn(rig, axis.drive) == number]
        found |= yield from _looks_at(rig, drives)
    return found


def _turn(rig: PoweredDrives, drive: Drive) -> int:
    """A node has one SDO channel: its axes are read one after the other."""
    first = min(axis.drive.axis for axis in rig.nodes[drive.node_id].axes)
    return int(drive.axis != first)


def _looks_at(rig: PoweredDrives, drives: list[Drive]) -> Script[dict[str, Sample]]:
    if not drives:
        return {}
    tasks = {
        drive.joint: NodeTask(look(drive, rig.robot), SdoClient(drive.node_id, LOOK_TIMEOUT_S, LOOK_ATTEMPTS))
        for drive in drives
    }
    rig.probes[:] = tasks.values()
    yield Until(lambda _now: all(task.done for task in tasks.values()), 2.0)
    rig.probes.clear()
    silent = [f"{joint}: {task.error or 'no answer'}" for joint, task in tasks.items() if task.result is None]
    if silent:
        raise CommissionError(f"what the wheels do cannot be read: {'; '.join(silent)}")
    return {joint: task.result for joint, task in tasks.items() if task.result is not None}
