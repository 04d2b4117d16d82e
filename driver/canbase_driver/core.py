"""The motor driver without bus, clock and ROS: frames and commands in, frames and snapshots out.

One cycle is `tick`: heartbeat, boots, the state machine's judgement, a reset on its way, the setpoints of all axes,
SYNC. The reasons to stop are in `hazards.py`, the boot of a node in `sequence.py`, the limits of the speed in
`limiter.py`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from functools import partial

from canbase_base.latch_record import Found, Record
from canbase_config import stopping
from canbase_config.commissioned import without_proof
from canbase_config.robot import DRIVER_NODE_ID, Robot
from canbase_config.watchdog import HEARTBEATS_PER_TIMEOUT
from canbase_driver.causes import DriverCause, Finding
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import (
    EMCY,
    HEARTBEAT,
    NMT,
    SDO_TO_CLIENT,
    NmtCommand,
    NmtState,
    SyncProducer,
    heartbeat,
    nmt,
)
from canbase_driver.cia402 import PowerGoal
from canbase_driver.drives.axis import Axis
from canbase_driver.drives.canopen_node import CanopenNode
from canbase_driver.drives.drive_group import Drives
from canbase_driver.drives.odometry_feed import OdometryFeed
from canbase_driver.drives.release_test import ReleaseTest
from canbase_driver.motion.braking import Braking
from canbase_driver.motion.kinematics import Twist2D, wheel_speeds
from canbase_driver.motion.limiter import Limiter, MotionState
from canbase_driver.motion.odometry import Pose2D
from canbase_driver.motion.velocity_command import VelocityCommand
from canbase_driver.snapshot import DriverSnapshot
from canbase_driver.supervision.bus_health import BusReport
from canbase_driver.supervision.cycle_stats import CycleStats
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_driver.supervision.latch import PowerRecord, allowed_before_the_start, finding_before_the_start
from canbase_driver.supervision.lifecycle import Aim, Lifecycle
from canbase_driver.supervision.phases import NO_POWER, Drive, Orders
from canbase_driver.supervision.reset_run import ResetRun
from canbase_driver.supervision.situation import Situation
from canbase_driver.supervision.state_machine import StateMachine
from canbase_driver.supervision.stop_history import StopRecord
from canbase_driver.supervision.watchdog_link import COUNTERS_COB_ID, STATE_COB_ID, WatchdogLink
from canbase_runtime.driver_state import DriverState
from canbase_runtime.watchdog_view import WatchdogView

FARTHEST = 1e6
"""Of a pose that is set [m, rad]: beyond it steps of a millimetre begin to get lost."""
PAUSE = 0.5
"""A cycle that begins so late, in parts of timeouts.feedback_s, begins a new run of SYNCs."""
LONGEST_CYCLE_S = 1.0
"""A cycle after a longer gap, and the first one, counts as this long. The limiter takes less of it for its ramp."""

HEALTHY = BusReport()

Handler = Callable[[Frame, float], bool]


class DriverCore:
    """The whole driver as one object. Time is an argument [s, monotonic]."""

    def __init__(self, robot: Robot, aim: Aim = Aim.ACTIVE, on_disk: Found | None = None) -> None:
        """`aim`: how far it goes by itself. `on_disk`: the record of its stops at the start; None: no record is kept,
        which is for virtual time alone."""
        self._robot = robot
        self._readiness = Lifecycle(robot, aim, allowed_before_the_start(on_disk))
        self._period_s = 1.0 / robot.rates.control_hz
        self._drives = Drives(robot)
        self._sync = SyncProducer(robot.bus.sync_counter)
        self._watchdog = WatchdogLink(robot.timeouts.watchdog_s)
        self._standstill_s = stopping.standstill_s(robot)
        self._track_m, self._feedback_s = robot.base.track_m, robot.timeouts.feedback_s
        self._heartbeat_s = robot.timeouts.drive_heartbeat_s / HEARTBEATS_PER_TIMEOUT - self._period_s / 2.0
        self._state_machine = StateMachine(Braking(robot), self._standstill_s, finding_before_the_start(on_disk))
        self._record = PowerRecord(on_disk)
        self._release_test = ReleaseTest(robot)
        self._limiter = Limiter(robot.limits, robot.base.track_m)
        self._feed = OdometryFeed(self._drives, robot)
        self._command = VelocityCommand(robot.timeouts.command_s)
        self._stats = CycleStats(self._period_s)
        self._motion = MotionState.AT_REST
        self._eased_at = math.inf
        """When motion was last ordered, or standstill measured; infinity before the first standstill."""
        self._needs_proof = robot.safety.require_self_stop and not robot.bus.is_virtual
        self._unproven = without_proof(robot) if self._needs_proof else ""
        self._reset = ResetRun(self._watchdog, self._period_s, robot.timeouts.boot_s)
        self._bus_problem = self._clue = ""
        self._stop_requested = self._shutdown_requested = False
        self._heartbeat_at = self._ticked_at = -math.inf
        self._sync_since = -math.inf
        """Start of the present run of SYNCs without a pause: before it a drive had no SYNC to answer."""
        self._handlers = self._dispatch_table()
        self._bus_report = HEALTHY
        self.frames_dropped = 0
        self.stops: deque[StopRecord] = deque(maxlen=64)
        """Stops since they were last taken out, oldest first."""

    @property
    def aim(self) -> Aim:
        """How far it goes."""
        return self._readiness.aim

    @property
    def finished(self) -> bool:
        """A shutdown was requested, and nothing has power any more."""
        return self._state_machine.finished

    @property
    def state(self) -> DriverState:
        """State of the driver."""
        return self._state_machine.state

    @property
    def finding(self) -> Finding:
        """Why it is not enabled."""
        return self._state_machine.finding

    @property
    def lets_go(self) -> bool:
        """It is ENABLED, and has taken the power off for a moment, as a stand with torque is no proof of itself."""
        return self._release_test.active

    @property
    def record(self) -> Record:
        """What shall be on disk now about its stops."""
        return self._record.wanted

    def on_record(self, written: Record | None, problem: str) -> None:
        """The newest record on disk (None: none since the start), and what keeps the writer from writing."""
        self._record.on_written(written, problem)

    @property
    def odometry_serial(self) -> int:
        """Grows by one with each sample that entered the odometry."""
        return self._feed.serial

    def on_frame(self, frame: Frame, now_s: float) -> list[Frame]:
        """Take a frame from the bus; the frames to send at once (the boot's next request). Never raises."""
        handler = self._handlers.get(frame.cob_id)
        if handler is None:
            return []
        take, node = handler
        self.frames_dropped += not take(frame, now_s)
        return self._drives.go_on(node, now_s) if node is not None else []

    def accept_velocity_command(self, twist: Twist2D, received_at: float) -> bool:
        """Take a velocity command with its receive time. False, and counted: it was not finite."""
        return self._command.accept(twist, received_at)

    def on_bus(self, problem: str, now_s: float, report: BusReport = HEALTHY) -> None:
        """The bus failed (a sentence), or works (empty); after a failure every node is booted again."""
        self._bus_report = report
        if self._bus_problem and not problem:
            self._lose_all("was cut off from the bus", now_s)
        self._bus_problem = problem

    def on_suspend(self, now_s: float) -> None:
        """The computer was suspended, which no age contains: nothing received counts, every node boots again, and a
        reset on its way is broken off."""
        self._reset.end(RequestOutcome(False, "broken off: the computer was suspended; reset again"))
        self._lose_all("was not supervised while the computer was suspended", now_s)

    def _lose_all(self, why: str, now_s: float) -> None:
        for node in self._drives.nodes:
            node.lose(why, now_s)

    def request_stop(self) -> None:
        """Ramp to a stand, take the power away, stay there until a reset. A reset on its way is broken off."""
        self._stop_requested = True
        self._reset.end(RequestOutcome(False, "broken off: service motor_driver/stop"))

    def request_shutdown(self) -> None:
        """Ramp to a stand, take the power away, then be `finished`. A reset on its way is broken off."""
        self._shutdown_requested = True
        self._reset.end(RequestOutcome(False, "broken off: motor_driver is shutting down"))

    def request_reset(self, now_s: float, on_outcome: Callable[[RequestOutcome], None]) -> None:
        """Begin a reset; `on_outcome` is called once, at once when it is refused."""
        if self._reset.begin(self._situation(now_s), self._state_machine.state, now_s, on_outcome):
            for node in self._drives.nodes:
                node.clear_lost_heartbeat(now_s)

    def request_aim(self, aim: Aim, now_s: float, on_outcome: Callable[[RequestOutcome], None]) -> None:
        """Go so far; `on_outcome` is called once, when it is there or has failed. What takes power away is obeyed in a
        shutdown too: the record then keeps it off over the next start."""
        if self._shutdown_requested and aim >= self._readiness.aim:
            on_outcome(RequestOutcome(False, "refused: motor_driver is shutting down"))
        else:
            self._readiness.request(aim, now_s, on_outcome)

    def set_pose(self, pose: Pose2D, now_s: float) -> RequestOutcome:
        """The odometry goes on from `pose`, with the covariance of a fresh start. Refused in motion."""
        commanded = self._command.motion(now_s)
        if not all(abs(value) <= FARTHEST for value in (pose.x_m, pose.y_m, pose.yaw_rad)):
            return RequestOutcome(False, f"refused: {pose}: expected x, y and yaw between ±{FARTHEST:.0f} (m, rad)")
        if commanded or not self._drives.stand(now_s):
            return RequestOutcome(
                False, f"refused: {commanded or self._drives.turning(now_s)}; a pose is set at a standstill"
            )
        self._feed.set_pose(pose)
        return RequestOutcome(
            True, f"odometry continues from x {pose.x_m:.3f} m, y {pose.y_m:.3f} m, yaw {pose.yaw_rad:.3f} rad"
        )

    def tick(self, now_s: float, lateness_s: float = 0.0) -> list[Frame]:
        """One cycle; the frames to send, in this order. `lateness_s`: how late it began."""
        if now_s - self._ticked_at > PAUSE * self._feedback_s:
            self._sync_since = now_s
        dt_s = min(now_s - self._ticked_at, LONGEST_CYCLE_S)
        self._ticked_at = now_s
        self._stats.note(now_s, lateness_s)
        frames = self._heartbeat(now_s)
        if not self._readiness.released:
            ends = self._shutdown_requested or self._readiness.unconfigured
            may_boot = self._state_machine.state in NO_POWER and not ends
            asked_since = now_s if self._bus_problem else self._sync_since
            frames += self._drives.tick(now_s, may_boot, asked_since)
        unread = self._state_machine.state is DriverState.ENABLED and not self._reset.runs
        situation = self._situation(now_s, with_motion=not unread)
        orders = self._judge(situation, now_s)
        frames += self._go_on_with_reset(situation, now_s)
        frames += self._setpoints(orders, now_s, dt_s)
        frames += self._stop_by_sdo(orders, situation, now_s)
        if self._motion.twist != Twist2D.ZERO or situation.standstill:
            self._eased_at = now_s
        releases = self._readiness.step(situation, self.state, self.finding, now_s, self._record.unrecorded)
        if releases or (self.finished and not self._readiness.released):
            frames += self._end_communication(releases, now_s)
        return frames

    def _end_communication(self, releases: bool, now_s: float) -> list[Frame]:
        """Reset communication forgets 1016h: a drive must not report a lost heartbeat after an orderly end. One that
        may have power keeps it, and stops by the missing heartbeat."""
        off = [node.node_id for node in self._drives.nodes if node.is_off(now_s)]
        for node in self._drives.nodes if releases else ():
            node.release(now_s)
        return [nmt(NmtCommand.RESET_COMMUNICATION, node_id) for node_id in off]

    def stop_frames(self) -> list[Frame]:
        """Quick stop for all axes in any state: the way out after a defect. Needs no knowledge, cannot fail."""
        goal = PowerGoal.QUICK_STOP
        return [frame for node in self._drives.nodes for frame in node.setpoints(goal, 0.0, 0.0)] + [self._sync.next()]

    def _judge(self, situation: Situation, now_s: float) -> Orders:
        before, latched_before = self._state_machine.state, self._state_machine.latches
        orders = self._state_machine.step(situation, now_s)
        self._record.note(self._state_machine, situation, self._readiness.allowed)
        state, finding = self._state_machine.state, self._state_machine.finding
        if state in NO_POWER:
            self._drives.forget_jumps()
        began = state is not before and state in (DriverState.STOPPING, DriverState.LATCHED)
        continued = before is DriverState.STOPPING and state in (DriverState.STOPPING, DriverState.LATCHED)
        if (began and not continued) or (continued and self._state_machine.latches and not latched_before):
            by = "watchdog" if finding.cause is DriverCause.WATCHDOG_TRIPPED else "motor_driver"
            latches = self._state_machine.latches
            self.stops.append(StopRecord(by, finding.cause.value, finding.detail, latches, finding.clears_on, now_s))
        if state is not before and state is DriverState.ENABLED:
            self._command.await_zero()
        return orders

    def _setpoints(self, orders: Orders, now_s: float, dt_s: float) -> list[Frame]:
        started = [node for node in self._drives.nodes if node.takes_pdos]
        self._hold_or_release(orders, now_s)
        if orders.drive is Drive.ZERO or self._release_test.active:
            self._motion = MotionState.AT_REST
        else:
            target = self._command.target(now_s) if orders.drive is Drive.FOLLOW else Twist2D.ZERO
            hard = self._watchdog.brakes_hard(now_s)
            self._motion = self._limiter.step(self._motion, target, dt_s, emergency=hard)
        if self._bus_problem or not started:
            return []
        goal = self._release_test.goal(now_s) if self._release_test.active else orders.goal
        if self._reset.fault_reset_bit:  # to an axis without a fault RESET is OFF
            goal = PowerGoal.RESET
        left_mps, right_mps = wheel_speeds(self._motion.twist, self._track_m)
        frames = [frame for node in started for frame in node.setpoints(goal, left_mps, right_mps)]
        return [*frames, self._sync.next()]

    def _hold_or_release(self, orders: Orders, now_s: float) -> None:
        if orders.drive is not Drive.FOLLOW:
            self._release_test.end(ramps=orders.drive is Drive.RAMP)
            return
        rests = self._drives.rest(*wheel_speeds(self._command.target(now_s), self._track_m))
        self._release_test.step(self._drives.axes, rests, now_s)

    def _stop_by_sdo(self, orders: Orders, situation: Situation, now_s: float) -> list[Frame]:
        """While a watchdog lives its ladder does this, and takes an SDO of ours for another master's."""
        alone = situation.watchdog is WatchdogView.MISSING and not self._bus_problem
        if not alone or self._state_machine.state is not DriverState.STOPPING:
            return []
        return [frame for node in self._drives.nodes for frame in node.stop_by_sdo(orders.goal, now_s)]

    def _go_on_with_reset(self, situation: Situation, now_s: float) -> list[Frame]:
        frames, outcome = self._reset.step(situation, now_s)
        if outcome is not None and outcome.done:
            self._stop_requested = False
            self._state_machine.reset()
            self._drives.forget_emcys()
        if outcome is not None:
            self._reset.end(outcome)
        return frames

    def _found_clue(self, liar: int) -> str:
        """What the driver knows about a trip. `liar`: the node whose sensors the watchdog found faulty; 0: none."""
        clue, node_id = self._drives.contradiction(liar), self._watchdog.not_moving_as_ordered
        if not clue and node_id is not None and self.state is DriverState.ENABLED:  # later they speak of the stop
            clue = self._drives.not_following(node_id)
        return clue or self._drives.unshown_mode(liar)

    def _heartbeat(self, now_s: float) -> list[Frame]:
        if now_s - self._heartbeat_at < self._heartbeat_s or self._readiness.released:
            return []
        self._heartbeat_at = now_s
        return [heartbeat(DRIVER_NODE_ID, NmtState.OPERATIONAL)]

    def _situation(self, now_s: float, *, with_motion: bool = True) -> Situation:
        """`with_motion`: the sentences about it; what is enabled may move, and nothing reads them."""
        drives = self._drives
        watchdog, watchdog_detail = self._watchdog.view(now_s)
        liar = self._watchdog.lying_node(now_s)
        if liar:
            if stalling := drives.stalling(liar):
                watchdog_detail = f"{watchdog_detail}; {stalling}"
            drives.doubt(liar, f"reports implausible values (watchdog: {watchdog_detail})")
        if watchdog is not WatchdogView.TRIPPED:
            self._clue = ""
        elif clue := self._clue or self._found_clue(liar):
            self._clue, watchdog_detail = clue, f"{watchdog_detail}; {clue}"
        measured_mps = abs(drives.fastest().velocity_mps)
        left_mps, right_mps = wheel_speeds(self._motion.twist, self._track_m)
        ordered_mps = max(abs(left_mps), abs(right_mps))
        ready, enabled, stand = drives.are_ready, drives.are_enabled, drives.stand(now_s)
        return Situation(
            bus=self._bus_problem,
            booting="" if ready else drives.booting(now_s),
            missing="" if ready else drives.missing(now_s),
            fault="" if enabled else drives.fault(),
            absent="" if ready else drives.absent(),
            silent=drives.silent(now_s, self._sync_since),
            disabled="" if enabled or self._release_test.excuses(now_s) else drives.disabled(),
            unprepared="" if enabled else drives.unprepared(),
            unarmed=self._record.unarmed or self._watchdog.unarmed,
            watchdog=watchdog,
            watchdog_detail=watchdog_detail,
            watchdog_about_drive=self._watchdog.about_drive,
            commanded=self._command.motion(now_s) if with_motion else "",
            unproven="" if enabled else self._without_self_stop(),
            stalled=drives.stalled(),
            wrapping=drives.wrapping(),
            overdue=self._overdue(now_s),
            standstill=stand,
            turning=drives.turning(now_s) if with_motion and not stand else "",
            speed_mps=measured_mps,
            braking_mps=drives.braking_mps(now_s),
            begin_mps=max(measured_mps, ordered_mps),
            turn_radps=self._motion.twist.angular_radps,
            doubted=drives.doubted(),
            powered=drives.may_have_power(now_s),
            unconfigured=self._readiness.unconfigured,
            inactive=self._readiness.inactive,
            resetting=self._reset.runs,
            stop_requested=self._stop_requested,
            shutdown_requested=self._shutdown_requested,
        )

    def _without_self_stop(self) -> str:
        """Why no drive may have power: one is not proven to stop by itself, or was not set up for it by its boot."""
        return self._unproven or (self._drives.without_self_stop() if self._needs_proof else "")

    def _overdue(self, now_s: float) -> str:
        elapsed_s = now_s - self._eased_at
        if elapsed_s <= self._standstill_s:
            return ""
        fastest = self._drives.fastest()
        return (
            f"{fastest.drive.joint} turns at {fastest.velocity_mps:.3f} m/s, {elapsed_s:.1f} s after zero was ordered"
        )

    def _on_status(self, node: CanopenNode, axis: Axis, frame: Frame, now_s: float) -> bool:
        understood = self._answers_last_sync(now_s) and node.on_status(axis, frame, now_s)
        if axis.has_new_sample:  # its velocity came with it
            self._feed.update(now_s)
        return understood

    def _on_velocity(self, node: CanopenNode, axis: Axis, frame: Frame, now_s: float) -> bool:
        understood = self._answers_last_sync(now_s) and node.on_velocity(axis, frame, now_s)
        self._feed.update(now_s)
        return understood

    def _on_nmt(self, frame: Frame, now_s: float) -> bool:
        for node in self._drives.nodes:
            node.on_nmt(frame, now_s)
        return True

    def _answers_last_sync(self, now_s: float) -> bool:
        """False for a TPDO that waited while this process stood still: its values are old, and would pass for fresh."""
        return now_s - self._ticked_at <= self._feedback_s

    def _dispatch_table(self) -> dict[int, tuple[Handler, CanopenNode | None]]:
        """The part that takes a frame, and the node that may go on with its boot after it."""
        table: dict[int, tuple[Handler, CanopenNode | None]] = {
            STATE_COB_ID: (self._watchdog.on_frame, None),
            COUNTERS_COB_ID: (self._watchdog.on_counters, None),
            NMT: (self._on_nmt, None),
        }
        for node in self._drives.nodes:
            table[EMCY + node.node_id] = (node.on_emcy, None)
            table[HEARTBEAT + node.node_id] = (node.on_heartbeat, node)
            table[SDO_TO_CLIENT + node.node_id] = (node.on_sdo, node)
            for axis in node.axes:
                status, velocity = self._feedback_handlers(node, axis)
                table[node.layout.status_cob_id(axis.drive.axis)] = (status, None)
                table[node.layout.velocity_cob_id(axis.drive.axis)] = (velocity, None)
            for number, pdo in enumerate(node.layout.value_pdos()):
                table[pdo.cob_id] = (partial(node.on_values, number), None)
        return table

    def _feedback_handlers(self, node: CanopenNode, axis: Axis) -> tuple[Handler, Handler]:
        return (
            lambda frame, now_s: self._on_status(node, axis, frame, now_s),
            lambda frame, now_s: self._on_velocity(node, axis, frame, now_s),
        )

    def snapshot(self, now_s: float) -> DriverSnapshot:
        """What the driver knows now."""
        dropped = self.frames_dropped + self._bus_report.dropped
        return DriverSnapshot(
            time_s=now_s,
            state=self._state_machine.state,
            finding=self._state_machine.finding,
            standstill=self._drives.are_proven_to_stand(now_s),
            standstill_assumed=self._drives.assumed(now_s),
            watchdog=self._watchdog.report(now_s),
            command=self._command.report(now_s),
            cycle=self._stats.report(),
            bus=self._bus_report.completed(dropped, self._bus_problem),
            odometry=self._feed.report(now_s),
            drives=self._drives.snapshots(now_s),
        )
