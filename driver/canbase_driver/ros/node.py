"""The ROS node motor_driver: cmd_vel in; odom, tf, joint_states, status, diagnostics, stops out.

Threads: the executor's (main) takes commands, requests and lifecycle transitions, and none of its callbacks waits;
`publisher` waits for snapshots and publishes them. Neither of them touches the bus.
"""

from __future__ import annotations

import math
import threading
import time

from canbase.msg import DriverStatus, SafetyState
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import BatteryState, JointState

from canbase_config.bus_load import BUSY_LOAD
from canbase_config.diagnostics import PERIOD_S, hardware_id
from canbase_config.robot import Robot
from canbase_driver.drives.health import Excess, HealthWatch
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.ros import messages
from canbase_driver.ros.diagnostics import diagnostics_message, unguarded, values_message
from canbase_driver.ros.managed_node import ManagedNode
from canbase_driver.ros.record_service import RecordService
from canbase_driver.ros.serialized_motion import SerializedMotion
from canbase_driver.ros.services import DriverServices
from canbase_driver.ros.stop_events import StopEvents
from canbase_driver.runtime.black_box import Ring
from canbase_driver.runtime.black_box_notes import state_text
from canbase_driver.runtime.black_box_writer import BlackBoxWriter
from canbase_driver.runtime.bus_traffic import MeasuredLoad
from canbase_driver.runtime.control_thread import ControlLoop
from canbase_driver.snapshot import DriverSnapshot
from canbase_driver.supervision.stop_history import StopRecord
from canbase_runtime.journal import EventLog, Journal
from canbase_runtime.log_priority import Priority
from canbase_runtime.receive_time import ReceiveTimes

COMMAND_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
STATE_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)


