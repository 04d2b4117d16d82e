"""All drives of the base as one: what keeps them from being ready, whether they stand, how far each side has rolled.

Sentences name joint, node and values and are empty when there is nothing to report. No decisions: `state_machine.py`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import partial

from canbase_config.bus_load import values_bits_per_s
from canbase_config.robot import Robot
from canbase_driver.boot.advice import ELSE_UNUSABLE
from canbase_driver.boot.scale_check import whole_range
from canbase_driver.boot.sdo_budget import SdoBudget
from canbase_driver.cia301.emcy import emcy_text
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import NMT
from canbase_driver.cia402 import INTERNAL_LIMIT, PREPARED, REMOTE, WARNING, DriveState
from canbase_driver.drives.axis import Axis
from canbase_driver.drives.canopen_node import CanopenNode, Presence
from canbase_driver.drives.drive_snapshot import DriveSnapshot

NO_CODE = "no code given: see canbase bus emcy, its display or the manufacturer's tool"
WHY_DISABLED = {
    DriveState.SWITCH_ON_DISABLED: " (STO, main voltage?)",
    DriveState.READY_TO_SWITCH_ON: " (STO, main voltage?)",
    DriveState.SWITCHED_ON: " (an input that enables it, or a brake that opens slowly?)",
    DriveState.QUICK_STOP_ACTIVE: " (stop frames of canbase, a limit switch, or another input?)",
}
"""Where to look when a drive that shall have power has this state."""


class Drives:
    """Nodes by node id, axes in the order of robot.yaml."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.nodes = tuple(CanopenNode(node_id, robot) for node_id in sorted({drive.node_id for drive in robot.drives}))
        values_bits = values_bits_per_s(robot) / robot.rates.control_hz
        self._budget = SdoBudget(robot.bus, 1.0 / robot.rates.control_hz, values_bits)
        self._first = 0
        for node in self.nodes:
            node.others_are_configured = partial(self._are_configured_without, node)
        by_joint = {axis.drive.joint: axis for node in self.nodes for axis in node.axes}
        self.axes = tuple(by_joint[drive.joint] for drive in robot.drives)
        self.left = tuple(axis for axis in self.axes if axis.drive.side == "left")
        self.right = tuple(axis for axis in self.axes if axis.drive.side == "right")
        node_of = {node.node_id: node for node in self.nodes}
        self._with_node = tuple((node_of[axis.drive.node_id], axis) for axis in self.axes)
        self._feedback_s = robot.timeouts.feedback_s

    def _are_configured_without(self, node: CanopenNode) -> bool:
        return not any(other.is_being_configured for other in self.nodes if other is not node)

    def tick(self, now_s: float, may_boot: bool, sync_since: float) -> list[Frame]:
        """Once a cycle: every node goes on, another one first each time; those that are gone begin their boot, those
        that send nothing are looked for. `sync_since`: start of the present run of SYNCs [s].
        """
        self._share_the_bus(now_s)
        self._first = (self._first + 1) % len(self.nodes)
        frames: list[Frame] = []
        for node in (*self.nodes[self._first :], *self.nodes[: self._first]):
            frames += self.go_on(node, now_s)
            if may_boot:
                node.seek(now_s, sync_since)
                node.begin_boot(now_s)
        return frames

    def go_on(self, node: CanopenNode, now_s: float) -> list[Frame]:
        """What a node sends next; while it is being configured, only what the bus has room for."""
        if node.presence is not Presence.BOOTING:
            return node.tick(now_s)
        if node.is_being_configured and self._budget.is_spent(node.node_id):
            return []
        frames = node.tick(now_s)
        self._budget.spend(node.node_id, sum([frame.cob_id != NMT for frame in frames]))
        return frames

    def _share_the_bus(self, now_s: float) -> None:
        booting = [node for node in self.nodes if node.presence is Presence.BOOTING]
        if booting:
            running_axes = sum([len(node.axes) for node in self.nodes if node.has_pdos])
            transfers = {node.node_id: node.transfers for node in booting if node.is_transferring(now_s)}
            self._budget.refill(running_axes, transfers)

    @property
    def are_ready(self) -> bool:
        """`booting`, `missing` and `absent` are empty for every node."""
        for node in self.nodes:  # noqa: SIM110 - every cycle
            if node.presence is not Presence.READY:
                return False
        return True

    @property
    def are_enabled(self) -> bool:
        """`fault`, `disabled` and `unprepared` are empty for every axis."""
        for axis in self.axes:  # noqa: SIM110 - every cycle
            if axis.state is not DriveState.OPERATION_ENABLED:
                return False
        return True

    def booting(self, now_s: float) -> str:
        """What a node that is being booted or started is waiting for."""
        return _first(node.waiting_for(now_s) for node in self.nodes)

    def missing(self, now_s: float) -> str:
        """Which node could not be booted for timeouts.boot_s, and why."""
        return _first(node.missing(now_s) for node in self.nodes)

    def without_self_stop(self) -> str:
        """Which node has refused at its boot what makes it stop by itself."""
        return _first(node.without_self_stop() for node in self.nodes)

    def absent(self) -> str:
        """Why a node must be booted again."""
        return _first(node.absent() for node in self.nodes)

    def silent(self, now_s: float, sync_since: float) -> str:
        """Which node gives no fresh status or heartbeat. `sync_since`: start of the present run of SYNCs [s]."""
        for node in self.nodes:
            if problem := node.silent(now_s, sync_since):
                return problem
        return ""

    def fault(self) -> str:
        """Which axis is in fault or in its reaction to one, and the code that the drive gave."""
        return _first(_fault(node) for node in self.nodes)

    def disabled(self) -> str:
        """Which axis is not in operation enabled."""
        return _first(_disabled(axis) for axis in self.axes)

    def unprepared(self) -> str:
        """Which axis is not switched on yet, and the likely reason."""
        return _first(_unprepared(node, axis) for node, axis in self._with_node)

    def are_fresh(self, now_s: float) -> bool:
        """Every axis has given all its values in time."""
        return all(self._is_fresh(axis, now_s) for axis in self.axes)

    def stand(self, now_s: float) -> bool:
        """Measured, fresh, and evidence: no wheel turns."""
        for axis in self.axes:  # noqa: SIM110 - every cycle
            if not axis.stands(now_s):
                return False
        return True

    def are_proven_to_stand(self, now_s: float) -> bool:
        """What motor_driver/status reports: no wheel turns, and none may be rolling with a dead encoder."""
        return all(axis.is_proven_to_stand(now_s) for axis in self.axes)

    def rest(self, left_mps: float, right_mps: float) -> bool:
        """Nothing is ordered of any wheel, and these speeds of the rims order nothing either."""
        for axis in self.axes:  # noqa: SIM110 - every cycle
            if not axis.rests(left_mps if axis.is_left else right_mps):
                return False
        return True

    def turning(self, now_s: float) -> str:
        """Which wheel is not at standstill, and the evidence; empty: all are."""
        return _first(self._turning(axis, now_s) for axis in self.axes)

    def stalled(self) -> str:
        """Which wheel has stalled for longer than it may, and the evidence."""
        for axis in self.axes:
            if axis.stall.is_over:
                return _of(axis, axis.stall.sentence)
        return ""

    def wrapping(self) -> str:
        """Which wheel's position wraps within less than its 32 bits, so that the odometry misses travel."""
        for axis in self.axes:
            if counts := axis.travel.wraps_by:
                about = f"{float(f'{counts:.2g}'):.0f}"
                return (
                    f"{_place(axis)}: 6064h has jumped twice by about {about} counts: it wraps there, and the odometry "
                    f"misses travel. Let it count in 32 bits: {whole_range(axis.drive)}; {ELSE_UNUSABLE}"
                )
        return ""

    def stalling(self, node_id: int) -> str:
        """Which wheel of this node stalls now, however short, and the evidence; empty: none."""
        return _first(
            _of(axis, axis.stall.sentence)
            for axis in self.axes
            if axis.drive.node_id == node_id and axis.stall.time_s > 0.0
        )

    def contradiction(self, node_id: int) -> str:
        """Which wheel's position and velocity contradict each other by a factor or in their sign, and what to do; of
        this node first."""
        for axis in sorted(self.axes, key=lambda axis: axis.drive.node_id != node_id):
            if sentence := axis.factor.sentence:
                return f"{axis.drive.joint} (node {axis.drive.node_id}): {sentence}"
        return ""

    def unshown_mode(self, node_id: int) -> str:
        """What the boot of this node noted about a mode that 6061h did not show; empty: nothing."""
        return _first(node.unshown_mode for node in self.nodes if node.node_id == node_id)

    def not_following(self, node_id: int) -> str:
        """Why an axis of this node (0: of any) may not follow, by its statusword and EMCY; empty: it says nothing."""
        for node, axis in self._with_node:
            if node_id not in (0, node.node_id):
                continue
            if not axis.statusword & REMOTE:
                return f"{_place(axis)} may be in local mode, which takes no commands (statusword bit 9)"
            if axis.statusword & INTERNAL_LIMIT:
                limits = "607Fh, 6080h, its current limit, or the load"
                return f"{_place(axis)}: a limit in the drive is active (statusword bit 11): {limits}"
            if code := node.emcy_text():
                return f"{_place(axis)} reports {code}"
        return ""

    def doubt(self, node_id: int, why: str) -> None:
        """What this node measures is no evidence: the watchdog has found it implausible."""
        for axis in self.axes:
            if axis.drive.node_id == node_id:
                axis.stillness.distrust(why)

    def doubted(self) -> str:
        """Which wheel's sensors are no evidence, and why; empty: none."""
        for axis in self.axes:
            if doubt := axis.stillness.doubt:
                return _of(axis, doubt)
        return ""

    def assumed(self, now_s: float) -> str:
        """Which wheel's standstill is assumed and not measured, and why; empty: none."""
        return _first(_of(axis, axis.stillness.assumed(now_s)) for axis in self.axes)

    def may_have_power(self, now_s: float) -> bool:
        """Some axis has torque, or has no fresh statusword."""
        for axis in self.axes:  # noqa: SIM110 - every cycle
            if axis.has_torque or now_s - axis.status_at > self._feedback_s:
                return True
        return False

    def have_references(self) -> bool:
        """The travel of every wheel is known since its first sample."""
        for axis in self.axes:  # noqa: SIM110 - every cycle
            if not axis.travel.referenced:
                return False
        return True

    def forget_emcys(self) -> None:
        """After a reset: what the drives reported before it is no news any more; some never take it back."""
        for node in self.nodes:
            node.forget_emcy()

    def forget_jumps(self) -> None:
        """Of positions, while nothing has power: somebody may push the base, and some drives count anew."""
        for axis in self.axes:
            axis.travel.forget_jumps()

    def losses(self) -> int:
        """How often the travel of some wheel went on from a new reference, since the start."""
        return sum([axis.losses for axis in self.axes])

    def travel_m(self) -> tuple[float, float]:
        """Travel of the rims, left and right, since the start [m]; several wheels on a side are averaged."""
        left, right = [axis.travel.travel_m for axis in self.left], [axis.travel.travel_m for axis in self.right]
        return sum(left) / len(left), sum(right) / len(right)

    def speeds_mps(self) -> tuple[float, float]:
        """Measured speeds of the rims, left and right [m/s]; several wheels on a side are averaged."""
        left, right = [axis.velocity_mps for axis in self.left], [axis.velocity_mps for axis in self.right]
        return sum(left) / len(left), sum(right) / len(right)

    def fastest(self) -> Axis:
        """The axis with the greatest measured speed."""
        fastest = self.axes[0]
        for axis in self.axes:
            if abs(axis.velocity_mps) > abs(fastest.velocity_mps):
                fastest = axis
        return fastest

    def braking_mps(self, now_s: float) -> float:
        """The greatest speed of a wheel with power that was measured in the last moments; 0: there is none [m/s]."""
        return max([abs(axis.velocity_mps) for axis in self.axes if self._is_driven(axis, now_s)], default=0.0)

    def _is_driven(self, axis: Axis, now_s: float) -> bool:
        """With power, by fresh values; or its speed alone is known, by SDO, and it may have power."""
        if axis.state is None:
            return now_s - axis.velocity_at <= self._feedback_s
        return axis.has_torque and self._is_fresh(axis, now_s)

    def snapshots(self, now_s: float) -> tuple[DriveSnapshot, ...]:
        """One per axis, in the order of robot.yaml."""
        return tuple(_snapshot(node, axis, now_s) for node, axis in self._with_node)

    def _turning(self, axis: Axis, now_s: float) -> str:
        if axis.stands(now_s):
            return ""
        joint, base = axis.drive.joint, self._robot.base
        if not self._is_fresh(axis, now_s):
            return f"{joint} has reported no velocity for {axis.age_s(now_s):.2f} s"
        if axis.stillness.doubt:
            return _of(axis, axis.stillness.unproven(now_s))
        return f"{joint} turns at {axis.velocity_mps:.3f} m/s (base.standstill_mps {base.standstill_mps:g})"

    def _is_fresh(self, axis: Axis, now_s: float) -> bool:
        return axis.age_s(now_s) <= self._feedback_s


