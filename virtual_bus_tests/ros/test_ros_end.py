"""What a program leaves in the graph of a listener that stays: nothing, while its process still runs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from canbase.action import DriveDistance
from rclpy.action import ActionServer
from rclpy.signals import SignalHandlerOptions

from canbase_driver.ros.managed_node import ManagedNode
from canbase_driver.supervision.lifecycle import Aim
from canbase_runtime.ros_end import end_ros
from support.ros_harness import TestNode

pytestmark = pytest.mark.ros

NAMES = {"ends_managed", "ends_server"}


def test_an_end_leaves_no_node_to_a_listener(test_node: TestNode) -> None:
    """rclpy's destroy_node leaves one with a lifecycle, and one with an action."""

    def seen() -> set[str]:
        return NAMES & set(test_node.node.get_node_names())

    for _ in range(2):
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        loop: Any = SimpleNamespace(aimed_at=Aim.RELEASED)
        managed, server = ManagedNode("ends_managed", loop), rclpy.create_node("ends_server")
        kept = ActionServer(server, DriveDistance, "ends_action", execute_callback=lambda _goal: None)
        test_node.wait_for(lambda: seen() == NAMES, 20.0, "both nodes")
        end_ros(managed, server)
        test_node.wait_for(lambda: not seen(), 5.0, "the end of both")
        assert not rclpy.ok()
        del kept
