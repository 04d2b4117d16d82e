"""The topics of one robot, read and never written: the shell of ROS. One node without an executor.

The newest message of each topic that can be read is kept: without a request this costs a look into four queues, and
three messages read, ten times a second. Subscriptions are best effort: no publisher waits for this process.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime, timezone
from types import FrameType
from typing import Any, Final

import rclpy
from canbase.msg import DriverStatus, MuxState, SafetyState, StopEvent
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from canbase_fleet.robot_view import DRIVER, MUX, SAFETY, STOPS, RobotView, counted
from canbase_runtime.foreign_text import NAME_LENGTH, SENTENCE_LENGTH, clean, printable
from canbase_runtime.last_message import NOT_RECEIVED, LastMessage
from canbase_runtime.message_reader import MessageReader
from canbase_runtime.receive_time import ReceiveTimes
from canbase_runtime.ros_end import end_ros

POLL_S: Final = 0.1
GAP_S: Final = 1.0
"""Two polls further apart: this process stood still, and what waited meanwhile may be as old [s]."""
MOST_BYTES: Final = 100_000
"""Of a message; eight drives take 4 kB."""
MOST_AT_ONCE: Final = 50
"""Stops in one poll; a stranger could publish without end."""
NEWEST: Final = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
STOP_QOS: Final = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
KINDS: Final[dict[str, type]] = {DRIVER: DriverStatus, SAFETY: SafetyState, MUX: MuxState}


class RobotTopics:
    """Close it at the end. `poll` belongs to one thread, `view` to any."""

    def __init__(self, node: str, ros_args: Sequence[str]) -> None:
        rclpy.init(args=list(ros_args), signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(node, enable_rosout=False, start_parameter_services=False)
        self._states = {
            topic: self._node.create_subscription(kind, topic, _unused, NEWEST, raw=True)
            for topic, kind in KINDS.items()
        }
        self._stop_events = self._node.create_subscription(StopEvent, STOPS, _unused, STOP_QOS, raw=True)
        self._receive_times = ReceiveTimes(GAP_S, POLL_S)
        self._lock = threading.Lock()
        self._reader = MessageReader()
        self._kept: dict[str, tuple[Any, float]] = {}
        self._stops: dict[tuple[str, str], int] = {}
        self._too_long = 0

    def poll(self, now_s: float) -> None:
        """Take what came. To be called every POLL_S; ages are as exact as that. `now_s`: time.monotonic()."""
        received_s = self._receive_times.at(now_s)
        for topic, subscription in self._states.items():
            for message in self._waiting(subscription, 1):
                with self._lock:
                    self._kept[topic] = message, received_s
        for event in self._waiting(self._stop_events, MOST_AT_ONCE):
            with self._lock:
                self._stops = counted(
                    self._stops, printable(event.stopped_by, NAME_LENGTH), printable(event.cause, NAME_LENGTH)
                )

    def view(self) -> RobotView:
        """The robot now."""
        with self._lock:
            kept, stops, dropped = dict(self._kept), self._stops, self._reader.dropped + self._too_long
        now_s = time.monotonic()
        driver, safety, mux = (_last(kept.get(topic), now_s) for topic in KINDS)
        return RobotView(driver, safety, mux, stops, dropped)

    def _waiting(self, subscription: Any, most: int) -> Iterator[Any]:
        """The messages that wait and can be read, the oldest first."""
        for _ in range(most):
            serialized = self._reader.take(subscription)
            if serialized is None:
                return
            if len(serialized) > MOST_BYTES:
                self._too_long += 1
            elif (message := self._reader.read(serialized, subscription.msg_type)) is not None:
                yield clean(message, SENTENCE_LENGTH)

    def close(self) -> None:
        """ROS ends."""
        end_ros(self._node)


def _last(kept: tuple[Any, float] | None, now_s: float) -> LastMessage:
    if kept is None:
        return NOT_RECEIVED
    message, received_s = kept
    return LastMessage(message, max(0.0, now_s - received_s))


def _unused(message: Any) -> None:
    """Nothing spins this node."""


def utc_now() -> str:
    """As VDA 5050 has it: 2026-11-25T04:05:06.78Z."""
    now = datetime.now(timezone.utc)
    return f"{now:%Y-%m-%dT%H:%M:%S}.{now.microsecond // 10_000:02d}Z"


@contextmanager
def end_signals() -> Iterator[threading.Event]:
    """Set by SIGINT and SIGTERM."""
    ended = threading.Event()

    def note(_number: int, _frame: FrameType | None) -> None:
        ended.set()

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield ended
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
