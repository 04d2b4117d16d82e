"""The page's connection with the robot: its topics, its services, its goals. The shell of ROS; it decides nothing.

No executor runs: the newest message of a topic is taken when a page shows it, so that a page at 20 Hz costs the same
whatever the rate of the topic is, and none costs nothing.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from typing import Any, Final

import rclpy
from canbase.msg import DriverStatus, MuxState, SafetyState, StopEvent
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState, LaserScan
from std_srvs.srv import Trigger

from canbase_action_server.client import DriveClient, DriveResult
from canbase_action_server.goal_client import executor_of
from canbase_action_server.goal_errors import DriveError
from canbase_config.robot import Robot as RobotConfig
from canbase_runtime.foreign_text import SENTENCE_LENGTH, clean, printable
from canbase_runtime.last_message import NOT_RECEIVED, LastMessage
from canbase_runtime.message_reader import MessageReader
from canbase_runtime.receive_time import ReceiveTimes
from canbase_runtime.ros_end import end_ros
from canbase_web.hold import Speed
from canbase_web.now_view import Robot

LATCHED: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NEWEST: Final = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
ALL_STOPS: Final = 50
STOP_ANSWER_S: Final = 2.0
"""The driver answers with its next cycle."""
LOOK_S: Final = 0.02
TOPICS: Final[dict[str, tuple[type, str, QoSProfile]]] = {
    "mux": (MuxState, "velocity_mux/state", LATCHED),
    "safety": (SafetyState, "safety_filter/state", LATCHED),
    "driver": (DriverStatus, "motor_driver/status", NEWEST),
    "odom": (Odometry, "odom", NEWEST),
    "joints": (JointState, "joint_states", NEWEST),
    "selected": (TwistStamped, "cmd_vel_mux", NEWEST),
    "ordered": (TwistStamped, "cmd_vel", NEWEST),
}


class RobotLink:
    """One node without an executor, and one for goals, which their own thread spins. Close it at the end."""

    def __init__(self, config: RobotConfig, source: str, ros_args: list[str]) -> None:
        """`source`: the key of `mux.sources` on whose topic `order` publishes; empty: there is none."""
        rclpy.init(args=ros_args, signal_handler_options=SignalHandlerOptions.NO)
        self._node = node = rclpy.create_node("canbase_web", enable_rosout=False, start_parameter_services=False)
        self._kept: dict[str, tuple[Any, float]] = {}
        self._reader = MessageReader()
        self._receive_times = ReceiveTimes()
        self._receive_times.at(time.monotonic())
        self._topics = {
            name: node.create_subscription(kind, topic, _unused, qos) for name, (kind, topic, qos) in TOPICS.items()
        }
        self._scans = [
            node.create_subscription(LaserScan, scanner.topic, _unused, NEWEST) for scanner in config.safety.scans
        ]
        latched_stops = QoSProfile(depth=ALL_STOPS, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._stops = node.create_subscription(StopEvent, "stop_events", _unused, latched_stops)
        self.stops: list[Any] = []
        """StopEvent, the newest last."""
        self._stop = node.create_client(Trigger, "motor_driver/stop")
        self._stop_answers: dict[int, Any] = {}
        """By the number of the request."""
        self._order: Any = None
        if source:
            key = config.mux.sources[source]
            self._stamped = key.stamped
            self._order = node.create_publisher(TwistStamped if key.stamped else Twist, key.topic, 1)
        self.goals = Goals()

    def robot(self, now_s: float) -> Robot:
        """The newest message of each topic, and its age at `now_s` (time.monotonic).

        While no page was open nothing was taken: what has waited since then counts as old.
        """
        received_s = self._receive_times.at(now_s)
        for name in self._topics:
            self._look(name, received_s)
        return Robot(**{name: self._last(name, now_s) for name in self._kept})

    def newest(self, name: str, now_s: float) -> LastMessage:
        """Of one topic alone."""
        self._look(name, self._receive_times.at(now_s))
        return self._last(name, now_s)

    def _look(self, name: str, received_s: float) -> None:
        if (message := self._reader.take(self._topics[name])) is not None:
            self._kept[name] = (clean(message), received_s)

    def _last(self, name: str, now_s: float) -> LastMessage:
        if name not in self._kept:
            return NOT_RECEIVED
        message, at_s = self._kept[name]
        return LastMessage(message, now_s - at_s)

    def scans(self) -> list[Any]:
        """The scan of each scanner that came since the last call, or None."""
        return [self._reader.take(subscription) for subscription in self._scans]

    def new_stops(self) -> list[Any]:
        """All stops until now, the newest last."""
        while (message := self._reader.take(self._stops)) is not None:
            self.stops = [*self.stops[1 - ALL_STOPS :], clean(message)]
        return self.stops

    def order(self, speed: Speed) -> None:
        """Publish a velocity as a source of the mux."""
        if self._order is None:
            return
        twist = Twist()
        twist.linear.x, twist.angular.z = speed.linear_mps, speed.angular_radps
        if self._stamped:
            stamped = TwistStamped(twist=twist)
            stamped.header.stamp = self._node.get_clock().now().to_msg()
            self._order.publish(stamped)
        else:
            self._order.publish(twist)

    @property
    def has_driver(self) -> bool:
        """Whether a motor driver offers to be stopped."""
        return bool(self._stop.service_is_ready())

    async def stop(self) -> tuple[bool, str]:
        """Call motor_driver/stop; whether the driver stops, and its sentence. Several pages may do it at once."""
        client = self._stop
        end_s = time.monotonic() + STOP_ANSWER_S
        if not self.has_driver:
            return False, f"no motor driver offers {client.srv_name}: is canbase up running, in this namespace?"
        with client.handle:
            number = client.handle.send_request(Trigger.Request())
        while number not in self._stop_answers:
            if time.monotonic() >= end_s:
                return False, f"{client.srv_name} did not answer within {STOP_ANSWER_S:.0f} s"
            await asyncio.sleep(LOOK_S)
            with client.handle:
                header, answer = client.handle.take_response(Trigger.Response)
            if header is not None:
                self._stop_answers[header.request_id.sequence_number] = answer
        answer = self._stop_answers.pop(number)
        return bool(answer.success), printable(answer.message, SENTENCE_LENGTH)

    def close(self) -> None:
        """Cancel what runs; then ROS ends."""
        self.goals.close()
        end_ros(self.goals.node, self._node)


class Goals:
    """One goal of drive_distance at a time, in a thread of its own. `text`: how it stands, for the person."""

    def __init__(self) -> None:
        self.node = rclpy.create_node("canbase_web_goals", enable_rosout=False, start_parameter_services=False)
        self._client = DriveClient(self.node, executor_of(self.node))
        self._thread: threading.Thread | None = None
        self._canceled = threading.Event()
        self.text = "no goal yet: its progress and its result will be here"
        self.share = 0.0
        """Of the distance that was driven."""

    @property
    def runs(self) -> bool:
        """Whether a goal is under way."""
        return self._thread is not None and self._thread.is_alive()

    def start(self, distance_m: float, speed_mps: float, is_lost: Callable[[], bool]) -> None:
        """Send a goal; what becomes of it is in `text`. It is canceled when `is_lost()`: who sent it has gone."""
        if self.runs:
            return
        self._canceled.clear()
        self.text, self.share = "sent", 0.0
        self._thread = threading.Thread(
            target=self._run, args=(distance_m, speed_mps, is_lost), name="goal", daemon=True
        )
        self._thread.start()

    def cancel(self) -> None:
        """Request its end."""
        self._canceled.set()

    def close(self) -> None:
        """Cancel, and wait for a moment: a server cancels what a client leaves behind by its own rules."""
        self.cancel()
        if self._thread is not None:
            self._thread.join(5.0)

    def _run(self, distance_m: float, speed_mps: float, is_lost: Callable[[], bool]) -> None:
        def ends() -> bool:
            return self._canceled.is_set() or is_lost()

        def show(feedback: Any) -> None:
            self.share = 1.0 - feedback.remaining_m / abs(distance_m)
            self.text = f"{feedback.traveled_m:+.3f} m, {feedback.remaining_m:.3f} m left"

        try:
            goal = self._client.send(distance_m, speed_mps, on_feedback=show, interrupted=ends)
            result = goal.wait(until=ends)
            if result is None:
                self.text = "canceling; waiting for standstill"
                goal.cancel()
                result = goal.wait(20.0)
            self.text = _ended(result)
        except DriveError as error:
            self.text = printable(str(error), SENTENCE_LENGTH)


def _ended(result: DriveResult | None) -> str:
    if result is None:
        return "no result yet: the base may still move"
    return f"{result.status.name} ({result.code.name}): {printable(result.message, SENTENCE_LENGTH)}"


def _unused(message: Any) -> None:
    """Nothing spins this node."""
