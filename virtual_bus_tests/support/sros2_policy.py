"""What the shipped SROS2 policy allows a node, and what a running node has: names from the ROS graph."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from rclpy.node import Node

FOLDER = Path(__file__).parents[2] / "deploy" / "sros2"
Endpoints = dict[str, set[str]]
"""By "publish", "subscribe" and "reply": absolute names."""
KINDS = {"topic": ("publish", "subscribe"), "service": ("reply",)}


def allowed(node: str) -> Endpoints:
    """Of all profiles of that node, with what every node is allowed."""
    policy, common = (ElementTree.parse(FOLDER / name).getroot() for name in ("policy.xml", "common/node.xml"))
    profiles = [profile for profile in policy.iter("profile") if profile.get("node") == node]
    found: Endpoints = {"publish": set(), "subscribe": set(), "reply": set()}
    for profile in [*profiles, common]:
        for tag, ways in KINDS.items():
            for way in ways:
                found[way] |= {_absolute(name, node) for name in _names(profile, tag, way)}
        for action in _names(profile, "action", "execute"):
            found["publish"] |= {f"/{action}/_action/{name}" for name in ("feedback", "status")}
            found["reply"] |= {f"/{action}/_action/{name}" for name in ("send_goal", "cancel_goal", "get_result")}
    return found


def present(observer: Node, node: str) -> Endpoints:
    """What that node has, as `observer` sees it."""
    return {
        "publish": {name for name, _ in observer.get_publisher_names_and_types_by_node(node, "/")},
        "subscribe": {name for name, _ in observer.get_subscriber_names_and_types_by_node(node, "/")},
        "reply": {name for name, _ in observer.get_service_names_and_types_by_node(node, "/")},
    }


def _names(profile: ElementTree.Element, tag: str, way: str) -> list[str]:
    groups = [group for group in profile if group.tag == f"{tag}s" and group.get(way) == "ALLOW"]
    return [str(each.text) for group in groups for each in group.iter(tag)]


def _absolute(name: str, node: str) -> str:
    if name.startswith("~/"):
        return f"/{node}/{name[2:]}"
    return name if name.startswith("/") else f"/{name}"
