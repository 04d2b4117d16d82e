"""The ROS node velocity_mux around mux.py: sources, locks and motor_driver/status in, velocity_mux/state out.

Orders reach the safety filter within the process; cmd_vel_mux shows them. It also looks into the ROS graph for
publishers that should not be there. See docs/ros_api.md.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any, Protocol

from canbase.msg import DriverStatus, MuxState
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist as TwistMessage
from geometry_msgs.msg import TwistStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from canbase_config.diagnostics import PERIOD_S as DIAGNOSTICS_PERIOD_S
from canbase_config.mux import JOINTS, MEASURED, OUTPUTS, MuxSource
from canbase_config.robot import Robot
from canbase_config.state_age import STATE_PERIOD_S
from canbase_runtime.driver_state import driver_state
from canbase_runtime.joint_command import Refusal, base_velocity
from canbase_runtime.journal import EventLog, Journal
from canbase_runtime.receive_time import ReceiveTimes
from canbase_runtime.serialized_message import SerializedTwist
from canbase_runtime.sim_time import refuse_sim_time
from canbase_runtime.wrong_start import WrongStartError
from canbase_velocity.base_ready import status_timeout_s
from canbase_velocity.changes import Repeats, changes
from canbase_velocity.delay import Sent
from canbase_velocity.graph import expected, heard, publishers
from canbase_velocity.input_ring import Note, forget, mux_entry
from canbase_velocity.messages import sent_at, twist_of
from canbase_velocity.mux import NOT_FINITE, Mux, MuxDecision
from canbase_velocity.mux_messages import diagnostics, mux_state
from canbase_velocity.own_topics import wrong_topic
from canbase_velocity.qos import ANY_COMMAND, COMMAND, DRIVER_STATUS, STATE, listen_closely, loud
from canbase_velocity.steady import next_turn, steady_timer
from canbase_velocity.twist import Twist
from canbase_velocity.unexpected_publishers import ForeignWatch

GRAPH_PERIOD_S = 0.5


class Follower(Protocol):
    """The safety filter, as the mux sees it."""

    @property
    def estop_free(self) -> bool:
        """No emergency stop holds or waits for its reset."""

    @property
    def without_scans(self) -> str:
        """Why it has been without usable scans for long; empty: it has not."""

    def obey(self, twist: Twist, now_s: float) -> None:
        """Takes the order of the mux at `now_s` [s, monotonic]."""


class MuxNode(Node):
    """Publishes at once the command of the source that has the base, and repeats it while that source is fresh."""

    def __init__(self, robot: Robot, note: Note = forget) -> None:
        """`note`: takes each input of the core, and each decision."""
        super().__init__("velocity_mux")
        refuse_sim_time(self, SetParametersResult)
        self._robot = robot
        self._refuse_own_topics()
        self._note = note
        self._follower: Follower | None = None
        self._event_log = EventLog(self.get_logger(), Journal("velocity_mux"))
        self._repeats = Repeats()
        self._receive_times = ReceiveTimes()
        self._mux = Mux(
            robot.mux.sources,
            robot.mux.locks,
            foreign_lock=robot.mux.foreign_publishers == "lock",
            status_timeout_s=status_timeout_s(robot.rates),
        )
        self._watch = ForeignWatch(expected(robot, self))
        self._heard = heard(robot)
        self._decision = self._mux.decide(time.monotonic())
        self._state_due_s = -math.inf
        self._deaf: list[str] = []
        self._ending = False
        self._serialized = SerializedTwist(robot.base.base_frame)
        self._commands = self.create_publisher(
            TwistStamped, "cmd_vel_mux", COMMAND, event_callbacks=loud(self, "cmd_vel_mux", self._deaf)
        )
        self._states = self.create_publisher(MuxState, "velocity_mux/state", STATE)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._listen()
        self._timer = steady_timer(self, 1.0 / robot.rates.command_hz, self._tick)
        steady_timer(self, GRAPH_PERIOD_S, self._check_graph)
        steady_timer(self, DIAGNOSTICS_PERIOD_S, self._diagnose)

    @property
    def core(self) -> Mux:
        """What decides."""
        return self._mux

    def lead(self, follower: Follower) -> None:
        """From now on orders go to the safety filter too, and its emergency stop counts."""
        self._follower = follower

    def shut_down(self) -> None:
        """Publishes one zero and the state, and from here on nothing else. Called several times: one message may be
        lost. The filter orders its own zeros.
        """
        self._follower, self._ending = None, True
        now_s = time.monotonic()
        self._send(self._decide(now_s), now_s)

    def moving_sources(self) -> tuple[str, ...]:
        """Names of all sources that order a velocity now, also without the base."""
        return self._mux.moving(time.monotonic())

    def _listen(self) -> None:
        self.create_subscription(DriverStatus, "motor_driver/status", self._on_driver, DRIVER_STATUS)
        for name, source in self._robot.mux.sources.items():
            kind, callback = self._reader(source)
            self.create_subscription(kind, source.topic, functools.partial(callback, name), ANY_COMMAND)
        for name, lock in self._robot.mux.locks.items():
            listen_closely(self, Bool, lock.topic, functools.partial(self._on_lock, name))
            if not lock.required:
                self.get_logger().warning(
                    f"lock {name} is not required (timeout 0): the mux does not detect that its publisher ended"
                )

    def _refuse_own_topics(self) -> None:
        topics = {name: self.resolve_topic_name(source.topic) for name, source in self._robot.mux.sources.items()}
        problem = wrong_topic(topics, [self.resolve_topic_name(output) for output in (*OUTPUTS, MEASURED)])
        if problem:
            raise WrongStartError(f"{self.get_fully_qualified_name()}: {problem}")

    def _reader(self, source: MuxSource) -> tuple[type[Any], Callable[[str, Any], None]]:
        """The messages of a source, and what takes them in."""
        if source.type == JOINTS:
            return JointState, self._on_joints
        return (TwistStamped, self._on_stamped) if source.stamped else (TwistMessage, self._on_plain)

    def _on_stamped(self, name: str, message: TwistStamped) -> None:
        now_s = time.monotonic()
        self._on_twist(name, twist_of(message.twist), now_s, sent_at(message.header.stamp, time.time(), now_s))

    def _on_plain(self, name: str, message: TwistMessage) -> None:
        self._on_twist(name, twist_of(message), time.monotonic(), None)

    def _on_joints(self, name: str, message: JointState) -> None:
        now_s = time.monotonic()
        velocity = base_velocity(message, self._robot)
        if isinstance(velocity, Refusal):
            self._mux.refuse(name, velocity.why)
            self._log_refusal(name, velocity.why)
            return
        twist = Twist(velocity.linear_mps, velocity.angular_radps)
        self._on_twist(name, twist, now_s, sent_at(message.header.stamp, time.time(), now_s))

    def _log_refusal(self, name: str, why: str) -> None:
        self.get_logger().warning(f"{name} refused: {why}", throttle_duration_sec=5.0)

    def _on_twist(self, name: str, twist: Twist, now_s: float, sent: Sent | None) -> None:
        received, times = self._receive_times.at(now_s), None if sent is None else (sent.stamp_s, sent.wall_s)
        self._note("command", now_s, name, twist.linear_mps, twist.angular_radps, received, times)
        if not self._mux.accept_command(name, twist, received, now_s, sent):
            self._log_refusal(name, NOT_FINITE)
        decision = self._decide(now_s)
        if decision.active == name or decision.active != self._decision.active:
            self._timer.reset()  # a source faster than the timer is not doubled by it
            self._send(decision, now_s)

    def _on_driver(self, message: DriverStatus) -> None:
        now_s = time.monotonic()
        state, received = driver_state(message.state), self._receive_times.at(now_s)
        self._note("driver", now_s, int(state), message.cycles, received)
        self._mux.on_driver(state, message.cycles, received)
        self._send_if_changed(now_s)

    def _on_lock(self, name: str, message: Bool) -> None:
        now_s = time.monotonic()
        received = self._receive_times.at(now_s)
        self._note("lock", now_s, name, message.data, received)
        self._mux.on_lock(name, message.data, received)
        self._send_if_changed(now_s)

    def _check_graph(self) -> None:
        """Into the ROS graph. What is found there is logged when it comes."""
        now_s = time.monotonic()
        before = self._decision.foreign
        heard_at = {topic: self.resolve_topic_name(topic) for topic in self._heard}
        names = {topic.topic for topic in self._watch.expected} | set(heard_at.values())
        graph = {name: publishers(self, name) for name in names}
        foreign = self._watch.check_graph(graph, now_s)
        for found in foreign:
            if found not in before:
                fields = {"topic": found.topic, "node": found.node}
                self._event_log.write(found.sentence, found.priority, robot=self._robot.name, **fields)
        self._note("foreign", now_s, [asdict(found) for found in foreign])
        self._mux.on_foreign(foreign)
        for topic, kind in self._heard.items():
            there = [found for found in graph[heard_at[topic]] if found.kind == kind]
            nodes, keys = [found.node for found in there], [found.key for found in there]
            self._note("publishers", now_s, topic, nodes, keys)
            self._mux.on_publishers(topic, nodes, keys)
        self._send_if_changed(now_s)

    def _send_if_changed(self, now_s: float) -> None:
        decision = self._decide(now_s)
        if decision.essence != self._decision.essence:
            self._send(decision, now_s)

    def _tick(self) -> None:
        """Nothing was sent for a period: repeats what holds, or zero."""
        now_s = time.monotonic()
        self._receive_times.at(now_s)
        self._send(self._decide(now_s), now_s)

    def _decide(self, now_s: float) -> MuxDecision:
        if self._follower is not None:
            self._mux.on_estop(self._follower.estop_free)
            self._mux.on_scans(self._follower.without_scans)
        decision = self._mux.shutdown(now_s) if self._ending else self._mux.decide(now_s)
        self._note(*mux_entry("mux_shutdown" if self._ending else "mux", now_s, decision))
        return decision

    def _send(self, decision: MuxDecision, now_s: float) -> None:
        """The filter first: what is published afterwards is for people."""
        if self._follower is not None:
            self._follower.obey(decision.twist, now_s)
        stamp = self.get_clock().now().to_msg()
        if self._commands.get_subscription_count() > 0:
            order = decision.twist
            self._commands.publish(self._serialized.pack(order.linear_mps, order.angular_radps, stamp))
        if decision.essence != self._decision.essence or now_s >= self._state_due_s:
            self._states.publish(mux_state(decision, stamp))
            self._state_due_s = next_turn(self._state_due_s, now_s, STATE_PERIOD_S)
        for sentence, priority, fields in self._repeats.thinned(changes(self._decision, decision), now_s):
            self._event_log.write(sentence, priority, robot=self._robot.name, **fields)
        self._decision = decision

    def _diagnose(self) -> None:
        stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(diagnostics(self._decision, self._robot.name, tuple(self._deaf), stamp))
