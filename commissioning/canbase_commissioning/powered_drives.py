"""The drives under a tool that moves them slowly: boot, both heartbeats, setpoints, SYNC, every way to the stop. Pure.

It stands in for driver and watchdog at once, with the driver's own parts, and must be alone on the bus: a frame of
another master ends it. Nothing moves unless `speeds_mps` orders it, and each exit goes through `safe_stop.py`.
"""

from __future__ import annotations

import math

from canbase_commissioning.session import NodeTask
from canbase_commissioning.wheel_probe import Sample
from canbase_config.object_map import CONTROLWORD, Place, place
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID, Robot
from canbase_config.watchdog import guard_time_ms
from canbase_driver.boot.sequence import BootReport
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import (
    EMCY,
    HEARTBEAT,
    NMT,
    SDO_TO_CLIENT,
    SDO_TO_SERVER,
    NmtCommand,
    NmtState,
    SyncProducer,
    heartbeat,
    nmt,
)
from canbase_driver.cia301.node_guarding import guard_request
from canbase_driver.cia402 import DriveState, PowerGoal
from canbase_driver.drives.axis import Axis
from canbase_driver.drives.canopen_node import CanopenNode, Presence

BEATS_PER_TIMEOUT = 3
RAMP_MPS2 = 0.2
"""A tool is in no hurry: the rim's speed changes so fast at most, and never faster than limits.acceleration_mps2."""
RUNAWAY_FACTOR, RUNAWAY_MPS = 2.0, 0.1
"""A wheel faster than factor × the order + this does not follow its order."""
STEP_MAX_S = 0.05
SILENT_CYCLES = 30
"""SYNCs without all of 6041h, 6064h and 606Ch (6044h in mode 2). Cycles are counted and not seconds, so that a pause of
this computer is not the drive's."""
WINDOW_S = 0.2
"""Speed by the encoder is taken over this time [s]."""
RESET_CYCLES = 5


class RigError(Exception):
    """The drives do not follow their orders, or another master commands them. Everything stops."""


