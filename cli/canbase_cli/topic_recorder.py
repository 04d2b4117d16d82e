"""Subscribes to the topics of the ROS graph, and writes each message as it came."""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from canbase_cli.mcap_file import McapFile
from canbase_cli.ros_definition import definition, of_fields

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
                kind, text = _message_class(types[0]), definition(types[0], _definition_of)
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


def _message_class(name: str) -> Any:
    """Of a type such as nav_msgs/msg/Odometry. Raises ModuleNotFoundError, AttributeError: not installed."""
    package, space, kind = name.split("/")
    found: Any = importlib.import_module(f"{package}.{space}")
    if space == "action":  # the feedback of an action, and the message around it
        action, part = kind.rsplit("_", 1)
        found = getattr(found, action)
        return getattr(found.Impl if part == "FeedbackMessage" else found, part)
    return getattr(found, kind)


def _definition_of(package: str, space: str, kind: str) -> str:
    """The .msg file, which has comments and constants; where there is none, as for an action's feedback: the fields."""
    try:
        return (_share_folder(package) / space / f"{kind}.msg").read_text(encoding="utf-8")
    except OSError:
        return of_fields(_message_class(f"{package}/{space}/{kind}").get_fields_and_field_types())


def _share_folder(package: str) -> Path:
    """Of a sourced ROS 2, or of the ROS wheels in this environment."""
    try:
        return Path(get_package_share_directory(package))
    except (PackageNotFoundError, OSError):
        return Path(sys.prefix) / "share" / package
