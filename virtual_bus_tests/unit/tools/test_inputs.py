"""inputs.yaml against the code: what a decision reads from outside has a row with age, sender and meaning."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from ruamel.yaml import YAML

import canbase_hazards
from canbase_campaign.received_faults import TOPICS
from canbase_campaign.world import World

ROOT = Path(__file__).parents[3]
PROCESSES = ("driver", "velocity_mux", "watchdog", "action_server", "runtime")
TOPIC_AT = {"create_subscription": 1, "_listen": 1, "listen_closely": 2}
"""Where a call has its topic."""
READS = {"recv", "recvfrom", "recvmsg", "recv_into", "read_text", "read_bytes", "take_message",
         "count_services", "count_publishers"}  # fmt: skip
TABLE = YAML(typ="safe").load(Path(canbase_hazards.__file__).parent / "inputs.yaml")


def calls(tree: ast.AST) -> Iterator[tuple[str, ast.Call]]:
    """Every call by its name. A function with a parameter `topic` subscribes for others: their calls count."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef) and "topic" in (argument.arg for argument in node.args.args):
            continue
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            yield name, node
        yield from calls(node)


def in_code(source: str, path: str) -> tuple[set[str], set[str], set[str]]:
    """The subscriptions, the services, and the file if it reads a socket, a file or the ROS graph."""
    topics, services, reads = set(), set(), set()
    for name, call in calls(ast.parse(source)):
        if name in TOPIC_AT and len(call.args) > TOPIC_AT[name]:
            topics.add(f"{path} {ast.unparse(call.args[TOPIC_AT[name]])}")
        elif name == "create_service":
            services.add(f"{path} {ast.unparse(call.args[1])}")
        elif name in READS and "message_reader" not in path:
            reads.add(path)
    return topics, services, reads


def everywhere() -> tuple[set[str], set[str], set[str]]:
    files = [file for folder in PROCESSES for file in sorted((ROOT / folder).rglob("*.py"))]
    assert len(files) > 150
    parts = [in_code(file.read_text("utf-8"), str(file.relative_to(ROOT))) for file in files]
    return tuple(set().union(*kind) for kind in zip(*parts, strict=True))  # type: ignore[return-value]


@pytest.mark.parametrize("place", range(3))
def test_the_code_reads_exactly_what_the_table_has(place: int) -> None:
    key = ("topics", "services", "sockets_and_files")[place]
    rows = [row["where"] for row in TABLE[key]]
    assert len(rows) == len(set(rows))
    assert set(rows) == everywhere()[place]


def test_a_new_subscription_without_a_row_is_found() -> None:
    source = "class A:\n    def __init__(self, node):\n        node.create_subscription(Bool, 'new', self.on_new, 1)\n"
    assert in_code(source, "driver/a.py")[0] == {"driver/a.py 'new'"}


@pytest.mark.parametrize("key", TABLE)
def test_each_row_has_an_age_and_a_meaning_when_it_is_missing(key: str) -> None:
    wanted = {"where", "age", "missing"} | {"topics": {"topic", "type", "sender"}, "services": set()}.get(
        key, {"what", "sender"}
    )
    for row in TABLE[key]:
        assert set(row) == wanted, row["where"]
        assert all(str(row[name]).strip() for name in wanted - {"topic"}), row["where"]


def test_the_campaign_has_every_topic_that_a_decision_reads() -> None:
    named = {topic for row in TABLE["topics"] for topic in row["topic"].split()}
    assert named == set(TOPICS) == World().topics.subscribed - {"publishers"}


def test_what_is_received_is_read_through_its_age_alone() -> None:
    """`Received._value` is private; ruff's SLF001 is on for all that runs on a robot, without exceptions for it."""
    pattern = re.compile(r"\._value\b")
    inside = {
        str(file.relative_to(ROOT))
        for folder in PROCESSES
        for file in (ROOT / folder).rglob("*.py")
        if "Received" in (text := file.read_text("utf-8")) and pattern.search(text)
    }
    assert inside == {"runtime/canbase_runtime/received.py"}


def test_what_has_an_age_limit_has_the_type_that_needs_one() -> None:
    """Without: what decides nothing, what stays until the next message, requests (receive_time.py)."""
    aged = [row for row in TABLE["topics"] if not row["age"].startswith(("none", "not while"))]
    assert {row["type"] for row in aged} == {"Received"}
    assert len(aged) >= 11
