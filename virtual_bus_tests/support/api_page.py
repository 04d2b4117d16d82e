"""The tables of docs/ros_api.md, and the same as a running node has it: names, types, reliability and durability."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from rclpy.action import get_action_server_names_and_types_by_node
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

PAGE = Path(__file__).parents[2] / "docs" / "ros_api.md"
SERVICES = {"std_srvs/srv/Trigger", "action_msgs/srv/CancelGoal"}
"""The types of canbase's own services; those of ROS and the hidden ones of actions are not on the page."""
QOS = ("reliable", "best effort", "latched")
OF_EVERY_NODE = ("/rosout", "/parameter_events")
OPTIONAL = {"/tf", "/tf_static", "/battery_state", "/motor_driver/values"}
"""Without tf2_msgs, without a scanner with `pose: tf`, or without `battery` or `values` in robot.yaml, there are
none."""


class Endpoint(NamedTuple):
    """One row of a table: `qos` has a word for each subscription of that topic; empty for services and actions."""

    way: str
    name: str
    type: str
    qos: frozenset[str]


def documented(node: str) -> set[Endpoint]:
    """What the page has under the heading with the node's name, but for rows whose topics robot.yaml names."""
    section = PAGE.read_text(encoding="utf-8").split(f"\n## {node}\n")[1].split("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("| ")]
    return {found for way, names, *rest in rows if names.startswith("`") for found in _row(way, names, *rest[:2])}


def _row(way: str, names: str, kind: str, qos: str) -> Iterator[Endpoint]:
    package, name = kind.split()[0].rsplit("/", 1)
    middle = "srv" if way == "service" else "msg"
    full = f"{package}/{name}" if way == "action" else f"{package}/{middle}/{name}"
    words = frozenset(word for word in QOS if word in qos) if way in ("in", "out") else frozenset()
    for topic in re.findall(r"`(\S+)`", names.split(", and ")[0]):
        yield Endpoint(way, topic if topic.startswith("/") else f"/{topic}", full, words)


def present(observer: Node, node: str) -> set[Endpoint]:
    """The topics, services and actions of that node in the root namespace, as the graph shows them."""
    services = observer.get_service_names_and_types_by_node(node, "/")
    found = {
        Endpoint("service", name, kind, frozenset())
        for name, types in services
        for kind in SERVICES.intersection(types)
        if "/_action/" not in name
    }
    for name, types in get_action_server_names_and_types_by_node(observer, node, "/"):
        found |= {Endpoint("action", name, kind, frozenset()) for kind in types}
    for way, topics, of_topic in (
        ("out", observer.get_publisher_names_and_types_by_node(node, "/"), observer.get_publishers_info_by_topic),
        ("in", observer.get_subscriber_names_and_types_by_node(node, "/"), observer.get_subscriptions_info_by_topic),
    ):
        for topic, _ in topics:
            if "/_action/" in topic or topic.endswith("/transition_event") or topic in OF_EVERY_NODE:
                continue
            mine = [each for each in of_topic(topic) if each.node_name == node]
            words = frozenset(_word(each.qos_profile) for each in mine)
            found |= {Endpoint(way, topic, each.topic_type, words) for each in mine}
    return found


def _word(qos: QoSProfile) -> str:
    if qos.durability is DurabilityPolicy.TRANSIENT_LOCAL:
        return "latched"
    return "reliable" if qos.reliability is ReliabilityPolicy.RELIABLE else "best effort"
