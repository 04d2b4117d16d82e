"""The motor driver without bus, clock and ROS: frames and commands in, frames and snapshots out.

One cycle is `tick`: heartbeat, boots, the supervisor's judgement, a reset on its way, the setpoints of all axes,
SYNC. Who stops what and why is in `supervisor.py`, how a node is booted in `boot.py`, how fast the base may go in
`limits.py`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from canbase_config.robot import DRIVER_NODE_ID, Robot
from canbase_driver.axis import Axis
from canbase_driver.cia301 import EMCY, HEARTBEAT, SDO_TO_CLIENT, SYNC, NmtCommand, NmtState, heartbeat, nmt
from canbase_driver.cia402 import DriveState, PowerGoal
from canbase_driver.drives import Drives, age_s
from canbase_driver.frame import Frame
from canbase_driver.kinematics import Twist2D, base_twist, wheel_speeds
from canbase_driver.limits import Limiter, MotionState
from canbase_driver.odometry import Odometry
from canbase_driver.remote_node import RemoteNode
from canbase_driver.reset import Outcome, Reset, refusal
from canbase_driver.snapshot import DriverSnapshot, DriverState, StopRecord
from canbase_driver.supervisor import Cause, Drive, Orders, Situation, Supervisor
from canbase_driver.watchdog_link import STATE_COB_ID, WatchdogLink

HEARTBEATS_PER_TIMEOUT = 3
"""The heartbeat goes out this often in the time that the drives allow for it."""
LATENESS_WINDOW_S = 1.0
NO_POWER = (DriverState.OFFLINE, DriverState.BOOTING, DriverState.DISARMED, DriverState.LATCHED)


class DriverCore:
    """The whole driver as one object that is told the time [s, monotonic]."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._drives = Drives(robot)
        self._watchdog = WatchdogLink(robot.timeouts.watchdog_s)
        self._supervisor = Supervisor(robot.timeouts.standstill_s)
        self._limiter = Limiter(robot.limits, robot.base.track_m)
        self._odometry = Odometry(robot.base.track_m)
        self._odometry_at = -math.inf
        self._motion = MotionState.AT_REST
        self._command = Twist2D.ZERO
        self._command_at = -math.inf
        self._seen_zero = False
        self._zero_since = -math.inf
        self._reset: Reset | None = None
        self._reset_frame: Frame | None = None
        self._on_reset: Callable[[Outcome], None] | None = None
        self._bus_problem = ""
        self._stop_requested = self._shutdown_requested = False
        self._heartbeat_at = self._ticked_at = -math.inf
        self._lateness: deque[tuple[float, float]] = deque()
        self._handlers = self._dispatch_table()
        self.cycles = self.overruns = self.commands_refused = self.frames_dropped = self.send_errors = 0
        self.odometry_serial = 0
        """Grows by one with each sample that entered the odometry."""
        self.stops: deque[StopRecord] = deque(maxlen=64)
        """Stops since they were last taken out, oldest first."""

    @property
    def finished(self) -> bool:
        """A shutdown was asked for, and nothing has power any more."""
        return self._supervisor.finished

    @property
    def state(self) -> DriverState:
        """State of the driver; OFFLINE while the bus is not there."""
        if (
            self._bus_problem
            and self._supervisor.state in NO_POWER
            and self._supervisor.state is not DriverState.LATCHED
        ):
            return DriverState.OFFLINE
        return self._supervisor.state

    @property
    def cause(self) -> Cause:
        """Why it is not enabled."""
        return self._supervisor.cause

    def on_frame(self, frame: Frame, now: float) -> list[Frame]:
        """Take a frame from the bus; the frames to send at once (the boot's next request). Never raises."""
        handler = self._handlers.get(frame.cob_id)
        if handler is None:
            return []
        node, take = handler
        if not take(frame, now):
            self.frames_dropped += 1
        return node.tick(now) if node is not None else []

    def on_command(self, twist: Twist2D, received_at: float) -> bool:
        """Take a velocity command with its receive time. False, and counted: it was not finite."""
        if not twist.is_finite:
            self.commands_refused += 1
            return False
        self._command, self._command_at = twist, received_at
        self._seen_zero = self._seen_zero or twist == Twist2D.ZERO
        return True

    def on_bus(self, problem: str, now: float) -> None:
        """The bus failed (a sentence), or works again (empty): then every node is booted anew."""
        if self._bus_problem and not problem:
            for node in self._drives.nodes:
                node.lose("was cut off from the bus", now)
        self._bus_problem = problem

    def request_stop(self) -> None:
        """Ramp to a stand, take the power away, stay there until a reset."""
        self._stop_requested = True

    def request_shutdown(self) -> None:
        """Ramp to a stand, take the power away, then be `finished`."""
        self._shutdown_requested = True

    def request_reset(self, now: float, on_outcome: Callable[[Outcome], None]) -> None:
        """Begin a reset; `on_outcome` is called once, at once when it is refused."""
        refused = refusal(self._situation(now), self._supervisor.state in NO_POWER)
        if refused is None and self._reset is not None:
            refused = "a reset is under way"
        if refused is not None:
            on_outcome(Outcome(False, refused))
            return
        self._reset, self._on_reset = Reset(now), on_outcome
        self._reset_frame = self._watchdog.request_reset()

    def tick(self, now: float, lateness_s: float = 0.0) -> list[Frame]:
        """One cycle; the frames to send, in this order. `lateness_s`: how late it began."""
        dt_s = min(now - self._ticked_at, 1.0)
        self._ticked_at = now
        self._note_lateness(now, lateness_s)
        frames = self._heartbeat(now)
        for node in self._drives.nodes:
            frames += node.tick(now)
            if self._supervisor.state in NO_POWER and not self._shutdown_requested:
                node.begin_boot(now)
        situation = self._situation(now)
        orders = self._judge(situation, now)
        frames += self._go_on_with_reset(situation, now)
        frames += self._setpoints(orders, now, dt_s)
        if self.finished:
            # Reset communication forgets 1016h: a drive must not report a lost heartbeat after an orderly end.
            frames += [nmt(NmtCommand.RESET_COMMUNICATION, node.node_id) for node in self._drives.nodes]
        return frames

    def stop_frames(self) -> list[Frame]:
        """Quick stop for all axes in any state: the way out after a defect. Needs no knowledge, cannot fail."""
        return [axis.setpoint(PowerGoal.QUICK_STOP, 0.0) for axis in self._drives.axes] + [SYNC]

    def _judge(self, situation: Situation, now: float) -> Orders:
        before = self._supervisor.state
        orders = self._supervisor.step(situation, now)
        state, cause = self._supervisor.state, self._supervisor.cause
        if state is not before and state is DriverState.STOPPING:
            by = "watchdog" if cause.name == "watchdog tripped" else "motor_driver"
            self.stops.append(StopRecord(by, cause.name, cause.detail, self._supervisor.latches, cause.clears_on))
        if state is not before and state is DriverState.ENABLED:
            self._seen_zero = False
        return orders

    def _setpoints(self, orders: Orders, now: float, dt_s: float) -> list[Frame]:
        if not any(node.has_pdos for node in self._drives.nodes) or self._bus_problem:
            self._motion = MotionState.AT_REST
            return []
        target = self._target(orders, now)
        if orders.drive is Drive.ZERO:
            self._motion = MotionState.AT_REST
        else:
            self._motion = self._limiter.step(self._motion, target, dt_s)
        if self._motion.twist != Twist2D.ZERO or target != Twist2D.ZERO:
            self._zero_since = now
        left_mps, right_mps = wheel_speeds(self._motion.twist, self._robot.base.track_m)
        frames = [
            axis.setpoint(self._goal(axis, orders), left_mps if axis in self._drives.left else right_mps)
            for node in self._drives.nodes
            if node.has_pdos
            for axis in node.axes
        ]
        return [*frames, SYNC]

    def _target(self, orders: Orders, now: float) -> Twist2D:
        follows = orders.drive is Drive.FOLLOW and self._seen_zero and self._command_is_fresh(now)
        return self._command if follows else Twist2D.ZERO

    def _goal(self, axis: Axis, orders: Orders) -> PowerGoal:
        resets = self._reset is not None and self._reset.fault_reset_bit
        return PowerGoal.RESET if resets and axis.state is DriveState.FAULT else orders.goal

    def _go_on_with_reset(self, situation: Situation, now: float) -> list[Frame]:
        if self._reset is None or self._reset_frame is None:
            return []
        self._reset.step(situation, self._watchdog.answer(), now)
        outcome = self._reset.outcome
        if outcome is None:
            return [self._reset_frame] if self._reset.asks_watchdog else []
        self._reset = self._reset_frame = None
        if outcome.done:
            self._stop_requested = False
            self._supervisor.reset()
        if self._on_reset is not None:
            self._on_reset(outcome)
        return []

    def _heartbeat(self, now: float) -> list[Frame]:
        period_s = self._robot.timeouts.drive_heartbeat_s / HEARTBEATS_PER_TIMEOUT
        if now - self._heartbeat_at < period_s - 0.5 / self._robot.rates.control_hz:
            return []
        self._heartbeat_at = now
        return [heartbeat(DRIVER_NODE_ID, NmtState.OPERATIONAL)]

    def _situation(self, now: float) -> Situation:
        watchdog, watchdog_detail = self._watchdog.view(now)
        return Situation(
            bus=self._bus_problem,
            booting=self._drives.booting(now),
            fault=self._drives.fault(),
            absent=self._drives.absent(),
            silent=self._drives.silent(now),
            disabled=self._drives.disabled(),
            watchdog=watchdog,
            watchdog_detail=watchdog_detail,
            commanded=self._commanded(now),
            overdue=self._overdue(now),
            standstill=self._drives.stand(now),
            powered=self._drives.may_have_power(now),
            stop_requested=self._stop_requested,
            shutdown_requested=self._shutdown_requested,
        )

    def _commanded(self, now: float) -> str:
        if not self._command_is_fresh(now) or self._command == Twist2D.ZERO:
            return ""
        return f"cmd_vel orders {self._command.linear_mps:.3f} m/s, {self._command.angular_radps:.3f} rad/s"

    def _overdue(self, now: float) -> str:
        if self._supervisor.state is not DriverState.ENABLED or self._drives.stand(now):
            return ""
        elapsed_s = now - self._zero_since
        if elapsed_s <= self._robot.timeouts.standstill_s:
            return ""
        fastest = self._drives.fastest()
        return (
            f"{fastest.drive.joint} turns at {fastest.velocity_mps:.3f} m/s, {elapsed_s:.1f} s after zero was ordered"
        )

    def _command_is_fresh(self, now: float) -> bool:
        return now - self._command_at <= self._robot.timeouts.command_s

    def _note_lateness(self, now: float, lateness_s: float) -> None:
        self.cycles += 1
        self.overruns += lateness_s > 0.5 / self._robot.rates.control_hz
        while self._lateness and self._lateness[-1][1] <= lateness_s:
            self._lateness.pop()
        self._lateness.append((now, lateness_s))
        while self._lateness[0][0] < now - LATENESS_WINDOW_S:
            self._lateness.popleft()

    def _on_status(self, axis: Axis, frame: Frame, now: float) -> bool:
        return axis.on_status(frame.data, now, self.cycles)

    def _on_velocity(self, axis: Axis, frame: Frame, now: float) -> bool:
        understood = axis.on_velocity(frame.data)
        if all(each.has_new_sample for each in self._drives.axes):
            self._take_sample(now)
        return understood

    def _take_sample(self, now: float) -> None:
        for axis in self._drives.axes:
            axis.sample_taken()
        if not self._drives.have_references() or now <= self._odometry_at:
            return
        self._odometry.update(*self._drives.travel_m(), min(now - self._odometry_at, 1.0))
        self._odometry_at = now
        self.odometry_serial += 1

    def _dispatch_table(self) -> dict[int, tuple[RemoteNode | None, Callable[[Frame, float], bool]]]:
        table: dict[int, tuple[RemoteNode | None, Callable[[Frame, float], bool]]] = {
            STATE_COB_ID: (None, self._watchdog.on_frame)
        }
        for node in self._drives.nodes:
            table[EMCY + node.node_id] = (None, node.on_emcy)
            table[HEARTBEAT + node.node_id] = (node, node.on_heartbeat)
            table[SDO_TO_CLIENT + node.node_id] = (node, node.on_sdo)
            for axis in node.axes:
                table[node.layout.status_cob_id(axis.drive.axis)] = (None, _bind(self._on_status, axis))
                table[node.layout.velocity_cob_id(axis.drive.axis)] = (None, _bind(self._on_velocity, axis))
        return table

    def snapshot(self, now: float) -> DriverSnapshot:
        """What the driver knows now."""
        watchdog, _detail = self._watchdog.view(now)
        measured = base_twist(*self._drives.speeds_mps(), self._robot.base.track_m)
        pose, cause = self._odometry.pose, self._supervisor.cause
        return DriverSnapshot(
            time_s=now,
            state=self.state,
            cause=cause.name,
            detail=cause.detail,
            clears_on=cause.clears_on,
            watchdog=watchdog,
            watchdog_cause=self._watchdog.cause,
            watchdog_age_s=self._watchdog.age_s(now),
            standstill=self._drives.stand(now),
            command_age_s=age_s(now, self._command_at),
            command_fresh=self._command_is_fresh(now),
            commands_refused=self.commands_refused,
            cycles=self.cycles,
            overruns=self.overruns,
            cycle_lateness_max_s=self._lateness[0][1] if self._lateness else 0.0,
            frames_dropped=self.frames_dropped,
            send_errors=self.send_errors,
            drives=self._drives.snapshots(now),
            x_m=pose.x_m,
            y_m=pose.y_m,
            yaw_rad=pose.yaw_rad,
            linear_mps=measured.linear_mps,
            angular_radps=measured.angular_radps,
            pose_covariance=self._odometry.pose_covariance(),
            twist_covariance=self._odometry.twist_covariance(),
            odometry_valid=self._drives.are_fresh(now) and self._drives.have_references(),
            odom_frame=self._robot.base.odom_frame,
            base_frame=self._robot.base.base_frame,
        )


def _bind(handler: Callable[[Axis, Frame, float], bool], axis: Axis) -> Callable[[Frame, float], bool]:
    return lambda frame, now: handler(axis, frame, now)