class MotorDriverNode(ManagedNode):
    """The ROS side of a `ControlLoop`."""

    def __init__(self, robot: Robot, loop: ControlLoop, ring: Ring, writer: BlackBoxWriter) -> None:
        super().__init__("motor_driver", loop)
        self._robot = robot
        self._receive_times = ReceiveTimes()
        self.event_log = EventLog(self.get_logger(), Journal("motor_driver"))
        self._odom = self.create_publisher(Odometry, "odom", 10)
        publishes_tf = robot.odometry.publish_tf and messages.TFMessage is not None
        self._tf = self.create_publisher(messages.TFMessage, "tf", 100) if publishes_tf else None
        self._joints = self.create_publisher(JointState, "joint_states", 10)
        self._status = self.create_publisher(DriverStatus, "motor_driver/status", STATE_QOS)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        has_values = any(drive.values for drive in robot.drives)
        self._values = self.create_publisher(DiagnosticArray, "motor_driver/values", 10) if has_values else None
        self._values_at = -math.inf
        self._battery = self.create_publisher(BatteryState, "battery_state", 10) if robot.battery else None
        self.create_subscription(TwistStamped, "cmd_vel", self._on_velocity_command, COMMAND_QOS)
        self.create_subscription(SafetyState, "safety_filter/state", self._on_safety, COMMAND_QOS)
        self._stops = StopEvents(self, robot, ring, writer, self.event_log)
        self._records = RecordService(self, self.event_log, self._stops.record)
        self._offers = DriverServices(self, loop, robot.base.odom_frame, self.request_times)
        self._motion = SerializedMotion()
        self._previous: DriverSnapshot | None = None
        self._diagnosed: DriverSnapshot | None = None
        self._hardware_ids = {drive.joint: hardware_id(robot.name, drive) for drive in robot.drives}
        self._bus_load = MeasuredLoad(robot.bus.bitrate)
        self._status_at = 0.0
        self._unguarded: tuple[str, ...] = ()
        self._health = HealthWatch(robot.health)
        self._warnings: tuple[Excess, ...] = ()
        self._boot_problems: dict[str, str] = {}
        """By joint: why its last boot failed, as it went to the log."""
        self.state_text = "starting"
        """State, cause and what ends it, in words: the last line that went to the log."""
        if messages.TFMessage is None:
            self.get_logger().warning("tf2_msgs is not installed: no transform is published on tf")

    def publish(self, snapshot: DriverSnapshot, stops: list[StopRecord]) -> None:
        """Publish a snapshot; called by the publisher's thread alone."""
        stamp = self.get_clock().now().to_msg()
        self._stops.publish_stops(snapshot, stops)
        if snapshot.odometry.valid:
            self._odom.publish(self._motion.odometry(snapshot, stamp))
            self._joints.publish(self._motion.joint_state(snapshot, stamp))
            if self._tf is not None:
                self._tf.publish(self._motion.transform(snapshot, stamp))
        self._publish_status(snapshot, stamp)
        self._publish_values(snapshot, stamp)
        self._log_change(snapshot)
        self._warn_of_unguarded(snapshot)
        self._warn_of_boots(snapshot)
        self._previous = snapshot

    def look_at_the_clock(self, now_s: float) -> None:
        """To be called in each turn of the executor's loop: a pause between two of them ages the commands that wait."""
        self._receive_times.at(now_s)
        self.request_times.at(now_s)

    def deliver(self) -> None:
        """Send the answers for which the black box has done its work; from the executor's thread."""
        self._records.deliver()

    @property
    def and_black_box(self) -> tuple[Node, ...]:
        """All nodes of the process, in the order of their end."""
        return self, self._stops.orders.node

    def end(self) -> None:
        """The control thread has ended: report the stops that are still open."""
        self._stops.end()

    def _on_velocity_command(self, message: TwistStamped) -> None:
        received_at = self._receive_times.at(time.monotonic())
        twist = Twist2D(message.twist.linear.x, message.twist.angular.z)
        if not twist.is_finite:
            self.get_logger().error(f"cmd_vel refused: {twist} is not finite", throttle_duration_sec=1.0)
        self._loop.queue_velocity_command(twist, received_at)
        stamp = message.header.stamp
        self._stops.queue_velocity_command(twist, stamp.sec + stamp.nanosec * 1e-9, received_at)

    def _on_safety(self, message: SafetyState) -> None:
        """For the record of stops alone: how to brake comes with the command's lease, by the watchdog."""
        self._stops.on_filter(message, time.monotonic())

    def _publish_status(self, snapshot: DriverSnapshot, stamp: object) -> None:
        previous = self._previous
        changed = previous is None or _essence(previous) != _essence(snapshot)
        if changed or snapshot.time_s - self._status_at >= 1.0 / self._robot.rates.status_hz:
            self._status_at = snapshot.time_s
            self._warn_of_health(snapshot)
            self._status.publish(messages.status_message(snapshot, stamp, self._warnings, self._bus_load.share))
        if self._diagnosed is None or snapshot.time_s - self._diagnosed.time_s >= PERIOD_S:
            self._diagnose(snapshot, stamp)

    def _publish_values(self, snapshot: DriverSnapshot, stamp: object) -> None:
        """When a new named value has come."""
        if self._values is None:
            return
        newest = max((value.at for drive in snapshot.drives for value in drive.values), default=-math.inf)
        if newest > self._values_at:
            self._values_at = newest
            self._values.publish(values_message(snapshot, stamp, self._robot.name))

    def _diagnose(self, snapshot: DriverSnapshot, stamp: object) -> None:
        """Once a second: entries in /diagnostics, the load of the bus since the last time, the battery."""
        before, self._diagnosed = self._diagnosed or snapshot, snapshot
        load = self._bus_load.measure(self._loop.traffic(), snapshot.time_s)
        message = diagnostics_message(
            snapshot,
            stamp,
            robot=self._robot.name,
            previous=before,
            warnings=self._warnings,
            hardware_ids=self._hardware_ids,
            bus_load=load,
            busy_above=math.inf if self._robot.bus.is_virtual else BUSY_LOAD,
        )
        self._diagnostics.publish(message)
        if self._battery is not None and self._robot.battery is not None:
            self._battery.publish(messages.battery_message(snapshot, stamp, self._robot.battery))

    def _log_change(self, snapshot: DriverSnapshot) -> None:
        previous, finding = self._previous, snapshot.finding
        if previous is not None and (previous.state, previous.finding.cause) == (snapshot.state, finding.cause):
            return
        text = self.state_text = state_text(snapshot)
        self._stops.note(text)
        self._stops.on_state(snapshot)
        priority = Priority.INFO if finding.cause.is_usual else Priority.WARNING
        cause, robot = finding.cause.value, self._robot.name
        self.event_log.write(text, priority, state=snapshot.state.name, cause=cause, robot=robot)

    def _warn_of_boots(self, snapshot: DriverSnapshot) -> None:
        """Once for each reason why a drive cannot be booted, whatever else keeps the robot stopped."""
        for drive in snapshot.drives:
            if drive.boot_problem and self._boot_problems.get(drive.joint) != drive.boot_problem:
                sentence = f"boot of {drive.joint} failed: {drive.boot_problem}"
                self._stops.note(sentence)
                self.event_log.write(sentence, Priority.WARNING, robot=self._robot.name)
            self._boot_problems[drive.joint] = drive.boot_problem

    def _warn_of_health(self, snapshot: DriverSnapshot) -> None:
        """Once for each value beyond its limit, until it has been inside for a while."""
        known = {(warning.joint, warning.key) for warning in self._warnings}
        self._warnings = self._health.check_drives(snapshot.drives, snapshot.time_s)
        for warning in self._warnings:
            if (warning.joint, warning.key) not in known:
                self.event_log.write(warning.text, Priority.WARNING, robot=self._robot.name)

    def _warn_of_unguarded(self, snapshot: DriverSnapshot) -> None:
        """Once after each boot, loudly."""
        before, self._unguarded = self._unguarded, unguarded(snapshot)
        for sentence in self._unguarded:
            if sentence not in before:
                self._stops.note(sentence)
                self.event_log.write(sentence, Priority.ERROR, robot=self._robot.name)


def _essence(snapshot: DriverSnapshot) -> tuple[object, ...]:
    """What is published at once when it changes. After odom: a subscriber that knows of a new pose has received it."""
    return snapshot.state, snapshot.finding.cause, snapshot.odometry.pose_resets


class Publisher(threading.Thread):
    """Publishes every snapshot as soon as the control thread hands it over."""

    def __init__(self, node: MotorDriverNode, loop: ControlLoop) -> None:
        super().__init__(name="publisher", daemon=True)
        self._node = node
        self._loop = loop
        self.failure: BaseException | None = None

    def run(self) -> None:
        """The thread's body: until the control thread has ended and its last snapshot is out."""
        try:
            while True:
                alive = self._loop.is_alive()
                snapshot, stops = self._loop.next_snapshot(timeout_s=0.1)
                if snapshot is not None:
                    self._node.publish(snapshot, stops)
                elif not alive:
                    self._node.end()
                    return
        except BaseException as error:  # noqa: BLE001 - main sees it, stops the robot and ends the process
            self.failure = error