class PoweredDrives:
    """All drives of a robot. Give it every frame, and call `tick` at least every 10 ms: it is due when it sends."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.nodes = {drive.node_id: CanopenNode(drive.node_id, robot, identify=True) for drive in robot.drives}
        self.axes: dict[str, Axis] = {a.drive.joint: a for node in self.nodes.values() for a in node.axes}
        self.speeds_mps: dict[str, float] = {}
        """What is wanted of each wheel's rim, forward positive; those that are not in here have no power."""
        self.beats = {DRIVER_NODE_ID, WATCHDOG_NODE_ID}
        """The heartbeats that are sent; with that of the watchdog the node guarding requests to guarded drives."""
        self.is_mute = False
        """Nothing at all is sent: as if this computer had died."""
        self.has_ended = False
        self.on_trial = False
        """The drives are expected to stop by themselves: faults and lost nodes are no reason to end."""
        self.override: PowerGoal | None = None
        """For all drives, whatever speeds are wanted."""
        self.signs: dict[int, tuple[float, str]] = {}
        """By node: when it first reported that it misses us, and how. The caller clears it at the start of a trial."""
        self.probes: list[NodeTask[Sample]] = []
        """SDO readings that are under way, even while nothing else is sent."""
        self.now_s = -math.inf
        self.foreign = ""
        """The first sign of another master."""
        self._sync = SyncProducer(robot.bus.sync_counter)
        self._period_s = 1.0 / robot.rates.control_hz
        self._cycle_at = self._beat_at = self._guard_at = -math.inf
        self._guarded = [node.node_id for node in self.nodes.values() if node.profile.self_stop.node_guarding]
        self._guard_s = guard_time_ms(robot.timeouts.drive_heartbeat_s) / 1000.0
        self._targets_mps = dict.fromkeys(self.axes, 0.0)
        self._ramp_mps2 = min(RAMP_MPS2, robot.limits.acceleration_mps2)
        self._marks: dict[str, tuple[float, float]] = {}
        self._unanswered = dict.fromkeys(self.axes, 0)
        self._pending: list[Frame] = []
        self._resets_left = 0
        self._wants_reset = False

    # What there is

    @property
    def ready(self) -> bool:
        """Whether all drives are booted and send heartbeats."""
        return all(node.presence is Presence.READY for node in self.nodes.values())

    def waiting_for(self) -> str:
        """What keeps it from being ready, for people."""
        return "; ".join(filter(None, (n.waiting_for(self.now_s) or n.absent() for n in self.nodes.values())))

    def report(self, joint: str) -> BootReport | None:
        """What the boot of a wheel's drive found; None: it is not booted."""
        return self.nodes[self.axes[joint].drive.node_id].report

    def enabled(self, joint: str) -> bool:
        """Whether a wheel has power and obeys."""
        return self.axes[joint].state is DriveState.OPERATION_ENABLED

    @property
    def powered(self) -> bool:
        """Whether any wheel may have power, as far as is known."""
        return any(axis.state is not None and axis.state.has_torque for axis in self.axes.values())

    @property
    def standing(self) -> bool:
        """Whether no wheel turns, as far as is known. A wheel that gives no feedback any more may turn."""
        still = self.robot.base.standstill_mps
        return not self._silent and all(abs(axis.velocity_mps) < still for axis in self.axes.values())

    @property
    def _silent(self) -> list[str]:
        """Wheels whose status or velocity no longer comes, or is too short to be read."""
        return [joint for joint, count in self._unanswered.items() if count > SILENT_CYCLES]

    @property
    def faults(self) -> list[str]:
        """Wheels whose drive is in fault, with the last emergency message of its node."""
        bad = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)
        broken = [axis for axis in self.axes.values() if axis.state in bad]
        return [f"{axis.drive.joint}: fault {self.nodes[axis.drive.node_id].emcy_text()}".rstrip() for axis in broken]

    # What to do

    def begin(self) -> None:
        """Boot what is not booted."""
        for node in self.nodes.values():
            node.begin_boot(self.now_s)

    def reboot(self) -> None:
        """After a self-stop: everything from the start, faults and lost heartbeats forgotten."""
        self.beats = {DRIVER_NODE_ID, WATCHDOG_NODE_ID}
        self.is_mute = False
        self.speeds_mps = {}
        self.override = None
        self.on_trial = False
        self.probes.clear()
        self._targets_mps = dict.fromkeys(self.axes, 0.0)
        self._unanswered = dict.fromkeys(self.axes, 0)
        self._marks = {}
        for node in self.nodes.values():
            node.lose("is booted anew", self.now_s)
            node.forget_emcy()
        self._wants_reset = True
        self.begin()

    # The bus

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """Take a frame of somebody else."""
        self.now_s = now_s
        function, node_id = frame.cob_id & 0x780, frame.cob_id & 0x7F
        if frame.cob_id in (NMT, HEARTBEAT + DRIVER_NODE_ID, HEARTBEAT + WATCHDOG_NODE_ID):
            self.foreign = self.foreign or f"frame {frame} comes from another master"
        node = self.nodes.get(node_id)
        if node is None:
            return
        if function == HEARTBEAT:
            node.on_heartbeat(frame, now_s)
        elif function == EMCY:
            node.on_emcy(frame, now_s)
        elif function == SDO_TO_CLIENT:
            node.on_sdo(frame, now_s)
            for probe in self.probes:
                self._pending += probe.on_frame(frame, now_s)
        else:
            self._on_pdo(node, frame, now_s)
        self._note_sign(node, now_s)
        if not self.is_mute:
            self._pending += node.tick(now_s)

    def _note_sign(self, node: CanopenNode, now_s: float) -> None:
        if node.emcy is not None:
            self.signs.setdefault(node.node_id, (now_s, f"EMCY {node.emcy_text()}"))
        elif node.nmt_state not in (None, NmtState.OPERATIONAL):
            self.signs.setdefault(node.node_id, (now_s, f"left NMT operational ({node.nmt_state.text})"))

    def _on_pdo(self, node: CanopenNode, frame: Frame, now_s: float) -> None:
        for axis in node.axes:
            if frame.cob_id == node.layout.status_cob_id(axis.drive.axis):
                node.on_status(axis, frame, now_s)
            elif frame.cob_id == node.layout.velocity_cob_id(axis.drive.axis):
                node.on_velocity(axis, frame, now_s)
            if axis.has_new_sample:
                axis.sample_taken()
                self._unanswered[axis.drive.joint] = 0

    def tick(self, now_s: float) -> list[Frame]:
        """The frames that are due. Raises RigError when a wheel runs away, or at a frame of another master."""
        self.now_s = now_s
        frames, self._pending = self._pending, []
        if self.has_ended:
            return []
        frames += [frame for probe in self.probes for frame in probe.tick(now_s)]
        if self.is_mute:
            return frames
        frames += self._heartbeats(now_s) + self._guard_requests(now_s)
        for node in self.nodes.values():
            frames += node.tick(now_s)
        if now_s - self._cycle_at >= self._period_s:
            dt_s = min(now_s - self._cycle_at, STEP_MAX_S)
            self._cycle_at = now_s
            frames += self._cycle(dt_s)
        self._check()
        return frames

    def _heartbeats(self, now_s: float) -> list[Frame]:
        if now_s - self._beat_at < self.robot.timeouts.drive_heartbeat_s / BEATS_PER_TIMEOUT - self._period_s / 2.0:
            return []
        self._beat_at = now_s
        return [heartbeat(node_id, NmtState.OPERATIONAL) for node_id in sorted(self.beats)]

    def _guard_requests(self, now_s: float) -> list[Frame]:
        if WATCHDOG_NODE_ID not in self.beats or now_s - self._guard_at < self._guard_s - self._period_s / 2.0:
            return []
        self._guard_at = now_s
        return [guard_request(node_id) for node_id in self._guarded]

    def _cycle(self, dt_s: float) -> list[Frame]:
        self._plan_reset()
        frames = []
        for node in self.nodes.values():
            if not node.has_pdos:
                continue
            goal = self._goal(node)
            for axis, word in zip(node.axes, node.controlwords(goal), strict=True):
                frames.append(axis.setpoint(goal, self._next_target(axis, dt_s), word))
                self._unanswered[axis.drive.joint] += 1
        return [*frames, self._sync.next()]

    def _plan_reset(self) -> None:
        """Fault reset is an edge: for RESET_CYCLES with the bit, for as many without."""
        if self._wants_reset and self.ready:
            self._resets_left = 2 * RESET_CYCLES if self.faults else 0
            self._wants_reset = False
        self._resets_left = max(0, self._resets_left - 1)

    def _goal(self, node: CanopenNode) -> PowerGoal:
        if self.override is not None:
            return self.override
        if self._resets_left >= RESET_CYCLES:
            return PowerGoal.RESET
        wanted = any(axis.drive.joint in self.speeds_mps for axis in node.axes)
        return PowerGoal.ON if wanted and not self._resets_left else PowerGoal.OFF

    def _next_target(self, axis: Axis, dt_s: float) -> float:
        """Zero until the drive is enabled, then the ramp."""
        joint = axis.drive.joint
        wanted = self.speeds_mps.get(joint, 0.0) if self.enabled(joint) else 0.0
        before, step = self._targets_mps[joint], self._ramp_mps2 * dt_s
        self._targets_mps[joint] = min(max(wanted, before - step), before + step) if self.enabled(joint) else 0.0
        return self._targets_mps[joint]

    def _check(self) -> None:
        if self.foreign:
            raise RigError(f"{self.foreign}: end it, these tools must be alone on the bus")
        if self.on_trial:
            return
        if self.speeds_mps and self._silent:
            raise RigError(f"{', '.join(self._silent)}: no status and velocity to {SILENT_CYCLES} SYNCs: power, cable?")
        if self.speeds_mps and (self.faults or not self.ready):
            raise RigError("; ".join([*self.faults, *filter(None, [self.waiting_for()])]) or "a drive is gone")
        limit_mps = RUNAWAY_FACTOR * max(map(abs, self._targets_mps.values())) + RUNAWAY_MPS
        for joint, axis in self.axes.items():
            fastest_mps = max(axis.velocity_mps, self._encoder_mps(joint, axis), key=abs)
            if abs(fastest_mps) > limit_mps:
                raise RigError(
                    f"{joint} turns at {fastest_mps:.2f} m/s, ordered were {self._targets_mps[joint]:.2f} m/s: "
                    "check velocity_unit, gear_ratio and counts_per_motor_rev in robot.yaml"
                )

    def _encoder_mps(self, joint: str, axis: Axis) -> float:
        """606Ch has the unit of 60FFh: where that is wrong, only the encoder shows it."""
        since, travel_m = self._marks.setdefault(joint, (self.now_s, axis.travel.travel_m))
        if self.now_s - since < WINDOW_S:
            return 0.0
        self._marks[joint] = (self.now_s, axis.travel.travel_m)
        return (axis.travel.travel_m - travel_m) / (self.now_s - since)

    # The ways out

    def stop_frames(self) -> list[Frame]:
        """Quick stop for all axes in any state. Needs no knowledge, cannot fail."""
        frames = []
        for node in self.nodes.values():
            for axis, word in zip(node.axes, node.controlwords(PowerGoal.QUICK_STOP), strict=True):
                frames.append(axis.setpoint(PowerGoal.QUICK_STOP, 0.0, word))
        return [*frames, self._sync.next()]

    def off_frames(self) -> list[Frame]:
        """Voltage off for all axes, then an NMT reset of their communication: a lost heartbeat is no fault then."""
        frames = []
        for node in self.nodes.values():
            for axis, word in zip(node.axes, node.controlwords(PowerGoal.OFF), strict=True):
                frames.append(axis.setpoint(PowerGoal.OFF, 0.0, word))
        return [*frames, self._sync.next()]

    def end_frames(self) -> list[Frame]:
        """The last frames to each node: voltage off by SDO, pre-operational, and an NMT reset of its communication.

        Forgotten is 1016h too: a drive must not report a lost heartbeat after an orderly end. One that may still have
        power keeps it, so that it stops by itself.
        """
        self.has_ended = True
        frames = [_voltage_off(node_id, at) for node_id, at in self._controlword_places()]
        frames += [nmt(NmtCommand.ENTER_PRE_OPERATIONAL, node_id) for node_id in self.nodes]
        if self.powered or not self.standing:
            return frames
        return frames + [nmt(NmtCommand.RESET_COMMUNICATION, node_id) for node_id in self.nodes]

    def _controlword_places(self) -> list[tuple[int, Place]]:
        drives = [axis.drive for axis in self.axes.values()]
        found = [(drive.node_id, place(drive.kind, CONTROLWORD, drive.axis)) for drive in drives]
        return list(dict.fromkeys(found))


def _voltage_off(node_id: int, at: Place) -> Frame:
    """Expedited SDO download of 6040h = 0 (CiA 301), without waiting for its answer."""
    return Frame(SDO_TO_SERVER + node_id, bytes((0x2B, at.index & 0xFF, at.index >> 8, at.sub, 0, 0, 0, 0)))
