"""Helpers of the tests over DDS: real processes with captured logs, a node that waits with deadlines, a robot.yaml.

Used with the fixtures in conftest.py. Nothing here knows what canbase decides.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, TypeVar

import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions

from canbase_base.latch_file import create_first
from canbase_base.latch_folder import latch_folder
from support.udp_port import free_udp_port

T = TypeVar("T")


class Process:
    """A process under test; its output goes to a file. Ends with `close`, or with the fixture `spawn` that made it."""

    def __init__(self, argv: Sequence[str], log_path: Path, env: Mapping[str, str] | None = None) -> None:
        self.log_path = log_path
        with log_path.open("wb") as log:
            self._popen = subprocess.Popen(
                list(argv), stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                env={**os.environ, "PYTHONUNBUFFERED": "1", "PYTHONFAULTHANDLER": "1", **(env or {})},
            )  # fmt: skip

    @property
    def pid(self) -> int:
        """Process id."""
        return self._popen.pid

    @property
    def exit_code(self) -> int | None:
        """None while it runs; negative: ended by that signal."""
        return self._popen.poll()

    def log(self) -> str:
        """All that it has written to stdout and stderr so far."""
        return self.log_path.read_text(errors="replace")

    def terminate(self) -> None:
        """SIGTERM."""
        self._popen.send_signal(signal.SIGTERM)

    def interrupt(self) -> None:
        """SIGINT, as from Ctrl-C."""
        self._popen.send_signal(signal.SIGINT)

    def kill(self) -> None:
        """SIGKILL."""
        self._popen.kill()

    def stop(self) -> None:
        """SIGSTOP: it hangs, and its sockets stay open."""
        self._popen.send_signal(signal.SIGSTOP)

    def resume(self) -> None:
        """SIGCONT after `stop`."""
        self._popen.send_signal(signal.SIGCONT)

    def wait(self, timeout_s: float) -> int:
        """Its exit code. Fails with its log when it still runs after timeout_s."""
        try:
            return self._popen.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"still running after {timeout_s} s; its log:\n{self.log()}") from None

    def close(self) -> None:
        """Ends it whatever it does, and reaps it. As systemd ends a service that hangs: its log then has the stacks of
        its threads."""
        if self._popen.poll() is None:
            self._popen.send_signal(signal.SIGABRT)
            with contextlib.suppress(subprocess.TimeoutExpired):  # SIGSTOP holds it
                self._popen.wait(ABORT_S)
            self._popen.kill()
        self._popen.wait(10.0)


def clear_records(folder: Path, *robots: str) -> dict[str, str]:
    """Environment with a state folder of its own, in which these robots have clear records of stops."""
    environment = {"XDG_STATE_HOME": str(folder / "state")}
    for robot in robots:
        create_first(latch_folder(environment, folder, robot), robot)
    return environment


def python_argv(code: str) -> list[str]:
    """Command line that runs `code` in this Python environment."""
    return [sys.executable, "-c", code]


ABORT_S = 0.5
"""A process ends by SIGABRT within this time [s]."""
RELEASE_S = 0.2
"""A source commands zero for this long [s]: some of it arrives on a loaded computer too."""


class Recorder(Generic[T]):
    """What arrived on one topic: messages and the times when they were sent, oldest first.

    Not when they were taken out of the queue: while a test waits for something else, messages wait in it.
    """

    def __init__(self) -> None:
        self.messages: list[T] = []
        self.times_s: list[float] = []

    def on_message(self, message: T, info: Mapping[str, int]) -> None:
        """Callback of the subscription."""
        age_s = time.time() - 1e-9 * info["source_timestamp"]
        self.messages.append(message)
        self.times_s.append(time.monotonic() - age_s)

    @property
    def last(self) -> T | None:
        """The newest message; None before the first."""
        return self.messages[-1] if self.messages else None

    def since(self, start_s: float) -> list[T]:
        """Messages that were sent at or after start_s (time.monotonic)."""
        return [message for message, at_s in zip(self.messages, self.times_s, strict=True) if at_s >= start_s]

    def clear(self) -> None:
        """Forgets everything."""
        self.messages.clear()
        self.times_s.clear()


class Repeater(Generic[T]):
    """Publishes `message` at a fixed rate while the node spins. `message` may be changed; None: nothing."""

    def __init__(self, node: Node, kind: type[T], topic: str, rate_hz: float, qos: QoSProfile | int) -> None:
        self.kind = kind
        self.message: T | None = None
        self.prepare: Callable[[T], T] = lambda message: message
        """Makes what is sent of `message`, each time."""
        self.sent = 0
        self.publisher = node.create_publisher(kind, topic, qos)
        self._timer = node.create_timer(1.0 / rate_hz, self._tick)

    def _tick(self) -> None:
        if self.message is not None:
            self.publisher.publish(self.prepare(self.message))
            self.sent += 1


BLACK_BOX = "_motor_driver_black_box"


class TestNode:
    """A ROS node in a context of its own that spins only inside `wait_for` and `spin_for`. Close it, or use `with`."""

    __test__ = False  # its name makes pytest look for tests in it

    def __init__(self, name: str = "test_node", namespace: str = "", domain_id: int | None = None) -> None:
        """`domain_id` None: that of the environment."""
        self.context = Context()
        no_signals = SignalHandlerOptions.NO
        rclpy.init(args=[], context=self.context, domain_id=domain_id, signal_handler_options=no_signals)
        self.node = Node(name, namespace=namespace, context=self.context, enable_rosout=False)
        self._played: dict[str, Node] = {}
        self._sources: dict[str, Repeater[Any]] = {}
        self.ends = contextlib.ExitStack()
        """What ends before this node."""
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def record(self, kind: type[T], topic: str, qos: QoSProfile | int = 50) -> Recorder[T]:
        """A subscription that keeps everything."""
        recorder: Recorder[T] = Recorder()
        with_times: Any = recorder.on_message  # rclpy gives the times to a callback with two arguments
        self.node.create_subscription(kind, topic, with_times, qos)
        return recorder

    def repeat(
        self, kind: type[T], topic: str, rate_hz: float, qos: QoSProfile | int = 1, owner: str = ""
    ) -> Repeater[T]:
        """A publisher that publishes nothing until its `message` is set. `owner`: the node that it stands for."""
        return Repeater(self.played(owner) if owner else self.node, kind, topic, rate_hz, qos)

    def played(self, name: str) -> Node:
        """A node of that name beside this one: what it publishes comes from the node that should."""
        if name not in self._played:
            space = self.node.get_namespace()
            self._played[name] = Node(name, namespace=space, context=self.context, enable_rosout=False)
            self.executor.add_node(self._played[name])
        return self._played[name]

    def source(self, topic: str = "cmd_vel_joy", kind: type[Any] = TwistStamped, qos: QoSProfile | int = 1) -> Any:
        """A source of the mux at 50 Hz that may drive: it was found, and has commanded zero for a moment.

        One for each topic: of two publishers there the mux would follow neither.
        """
        if topic not in self._sources:
            self._sources[topic] = self.repeat(kind, topic, 50.0, qos)
        repeater = self._sources[topic]
        self.wait_for_subscriber(repeater.publisher, 15.0)
        self.release(repeater)
        return repeater

    def release(self, *sources: Repeater[Any]) -> None:
        """These sources command zero for a moment, and publish nothing then."""
        for source in sources:
            source.message = source.kind()
        self.spin_for(RELEASE_S)
        for source in sources:
            source.message = None

    def wait_for(self, predicate: Callable[[], T], timeout_s: float, what: str = "the condition") -> T:
        """Spins until predicate() is true and returns its value. Fails with `what` when timeout_s is over."""
        deadline_s = time.monotonic() + timeout_s
        while not (value := predicate()):
            left_s = deadline_s - time.monotonic()
            if left_s <= 0.0:
                raise AssertionError(f"waited {timeout_s} s in vain for {what}")
            self.executor.spin_once(timeout_sec=min(left_s, 0.05))
        return value

    def spin_for(self, duration_s: float) -> None:
        """Handles what arrives for duration_s."""
        deadline_s = time.monotonic() + duration_s
        while (left_s := deadline_s - time.monotonic()) > 0.0:
            self.executor.spin_once(timeout_sec=left_s)

    def wait_for_subscriber(self, publisher: Any, timeout_s: float = 10.0, count: int = 1) -> None:
        """Until `publisher` has found that many subscribers: what it publishes then, arrives."""
        self.wait_for(lambda: self._reaches(publisher, count), timeout_s, f"{count} subscriber(s) of {publisher.topic}")

    def _reaches(self, publisher: Any, count: int) -> bool:
        """It has found so many besides the driver's black box, which obeys nothing."""
        found = self.node.get_subscriptions_info_by_topic(publisher.topic_name)
        boxes = sum(each.node_name == BLACK_BOX for each in found)
        matched = int(publisher.get_subscription_count())
        return bool(len(found) - boxes >= count and matched >= count + boxes)

    def close(self) -> None:
        """Leaves the ROS graph."""
        self.ends.close()
        self.executor.shutdown()
        for node in (self.node, *self._played.values()):
            node.destroy_node()
        self.context.try_shutdown()

    def __enter__(self) -> TestNode:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def reserve_domain(first: int) -> tuple[int, socket.socket]:
    """A ROS domain id (1–99) that no other test on this machine holds, and the socket that holds it until closed."""
    for step in range(99):
        domain = 1 + (first + step) % 99
        holder = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            holder.bind(f"\0canbase-test-domain-{domain}")
        except OSError:
            holder.close()
            continue
        return domain, holder
    raise RuntimeError("all 99 ROS domains are held by other tests on this machine")


def merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with `changes` laid over it, mapping by mapping; lists and plain values are replaced."""
    result = dict(base)
    for key, value in changes.items():
        nested = isinstance(value, Mapping) and isinstance(result.get(key), Mapping)
        result[key] = merged(result[key], value) if nested else value
    return result


def robot_values(folder: Path) -> dict[str, Any]:
    """Keys of a robot.yaml with two simulated drives, a bus of its own (UDP port) and its lease socket in `folder`."""
    return {
        "bus": {
            "interface": "udp_multicast",
            "channel": "239.74.163.2",
            "extra": {"port": free_udp_port(), "hop_limit": 0},
        },
        "drives": [_drive("left", 1, 1), _drive("right", 2, -1)],
        "base": {"wheel_radius_m": 0.1, "track_m": 0.4},
        "limits": {
            "linear_mps": 1.0,
            "angular_radps": 2.0,
            "acceleration_mps2": 1.0,
            "deceleration_mps2": 1.0,
            "emergency_deceleration_mps2": 2.0,
            "angular_acceleration_radps2": 4.0,
            "angular_deceleration_radps2": 4.0,
        },
        "safety": {
            "footprint": {"front_m": 0.3, "rear_m": 0.3, "left_m": 0.25, "right_m": 0.25},
            "scan": {"required": True},
            "estop": {"required": False},
        },
        "lease": {"socket": str(folder / "lease")},
    }


def _drive(side: str, node_id: int, direction: int) -> dict[str, Any]:
    return {
        "joint": f"{side}_wheel",
        "node_id": node_id,
        "side": side,
        "direction": direction,
        "gear_ratio": 20.0,
        "counts_per_motor_rev": 10_000,
        "velocity_unit": "0.001rev/s",
    }
