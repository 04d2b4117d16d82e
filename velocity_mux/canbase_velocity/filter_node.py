"""The node safety_filter: ROS and the lease around safety_filter.py. cmd_vel_mux, scan and estop_state in; cmd_vel,
safety_filter/state, stop_events and leases out; see docs/ros_api.md.
"""

from __future__ import annotations

import math
import time

from canbase.msg import SafetyState, StopEvent
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool

from canbase_config.robot import Robot
from canbase_velocity.clearance import ClearanceReader
from canbase_velocity.decision import Action, Decision
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.io import LeaseSender
from canbase_velocity.lease import lease_datagram
from canbase_velocity.messages import safety_state, scan_of, stop_event, stopped_by_estop, twist_message, twist_of
from canbase_velocity.qos import ANY_COMMAND, COMMAND, EVENT, SCAN, STATE, listen_twice
from canbase_velocity.safety_filter import SHUTDOWN, FilterConfig, braking_time_s

STATE_PERIOD_S = 0.1


class FilterNode(Node):
    """Issues an order on every command, on the emergency stop, and on a timer; each with its lease."""

    def __init__(self, robot: Robot) -> None:
        super().__init__("safety_filter")
        self._robot = robot
        self._filter = SafetyFilter(FilterConfig.of(robot))
        self._clearances = ClearanceReader(robot.safety.footprint, robot.safety.scan)
        self._leases = LeaseSender(robot.lease.socket)
        self._lease_sequence = 0
        self._decision = self._filter.decide(time.monotonic())
        self._state_at_s = -math.inf
        self._stands_from_s = -math.inf
        self._commands = self.create_publisher(TwistStamped, "cmd_vel", COMMAND)
        self._states = self.create_publisher(SafetyState, "safety_filter/state", STATE)
        self._events = self.create_publisher(StopEvent, "stop_events", EVENT)
        self.create_subscription(TwistStamped, "cmd_vel_mux", self._on_command, ANY_COMMAND)
        self.create_subscription(LaserScan, robot.safety.scan.topic, self._on_scan, SCAN)
        listen_twice(self, Bool, robot.safety.estop.topic, self._on_estop)
        self._timer = self.create_timer(1.0 / robot.rates.command_hz, self._tick)

    def shut_down(self) -> None:
        """Orders zero once, with its lease, and says so in the state. Called several times: one may be lost."""
        self._issue(SHUTDOWN, time.monotonic())

    @property
    def stands_from_s(self) -> float:
        """When the driver's ramp from the last order to move ends, if zeros follow (time.monotonic)."""
        return self._stands_from_s

    @property
    def state_text(self) -> str:
        """What it does and why, in words. The detail is left out: its numbers change all the time."""
        return f"{self._decision.action.name} {self._decision.cause.value}"

    def destroy_node(self) -> None:
        """Closes the lease socket with the node."""
        self._leases.close()
        super().destroy_node()

    def _on_command(self, message: TwistStamped) -> None:
        now = time.monotonic()
        self._filter.on_command(twist_of(message.twist), now)
        self._timer.reset()  # a mux faster than the timer is not doubled by it
        self._issue(self._filter.decide(now), now)

    def _on_estop(self, message: Bool) -> None:
        now = time.monotonic()
        self._filter.on_estop(message.data, now)
        if message.data:
            self._issue(self._filter.decide(now), now)

    def _on_scan(self, message: LaserScan) -> None:
        clearances = self._clearances.read(scan_of(message))
        if clearances is not None:
            self._filter.on_scan(clearances, time.monotonic())

    def _tick(self) -> None:
        """Nothing was issued for a period: decides again, for ages have grown and scans have come."""
        now = time.monotonic()
        self._issue(self._filter.decide(now), now)

    def _issue(self, decision: Decision, now: float) -> None:
        """The lease goes first: the watchdog knows what is allowed before a wheel can move."""
        self._send_lease(decision)
        stamp = self.get_clock().now().to_msg()
        self._commands.publish(twist_message(decision.twist, stamp, self._robot.base.base_frame))
        if not decision.twist.is_zero:
            self._stands_from_s = now + braking_time_s(decision.twist, self._robot.limits)
        if self._filter.begins_stop(decision):
            self._events.publish(stop_event(decision, stamp))
        self._tell(decision, now)
        self._decision = decision

    def _send_lease(self, decision: Decision) -> None:
        self._lease_sequence += 1
        report = self._leases.send(
            lease_datagram(
                self._lease_sequence,
                time.monotonic_ns(),
                decision.twist,
                stops=decision.action is Action.STOP,
                estop=stopped_by_estop(decision),
            )
        )
        if report is not None:
            self.get_logger().warning(report)

    def _tell(self, decision: Decision, now: float) -> None:
        changed = (decision.action, decision.cause) != (self._decision.action, self._decision.cause)
        if changed:
            self.get_logger().info(f"{decision.action.name} {decision.cause.value} {decision.detail}".rstrip())
        if not changed and now - self._state_at_s < STATE_PERIOD_S:
            return
        inputs = self._filter.inputs(now)
        fresh = inputs.scan_age_s is not None and inputs.scan_age_s <= self._robot.safety.scan.timeout_s
        message = safety_state(decision, inputs, fresh, self.get_clock().now().to_msg())
        message.lease_sequence, message.lease_errors = self._lease_sequence, self._leases.errors
        self._states.publish(message)
        self._state_at_s = now
