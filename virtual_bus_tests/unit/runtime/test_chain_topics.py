"""chain_topics.py against the code: who publishes these topics, and that nothing else in the product does."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from canbase_config.mux import OUTPUTS
from canbase_runtime.chain_topics import CHAIN, Use

ROOT = Path(__file__).parents[3]
NODES = {
    "motor_driver": "driver/canbase_driver/ros/node.py",
    "safety_filter": "velocity_mux/canbase_velocity/filter_node.py",
    "velocity_mux": "velocity_mux/canbase_velocity/mux_node.py",
}


def published() -> Iterator[tuple[str, str, str]]:
    """Topic, name of the type, and file of each publisher with a literal topic."""
    for file in sorted(ROOT.glob("*/**/*.py")):
        folder = file.relative_to(ROOT).parts[0]
        if folder in ("virtual_bus_tests", "benchmarks", "build") or folder.startswith("."):
            continue
        text = file.read_text("utf-8")
        for call in ast.walk(ast.parse(text)) if "create_publisher" in text else ():
            if isinstance(call, ast.Call) and ast.unparse(call.func).endswith("create_publisher"):
                kind, topic = call.args[:2]
                if isinstance(topic, ast.Constant) and isinstance(topic.value, str):
                    yield topic.value, ast.unparse(kind), str(file.relative_to(ROOT))


def test_each_topic_is_published_once_by_its_owner_with_its_type() -> None:
    topics = {row.topic for row in CHAIN}
    found = sorted(row for row in published() if row[0] in topics)
    assert found == sorted((row.topic, row.type.rsplit("/", 1)[-1], NODES[row.node]) for row in CHAIN)


def test_the_velocities_of_the_chain_are_those_that_no_source_may_have() -> None:
    assert {row.topic for row in CHAIN if row.use is not Use.STATE} == set(OUTPUTS)
