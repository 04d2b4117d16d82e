"""Which other nodes serve an action: from the ROS graph of this process."""

from __future__ import annotations

from rclpy.action.graph import get_action_server_names_and_types_by_node
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node


def other_servers(node: Node, action: str) -> list[str]:
    """Whole names of the nodes that serve `action` (a whole name) besides `node`; none of its own name, which may be
    what is left of its killed predecessor."""
    own = (node.get_name(), node.get_namespace())
    nodes = sorted(set(node.get_node_names_and_namespaces()) - {own})
    return [
        f"{namespace.rstrip('/')}/{name}" for name, namespace in nodes if action in actions_of(node, name, namespace)
    ]


def actions_of(node: Node, name: str, namespace: str) -> set[str]:
    """Whole names of the actions that the node with this name serves; none of one that is not found."""
    try:
        return {action for action, _types in get_action_server_names_and_types_by_node(node, name, namespace)}
    except rclpy_implementation.RCLError:  # it has ended since it was listed; rclpy 7.1.6 raises no narrower error
        return set()
