"""Subscribes to the topics of the ROS graph, and writes each message as it came."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from canbase_recording.mcap_file import McapFile
from canbase_recording.ros_types import message_class, whole_definition

DEPTH = 200
"""Messages of one topic that may wait: 2 s at 100 Hz."""


class TopicRecorder:
    """`failure`: why recording ended by itself; empty: it goes on. Topics of unknown types are logged and left out."""

    def __init__(self, node: Node, file: McapFile, topics: Sequence[str] | None) -> None:
        """`topics`: names to record, relative ones below the node's namespace; None: all that are not hidden."""
        self.failure = ""
        self._node, self._file = node, file
        self._wanted = None if topics is None else {node.resolve_topic_name(topic) for topic in topics}
        self._taken: set[str] = set()

    def look(self) -> None:
        """Subscribes to topics that are new in the graph."""
        for topic, types in self._node.get_topic_names_and_types():
            if topic in self._taken or not self._is_wanted(topic):
                continue
            publishers = self._node.get_publishers_info_by_topic(topic)
            if not publishers:
                continue
            self._taken.add(topic)
            try:
                kind, text = message_class(types[0]), whole_definition(types[0])
            except (ModuleNotFoundError, AttributeError, ValueError) as error:
                self._node.get_logger().warning(f"{topic} is not recorded: {types[0]} is not known here ({error})")
                continue
            self._file.add_topic(topic, types[0], text)
            self._node.create_subscription(kind, topic, self._writer_of(topic), _qos(publishers), raw=True)

    def _is_wanted(self, topic: str) -> bool:
        """Hidden ones, of which a part begins with `_` as those of actions, only by name: as `ros2 bag record` does."""
        return "/_" not in topic if self._wanted is None else topic in self._wanted

    def _writer_of(self, topic: str) -> Callable[[bytes], None]:
        def write(data: bytes) -> None:
            if self.failure:
                return
            try:
                self._file.add(topic, data, time.time_ns())
            except OSError as error:
                self.failure = error.strerror or str(error)

        return write


def _qos(publishers: Sequence[Any]) -> QoSProfile:
    """Matches every publisher: what all of them offer; with what they kept where all of them keep it."""
    keeps = all(found.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for found in publishers)
    reliable = all(found.qos_profile.reliability == ReliabilityPolicy.RELIABLE for found in publishers)
    return QoSProfile(
        depth=DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if keeps else DurabilityPolicy.VOLATILE,
    )
