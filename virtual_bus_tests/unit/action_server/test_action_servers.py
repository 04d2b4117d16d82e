"""Who serves an action besides canbase: a server that no known node explains is a second one."""

from __future__ import annotations

from typing import Any, cast

import pytest
from rclpy.node import Node

from canbase_action_server import action_servers
from canbase_action_server.action_servers import NOT_NAMED, second_server

OURS, NAV2, OTHER = ("drive_distance_server", "/"), ("behavior_server", "/nav"), ("amcl", "/")


class Graph:
    """What this node has discovered: `servers` endpoints that serve /spin, and the names of `nodes`."""

    def __init__(self, servers: int, *nodes: tuple[str, str]) -> None:
        self.servers, self.nodes = servers, list(nodes)

    def get_name(self) -> str:
        return OURS[0]

    def get_namespace(self) -> str:
        return OURS[1]

    def count_services(self, name: str) -> int:
        return self.servers if name == "/spin/_action/send_goal" else 0

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        return self.nodes


@pytest.mark.parametrize(
    ("graph", "serves", "said"),
    [
        pytest.param(Graph(1, OURS, OTHER), (OURS,), "", id="alone"),
        pytest.param(Graph(2, OURS, OTHER, NAV2), (OURS, NAV2), "/nav/behavior_server", id="another node"),
        pytest.param(Graph(2, OURS, OTHER), (OURS,), NOT_NAMED, id="its endpoint was discovered, its node not yet"),
        pytest.param(Graph(2, OURS, OTHER, NAV2), (OURS,), NOT_NAMED, id="its node, but not yet what it serves"),
        pytest.param(Graph(2, OURS, OURS, OTHER), (OURS,), "", id="its killed predecessor"),
        pytest.param(Graph(3, OURS, OURS, OTHER), (OURS,), NOT_NAMED, id="its predecessor and a stranger"),
        pytest.param(
            Graph(3, OURS, OURS, NAV2), (OURS, NAV2), "/nav/behavior_server", id="its predecessor and another"
        ),
    ],
)
def test_every_server_of_the_name_has_to_be_this_node(
    graph: Graph, serves: tuple[tuple[str, str], ...], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def actions_of(_: Any, name: str, namespace: str) -> set[str]:
        return {"/spin"} if (name, namespace) in serves else set()

    monkeypatch.setattr(action_servers, "actions_of", actions_of)
    assert second_server(cast(Node, graph), "/spin") == said
