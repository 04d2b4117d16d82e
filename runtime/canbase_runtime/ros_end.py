"""The end of ROS in a process that serves. Call it when the base is at standstill: it takes 2 × READ_S.

A listener that stays, such as the daemon of `ros2`, takes in again what it reads about a node after the process has
left the network, for as long as it runs (rmw_dds_common, GraphCache). So the last thing to read is that the process has
no node, and it stays on the network until that was read. The endpoints go first: each of them is news of its own, and
what comes last must not be lost in their burst.
"""

from __future__ import annotations

import time
from contextlib import ExitStack
from typing import Final

import rclpy
from rclpy.action import ActionClient, ActionServer
from rclpy.node import Node

READ_S: Final = 0.1
"""A listener reads within this time what was published about a node [s]."""


def end_ros(*nodes: Node) -> None:
    """Destroys the nodes, which no executor spins any more, and shuts ROS down. Last: one without rosout, if any."""
    with ExitStack() as shutdown:
        shutdown.callback(rclpy.try_shutdown)
        for node in nodes:
            _destroy_endpoints(node)
        time.sleep(READ_S)
        for node in nodes:
            node.destroy_node()
        time.sleep(READ_S)


def _destroy_endpoints(node: Node) -> None:
    for action in list(node.waitables):
        if isinstance(action, (ActionClient, ActionServer)):  # destroy_node leaves them, and they keep the node
            action.destroy()
    for publisher in list(node.publishers):
        node.destroy_publisher(publisher)
    for subscription in list(node.subscriptions):
        node.destroy_subscription(subscription)
    for service in list(node.services):
        node.destroy_service(service)
