"""The node velocity_mux: ROS around mux.py. Sources in, cmd_vel_mux and velocity_mux/state out; see docs/ros_api.md."""

from __future__ import annotations

import functools
import math
import time

from canbase.msg import MuxState
from geometry_msgs.msg import Twist as TwistMessage
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node

from canbase_config.robot import Robot
from canbase_velocity.messages import mux_state, twist_message, twist_of
from canbase_velocity.mux import Mux, MuxDecision
from canbase_velocity.qos import COMMAND, STATE

STATE_PERIOD_S = 0.5


class MuxNode(Node):
    """Publishes at once what the driving source says, and repeats it on a timer while that source is fresh."""

    def __init__(self, robot: Robot) -> None:
        super().__init__("velocity_mux")
        self._mux = Mux(robot.mux.sources)
        self._frame_id = robot.base.base_frame
        self._decision = self._mux.decide(time.monotonic())
        self._state_at_s = -math.inf
        self._commands = self.create_publisher(TwistStamped, "cmd_vel_mux", COMMAND)
        self._states = self.create_publisher(MuxState, "velocity_mux/state", STATE)
        for name, source in robot.mux.sources.items():
            kind = TwistStamped if source.stamped else TwistMessage
            callback = self._on_stamped if source.stamped else self._on_plain
            self.create_subscription(kind, source.topic, functools.partial(callback, name), COMMAND)
        self._timer = self.create_timer(1.0 / robot.rates.command_hz, self._tick)

    def shut_down(self) -> None:
        """Sends one zero and says so in the state. Called several times: one may be lost."""
        self._send(self._mux.shutdown(time.monotonic()), time.monotonic())

    def _on_stamped(self, name: str, message: TwistStamped) -> None:
        self._on_plain(name, message.twist)

    def _on_plain(self, name: str, message: TwistMessage) -> None:
        now = time.monotonic()
        if not self._mux.on_command(name, twist_of(message), now):
            self.get_logger().warning(f"{name} refused: NaN or infinity", throttle_duration_sec=5.0)
        decision = self._mux.decide(now)
        if decision.active == name or decision.active != self._decision.active:
            self._timer.reset()  # a source faster than the timer is not doubled by it
            self._send(decision, now)

    def _tick(self) -> None:
        """Nothing was sent for a period: repeats what holds, or zero."""
        now = time.monotonic()
        self._send(self._mux.decide(now), now)

    def _send(self, decision: MuxDecision, now: float) -> None:
        self._commands.publish(twist_message(decision.twist, self.get_clock().now().to_msg(), self._frame_id))
        changed = (decision.active, decision.standings) != (self._decision.active, self._decision.standings)
        if changed or now - self._state_at_s >= STATE_PERIOD_S:
            self._states.publish(mux_state(decision, self.get_clock().now().to_msg()))
            self._state_at_s = now
        if decision.active != self._decision.active:
            self.get_logger().info(f"{decision.active or 'nobody'} drives, before {self._decision.active or 'nobody'}")
        self._decision = decision
