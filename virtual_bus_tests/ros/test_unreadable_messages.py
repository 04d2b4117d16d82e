"""Bytes that are no message, on the topics of every process: they end nothing, and the next message arrives."""

from __future__ import annotations

import ast
import importlib
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from canbase.msg import DriverStatus, MuxState, SafetyState, StopEvent
from prometheus_client.parser import text_string_to_metric_families
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.serialization import serialize_message

from ros.conftest import Spawn
from support.browser import free_tcp_port
from support.ros_harness import TestNode

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]
ROOT = Path(__file__).parents[2]
FOLDERS = ("action_server", "cli", "doctor", "driver", "fleet", "velocity_mux", "web")
PATIENCE_S = 30.0
CANBASE = (sys.executable, "-m", "canbase_cli")
TOPICS = {
    "motor_driver/status": DriverStatus,
    "safety_filter/state": SafetyState,
    "velocity_mux/state": MuxState,
    "stop_events": StopEvent,
}


def subscribed() -> list[tuple[str, str]]:
    """Package and name of every message that a file which subscribes imports."""
    found: set[tuple[str, str]] = set()
    for folder in FOLDERS:
        for file in (ROOT / folder).rglob("*.py"):
            text = file.read_text("utf-8")
            if "create_subscription(" in text or "_listen(" in text or "listen_closely(" in text:
                found |= set(imported(ast.parse(text)))
    return sorted(found)


def imported(tree: ast.AST) -> Iterator[tuple[str, str]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").endswith(".msg"):
            for name in node.names:
                yield str(node.module), name.name


KINDS = subscribed()


def mangled(good: bytes) -> list[bytes]:
    """Nothing, a beginning, and a message whose numbers are all as large as can be."""
    return [b"", good[:5], good[:4] + b"\xff" * (len(good) - 4)]


def test_the_list_is_that_of_the_code() -> None:
    assert {("geometry_msgs.msg", "TwistStamped"), ("sensor_msgs.msg", "LaserScan")} <= set(KINDS)
    assert len(KINDS) >= 15


@pytest.mark.parametrize("make", [EventsExecutor, SingleThreadedExecutor])
def test_an_executor_drops_them(make: Callable[..., Executor], test_node: TestNode) -> None:
    """The services spin by the first, the tools by the second."""
    listener = Node("listener", context=test_node.context, enable_rosout=False)
    executor, received = make(context=test_node.context), dict[str, list[Any]]()
    executor.add_node(listener)
    pairs = []
    for package, name in KINDS:
        kind, topic = getattr(importlib.import_module(package), name), f"unreadable_{name.lower()}"
        listener.create_subscription(kind, topic, received.setdefault(topic, []).append, 10)
        pairs.append((test_node.node.create_publisher(kind, topic, 10), kind))
    test_node.wait_for(lambda: all(one.get_subscription_count() for one, _ in pairs), PATIENCE_S, "the listener")
    for publisher, kind in pairs:
        good = bytes(serialize_message(kind()))
        for data in (*mangled(good), good):
            publisher.publish(data)
    end_s = time.monotonic() + PATIENCE_S
    while not all(received.values()) and time.monotonic() < end_s:
        executor.spin_once(timeout_sec=0.05)
    executor.shutdown()
    assert [topic for topic, messages in received.items() if not messages] == []


class Stranger:
    """Publishes on the topics that metrics read: first what is no message, then a state."""

    def __init__(self, test_node: TestNode) -> None:
        self._publishers = [(test_node.node.create_publisher(kind, topic, 10), kind) for topic, kind in TOPICS.items()]

    def publish(self, *, with_good: bool) -> None:
        for publisher, kind in self._publishers:
            good = bytes(serialize_message(kind()))
            for data in (*mangled(good), *([good] if with_good else [])):
                publisher.publish(data)


def test_metrics_go_on_and_count_them(spawn: Spawn, robot_yaml: Path, test_node: TestNode) -> None:
    port = free_tcp_port()
    process = spawn([*CANBASE, "metrics", "--config", str(robot_yaml), "--port", str(port)])
    stranger = Stranger(test_node)

    def values() -> dict[str, float]:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5.0) as answer:
                families = list(text_string_to_metric_families(answer.read().decode()))
        except (urllib.error.URLError, ConnectionError):
            return {}
        return {s.name + s.labels.get("topic", ""): s.value for family in families for s in family.samples}

    def counted() -> bool:
        stranger.publish(with_good=False)
        return values().get("canbase_messages_dropped_total", 0.0) >= 4.0

    def shown() -> bool:
        stranger.publish(with_good=True)
        found = values()
        return all(found.get(f"canbase_data_age_seconds{topic}", 9.0) < 1.0 for topic in list(TOPICS)[:3])

    test_node.wait_for(counted, PATIENCE_S, f"the count of messages that are none: {process.log()}")
    test_node.wait_for(shown, PATIENCE_S, "the state after them")
    assert process.exit_code is None
