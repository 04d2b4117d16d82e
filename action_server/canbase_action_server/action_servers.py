"""Which other nodes serve an action: from the ROS graph of this process."""

from __future__ import annotations

from rclpy.action.graph import get_action_server_names_and_types_by_node
from rclpy.node import Node, NodeNameNonExistentError


def other_servers(node: Node, action: str) -> list[str]:
    """Whole names of the nodes that serve `action` (a whole name) besides `node`; none of its own name, which may be
    what is left of its killed predecessor."""
    own = (node.get_name(), node.get_namespace())
    nodes = sorted(set(node.get_node_names_and_namespaces()) - {own})
    return [f"{namespace.rstrip('/')}/{name}" for name, namespace in nodes if action in _served(node, name, namespace)]


def _served(node: Node, name: str, namespace: str) -> set[str]:
    try:
        return {action for action, _types in get_action_server_names_and_types_by_node(node, name, namespace)}
    except NodeNameNonExistentError:  # it has ended since it was listed
        return set()
