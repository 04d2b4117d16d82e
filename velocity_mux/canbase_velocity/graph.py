"""What the mux expects in the ROS graph and what is there. Queries a node, decides nothing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from rclpy.node import Node

from canbase_config.robot import Robot
from canbase_runtime.chain_topics import CHAIN, Use
from canbase_runtime.foreign_text import printable
from canbase_velocity.unexpected_publishers import Expected, Publisher

SCAN_KIND: Final = "sensor_msgs/msg/LaserScan"
BUTTON_KIND: Final = "std_msgs/msg/Bool"
CONSEQUENCES: Final = {
    Use.VELOCITY: "",
    Use.SHOWN: "; it does not move the base",
    Use.STATE: "; no goal runs meanwhile",
}
"""What else to report about a foreign publisher on a topic of the chain."""
_NO_NAME: Final = "_NODE_NAME_UNKNOWN_"


def expected(robot: Robot, node: Node) -> tuple[Expected, ...]:
    """The expected publishers: on every source's topic, and on those of the chain itself."""
    return (*_of_sources(robot, node), *_of_chain(node))


def heard(robot: Robot) -> dict[str, str]:
    """The topics of sources and locks as robot.yaml has them, each with its message type."""
    locks = {lock.topic: BUTTON_KIND for lock in robot.mux.locks.values()}
    return {source.topic: source.message_type for source in robot.mux.sources.values()} | locks


def publishers(node: Node, topic: str) -> list[Publisher]:
    """Every publisher on the topic of this full name; this process's own too."""
    return [
        Publisher(
            "" if info.node_name == _NO_NAME else printable(full_name(info.node_name, info.node_namespace)),
            printable(info.topic_type),
            bytes(info.endpoint_gid).hex(),
        )
        for info in node.get_publishers_info_by_topic(topic)
    ]


def full_name(name: str, namespace: str) -> str:
    """`name` in `namespace`; one with a leading / is full already."""
    return name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"


def _of_sources(robot: Robot, node: Node) -> Iterator[Expected]:
    for name, source in robot.mux.sources.items():
        nodes = tuple(full_name(allowed, node.get_namespace()) for allowed in source.nodes)
        yield Expected(node.resolve_topic_name(source.topic), source.message_type, name, nodes)


def _of_chain(node: Node) -> Iterator[Expected]:
    for row in CHAIN:
        yield Expected(
            node.resolve_topic_name(row.topic),
            row.type,
            None,
            (full_name(row.node, node.get_namespace()),),
            alone=True,
            obeyed=row.use is Use.VELOCITY,
            shown=row.use is Use.SHOWN,
            consequence=CONSEQUENCES[row.use],
        )
