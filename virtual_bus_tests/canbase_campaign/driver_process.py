"""motor_driver in virtual time: the core, the cycle of loop.py and the topics of node.py; and two ways to misbehave."""

from __future__ import annotations

from canbase_campaign.can_bus import REMOTE, CanBus
from canbase_campaign.clock import FINE, ComputerClock, Pace
from canbase_campaign.disk import StopDisk
from canbase_campaign.process import FRAMES_HELD, Process, Topics
from canbase_config.robot import DRIVER_NODE_ID, Robot
from canbase_driver.cia301.frame import Frame
from canbase_driver.core import DriverCore
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.snapshot import DriverSnapshot
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_driver.supervision.lifecycle import Aim
from canbase_runtime.driver_state import DriverState
from canbase_velocity.twist import ZERO, Twist

SETPOINTS = (0x200, 0x300)
"""First identifiers of the RPDOs with setpoints: docs/bus.md."""
SEND_FAILURES = 10
"""As in canbase_driver.runtime.bus_port."""
ENABLE = b"\x0f\x00"
"""Controlword: enable operation."""


class DriverProcess(Process):
    """`core` is the real driver. `bus_problem`: what its adapter reports. A misbehaving one sends other frames."""

    name = "driver"

    def __init__(self, robot: Robot, clock: ComputerClock, bus: CanBus, topics: Topics, pace: Pace = FINE) -> None:
        super().__init__(clock)
        self._jitter_s = pace.cycle_jitter_s
        self._robot, self._topics, self._random = robot, topics, bus.random
        self._member = bus.join(self.name, self)
        self.disk = StopDisk("driver")
        """Its record of stops, which outlives it."""
        self.bus_problem = ""
        self.repeats = False
        """It sends the setpoints of its last cycle again and again, with heartbeat and SYNC."""
        self.ignores_zero = False
        """Where a setpoint is zero it sends the last one that was not."""
        self.keeps_motion = False
        """It follows each command but zero."""
        self.omits = 0
        """It sends no setpoints with this identifier; 0: it sends all."""
        self.never_lets_go = False
        """At a stand it leaves the power on, where it should take it off for a moment."""
        self.ros_stalls = False
        """The thread of its topics stands still; the one of the bus goes on."""
        self.asked = ""
        """It was requested to stop, or to give up the power: until a reset or an activation. Empty: it was not."""
        self.heartbeats = True
        """A misbehaving driver may go on with its heartbeat or stop sending it."""
        self._last_frames: list[Frame] = []
        self._last_moving: dict[int, bytes] = {}
        self._moves = ZERO
        self._refused = 0
        """Frames in a row that its adapter did not take."""
        topics.subscribe("cmd_vel", self, self._on_command)
        self.begin()

    @property
    def latched(self) -> bool:
        """It reports a latched stop."""
        return self.core.state is DriverState.LATCHED

    @property
    def enabled(self) -> bool:
        """It reports that the base follows commands."""
        return self.core.state is DriverState.ENABLED

    @property
    def cause(self) -> str:
        """Why it does not, as it reports it."""
        return self.core.finding.cause.value

    def begin(self) -> None:
        """A new core: nothing is booted, and its record decides what is latched."""
        self.core = DriverCore(self._robot, on_disk=self.disk.found())
        self.asked = self.asked if self.asked == "deactivate" else ""  # whatever the record says
        rates = self._robot.rates
        self._period_s, self._status_s = 1.0 / rates.control_hz, 1.0 / rates.status_hz
        self._samples = round(rates.control_hz / rates.odometry_hz)
        self._cycle = 0
        self.snapshot: DriverSnapshot | None = None
        self._told: tuple[object, object] | None = None
        self._status_at = 0.0
        self._suspended_s = self.clock.suspended_s
        self.every(self._period_s, self._on_cycle)

    def reset(self, on_outcome: list[RequestOutcome]) -> None:
        """Service motor_driver/reset; there is no answer while the process does not run."""
        if self.running:
            self.core.request_reset(self.clock.now_s, lambda outcome: self._on_reset(outcome, on_outcome))

    def _on_reset(self, outcome: RequestOutcome, on_outcome: list[RequestOutcome]) -> None:
        self.asked = "" if outcome.done and self.asked == "stop" else self.asked
        on_outcome.append(outcome)

    def stop(self) -> None:
        """Service motor_driver/stop."""
        if self.running:
            self.core.request_stop()
            self.asked = "stop"

    def aim(self, aim: Aim) -> None:
        """Lifecycle transitions activate and deactivate."""
        if self.running:
            self.core.request_aim(aim, self.clock.now_s, lambda outcome: None)
            self.asked = "" if aim is Aim.ACTIVE else "deactivate"

    def end(self) -> None:
        """The base is stopped first."""
        if self.running:
            self.core.request_shutdown()
            self.asked = "end"

    def hear(self, cob_id: int, data: bytes) -> None:
        """A frame on the bus. The requests of the watchdog are none for it."""
        if cob_id >= REMOTE:
            return
        if self.running:
            self._on_frame(cob_id, data)
        else:
            self.receive("frames", FRAMES_HELD, self._on_frame, cob_id, data)

    def _on_frame(self, cob_id: int, data: bytes) -> None:
        if not self.bus_problem:
            self._send(self.core.on_frame(Frame(cob_id, data), self.clock.now_s))

    def _on_command(self, twist: Twist) -> None:
        if self.ros_stalls:
            return
        if self.keeps_motion and twist.is_zero:
            twist = self._moves
        self._moves = twist
        self.core.accept_velocity_command(Twist2D(twist.linear_mps, twist.angular_radps), self.clock.now_s)

    def _on_cycle(self) -> None:
        now_s = self.clock.now_s
        before_s, self._suspended_s = self._suspended_s, self.clock.suspended_s
        if self._suspended_s > before_s:  # as control_thread.py does
            self.core.on_suspend(now_s)
        self.core.on_bus(self.bus_problem, now_s)
        frames = self.core.tick(now_s, self._random.random() * self._jitter_s)
        self.core.on_record(*self.disk.write(self.core.record))
        self._send(self._changed(frames))
        self._cycle += 1
        if not self.ros_stalls:
            self._publish(now_s)
        if self.core.finished:  # as loop.py does
            self.die()

    def _send(self, frames: list[Frame]) -> None:
        if self.bus_problem:
            return
        for frame in frames:
            taken = self._member.send(frame.cob_id, frame.data)
            self._refused = 0 if taken else self._refused + 1
        if self._refused >= SEND_FAILURES:  # as bus_port.py does
            self.bus_problem = "no buffer space available"

    def _changed(self, frames: list[Frame]) -> list[Frame]:
        """The cycle's frames as a misbehaving driver sends them; a healthy one changes nothing."""
        if self.repeats:
            beats = [frame for frame in frames if frame.cob_id == 0x700 + DRIVER_NODE_ID and self.heartbeats]
            return beats + self._last_frames
        frames = [self._holding(frame) for frame in frames if not self.omits or frame.cob_id != self.omits]
        self._last_frames = [frame for frame in frames if frame.cob_id != 0x700 + DRIVER_NODE_ID]
        return [self._never_zero(frame) for frame in frames] if self.ignores_zero else self._note(frames)

    def _note(self, frames: list[Frame]) -> list[Frame]:
        for frame in frames:
            if frame.cob_id & 0x780 in SETPOINTS and any(frame.data[2:]):
                self._last_moving[frame.cob_id] = frame.data
        return frames

    def _holding(self, frame: Frame) -> Frame:
        """Enable operation, where it takes the power off for a moment to see whether a wheel stands."""
        lets_go = self.never_lets_go and self.core.lets_go and frame.cob_id & 0x780 in SETPOINTS
        return Frame(frame.cob_id, ENABLE + frame.data[2:]) if lets_go else frame

    def _never_zero(self, frame: Frame) -> Frame:
        stands = frame.cob_id & 0x780 in SETPOINTS and not any(frame.data[2:])
        return Frame(frame.cob_id, self._last_moving.get(frame.cob_id, frame.data)) if stands else frame

    def _publish(self, now_s: float) -> None:
        """odom at 50 Hz while it is valid, the status at its rate and on every change."""
        status = (self.core.state, self.core.finding.cause)
        due = status != self._told or now_s - self._status_at >= self._status_s
        if not due and self._cycle % self._samples:
            return
        snapshot = self.snapshot = self.core.snapshot(now_s)
        if snapshot.odometry.valid:
            self._topics.publish("odom", snapshot)
        if due:
            self._told, self._status_at = status, now_s
            self._topics.publish("motor_driver/status", snapshot)
