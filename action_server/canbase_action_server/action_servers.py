"""Which other nodes serve an action: from the ROS graph of this process."""

from __future__ import annotations

from rclpy.action.graph import get_action_server_names_and_types_by_node
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

NOT_NAMED = "a node that is not known by name yet"


def second_server(node: Node, action: str) -> str:
    """Who serves `action` (a whole name) besides `node`; empty: nobody does.

    Endpoints and names of nodes are discovered one after the other: a server that is counted and belongs to no known
    node is a second one. Only nodes of this one's name are none: they may be what is left of its killed predecessor.
    """
    servers = node.count_services(f"{action}/_action/send_goal")
    if servers <= 1:
        return ""
    own, nodes = (node.get_name(), node.get_namespace()), node.get_node_names_and_namespaces()
    others = [
        f"{namespace.rstrip('/')}/{name}"
        for name, namespace in sorted(set(nodes) - {own})
        if action in actions_of(node, name, namespace)
    ]
    return ", ".join(others) or (NOT_NAMED if servers > nodes.count(own) else "")


def actions_of(node: Node, name: str, namespace: str) -> set[str]:
    """Whole names of the actions that the node with this name serves; none of one that is not found."""
    try:
        return {action for action, _types in get_action_server_names_and_types_by_node(node, name, namespace)}
    except rclpy_implementation.RCLError:  # it has ended since it was listed; rclpy 7.1.6 raises no narrower error
        return set()