def age_s(now_s: float, then: float) -> float:
    """Seconds since `then`; NaN when that never was (minus infinity)."""
    return now_s - then if then > -math.inf else math.nan


def _snapshot(node: CanopenNode, axis: Axis, now_s: float) -> DriveSnapshot:
    radius_m = axis.units.radius_m
    code = node.emcy.code if node.emcy else 0
    measured = node.measured(axis, now_s)
    share = math.nan if axis.torque_evidence.share is None else axis.torque_evidence.share * axis.drive.direction
    return DriveSnapshot(
        joint=axis.drive.joint,
        node_id=node.node_id,
        axis=axis.drive.axis,
        nmt_state=node.nmt_state,
        state=axis.state,
        statusword=axis.statusword,
        error_code=code,
        error_text=emcy_text(code, node.profile.emcy) if code else "",
        target_radps=axis.target_mps / radius_m,
        velocity_radps=axis.velocity_mps / radius_m,
        position_rad=axis.position_rad,
        feedback_age_s=age_s(now_s, axis.fed_at),
        heartbeat_age_s=age_s(now_s, node.heartbeat_at),
        stops_by_itself=node.report is not None and node.report.stops_by_itself,
        self_stop=node.report.self_stop.text if node.report else "",
        warning=bool(axis.statusword & WARNING),
        internal_limit=bool(axis.statusword & INTERNAL_LIMIT),
        voltage_v=measured.voltage_v,
        torque_share=share,
        effort_nm=share * (axis.drive.rated_torque_nm or math.nan) * axis.drive.gear_ratio,
        current_a=measured.current_a,
        temperature_c=measured.temperature_c,
        values=node.named_values(now_s),
        boot_notes=node.report.notes if node.report else (),
        boot_problem=node.boot_error,
        configured=node.report is not None,
        boot_changes=node.report.changes if node.report else (),
    )


