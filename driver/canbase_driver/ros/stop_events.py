"""ROS around `stop_history.py` and the black box: states of filter and mux come in, stop_events go out.

Two threads meet here: the executor's brings in commands and states, the publisher's reports. What the first one brings
waits in a queue until the second one takes it.
"""

from __future__ import annotations

import functools
import math
import queue
import time
from collections.abc import Callable

from builtin_interfaces.msg import Time
from canbase.msg import MuxState, SafetyState, StopEvent
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from canbase_config.robot import Robot
from canbase_config.stopping import given_up_s
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.ros.event_values import driver_values, filter_values, mux_values
from canbase_driver.ros.messages import stop_event_message
from canbase_driver.ros.source_orders import SourceOrders
from canbase_driver.runtime.black_box import Ring
from canbase_driver.runtime.black_box_notes import command_note, driver_note, filter_note, mux_note
from canbase_driver.runtime.black_box_writer import BlackBoxWriter, Written
from canbase_driver.snapshot import DriverSnapshot
from canbase_driver.supervision.state_machine import POWER_OFF_TIMEOUT_S
from canbase_driver.supervision.stop_history import FILTER, NOBODY, StopHistory, StopRecord, StopReport, standstill_text
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable
from canbase_runtime.journal import EventLog
from canbase_runtime.log_priority import Priority
from canbase_runtime.stop_cause import stop_cause

EVENT_QOS = QoSProfile(depth=50, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
STATE_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class StopEvents:
    """Publishes one StopEvent for each stop, and has its recording written when it is latched."""

    def __init__(self, node: Node, robot: Robot, ring: Ring, writer: BlackBoxWriter, event_log: EventLog) -> None:
        self._node = node
        self._event_log = event_log
        self._robot_name = robot.name
        self._ring = ring
        self._writer = writer
        self.orders = SourceOrders(node, robot, ring.seconds)
        self._estop_latches = robot.safety.estop.latched
        patience_s = given_up_s(robot) + POWER_OFF_TIMEOUT_S
        self._recorder = StopHistory(patience_s)
        self._news: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._publisher = node.create_publisher(StopEvent, "stop_events", EVENT_QOS)
        node.create_subscription(MuxState, "velocity_mux/state", self._on_mux, STATE_QOS)

    def queue_velocity_command(self, twist: Twist2D, stamp_s: float, received_at: float) -> None:
        """A command came, with the stamp of its header [s since 1970]; from the executor's thread."""
        linear_mps, angular_radps = twist.linear_mps, twist.angular_radps
        self._ring.note(received_at, command_note(linear_mps, angular_radps))
        values = {"linear_mps": linear_mps, "angular_radps": angular_radps, "stamp_s": stamp_s}
        self._ring.event(received_at, "cmd_vel", values)
        moves = twist.is_finite and twist != Twist2D.ZERO
        self._news.put(lambda: self._recorder.note_velocity_command(moves, received_at))

    def on_filter(self, message: SafetyState, now_s: float) -> None:
        """The state of the safety filter; from the executor's thread."""
        stops = message.action == SafetyState.STOP
        cause, detail = printable(message.cause), printable(message.detail, SENTENCE_LENGTH)
        ordered = message.ordered_linear_mps, message.ordered_angular_radps
        self._ring.note(now_s, filter_note(cause, detail, *ordered, message.lease_sequence))
        self._ring.event(now_s, "safety_filter/state", filter_values(message))
        latched = self._estop_latches and stop_cause(message.cause).is_estop
        clears_on = printable(message.clears_on, SENTENCE_LENGTH)
        record = StopRecord(FILTER, cause, detail, latched, clears_on, now_s)
        self._news.put(lambda: self._recorder.on_filter(record if stops else None, now_s))

    def note(self, text: str) -> None:
        """A line for the black box."""
        self._ring.note(time.monotonic(), driver_note(text))

    def on_state(self, snapshot: DriverSnapshot) -> None:
        """The driver's state or its cause is another one."""
        self._ring.event(snapshot.time_s, "motor_driver/state", driver_values(snapshot))

    def publish_stops(self, snapshot: DriverSnapshot, stops: list[StopRecord]) -> None:
        """Take a snapshot and the stops that the core began; publish what is over. From the publisher's thread."""
        while True:
            try:
                news = self._news.get_nowait()
            except queue.Empty:
                break
            news()
        for report in self._recorder.on_snapshot(snapshot, stops):
            self._publish(report)

    def end(self) -> None:
        """Publish what is not over."""
        for report in self._recorder.end():
            self._publish(report)

    def _publish(self, report: StopReport) -> None:
        record, now_s = report.record, time.monotonic()
        stamp_ns = self._node.get_clock().now().nanoseconds - round((now_s - record.at_s) * 1e9)
        path = self._write(report, now_s) if record.latched else ""
        stamp = Time(sec=stamp_ns // 1_000_000_000, nanosec=stamp_ns % 1_000_000_000)
        self._publisher.publish(stop_event_message(report, stamp, path))
        end = standstill_text(report)
        file = f"; black box: {path}" if path else ""
        by = f"{record.stopped_by}: {record.cause} ({record.detail})"
        self._event_log.write(
            f"stop by {by}; standstill {end}{file}",
            Priority.WARNING,
            robot=self._robot_name,
            stopped_by=record.stopped_by,
            cause=record.cause,
            latched=str(record.latched).lower(),
            standstill_s=f"{report.standstill_s:.3f}" if report.standstill else "",
            distance_m="" if math.isnan(report.distance_m) else f"{report.distance_m:.4f}",
            black_box=path,
        )

    def _write(self, report: StopReport, now_s: float) -> str:
        offset_s = time.time() - now_s
        return self._writer.submit(self._ring.cut(now_s, offset_s), report.record, self.orders.during)

    def record(self, done: Written) -> str:
        """Have the last seconds written though nothing has stopped the base; from the executor's thread.

        Why not now; empty: `done` will be called, from the writer's thread.
        """
        now_s = time.monotonic()
        offset_s = time.time() - now_s
        record = StopRecord(NOBODY, "recording requested", "the robot was not stopped", False, "", now_s)
        keep = functools.partial(self._ring.cut_later, now_s, offset_s)
        return self._writer.request(keep, record, offset_s, self.orders.during, done)

    def _on_mux(self, message: MuxState) -> None:
        now_s, active = time.monotonic(), printable(message.active)
        reasons = (f"{source.name}: {source.reason}" for source in message.sources if source.reason)
        detail = printable("; ".join(reasons), SENTENCE_LENGTH)
        self._ring.note(now_s, mux_note(active, detail))
        self._ring.event(now_s, "velocity_mux/state", mux_values(message))
        self._news.put(lambda: self._recorder.on_mux(active, detail, now_s))