def _fault(node: CanopenNode) -> str:
    for axis in node.axes:
        if axis.state in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE):
            return f"{axis.drive.joint} (node {node.node_id}): {node.emcy_text() or NO_CODE}"
    return ""


def _of(axis: Axis, what: str) -> str:
    return f"{axis.drive.joint} {what}" if what else ""


def _unprepared(node: CanopenNode, axis: Axis) -> str:
    if axis.state in PREPARED:
        return ""
    local = "" if axis.statusword & REMOTE else "; it is in local mode and ignores the controlword (statusword bit 9)"
    reports = f"; it reports {code}" if (code := node.emcy_text()) else ""
    why = "see its display" if axis.state is DriveState.NOT_READY_TO_SWITCH_ON else "STO, main voltage, RPDO1?"
    state = axis.state.text if axis.state else "no state known"
    return f"{_place(axis)} is in {state}; if it stays: {why}{reports}{local}"


def _disabled(axis: Axis) -> str:
    if axis.state is DriveState.OPERATION_ENABLED:
        return ""
    if axis.state is None:
        return f"{_place(axis)} is in no state known"
    return f"{_place(axis)} is {axis.state.text}{WHY_DISABLED.get(axis.state, '')}"


def _place(axis: Axis) -> str:
    return f"{axis.drive.joint} (node {axis.drive.node_id})"


def _first(sentences: Iterable[str]) -> str:
    return next((sentence for sentence in sentences if sentence), "")
