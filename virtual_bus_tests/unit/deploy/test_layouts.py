"""The layouts for Foxglove and RViz show what a robot publishes: each topic and each field in them exists."""

from __future__ import annotations

import importlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from support.api_page import documented

LAYOUTS = Path(__file__).parents[3] / "deploy" / "layouts"
NODES = ("velocity_mux", "safety_filter", "motor_driver")
OF_OTHERS = {"/scan": "sensor_msgs/msg/LaserScan", "/robot_description": "std_msgs/msg/String"}
"""Of the scanner's driver and of robot_state_publisher."""


def published() -> dict[str, str]:
    """By topic, its type."""
    rows = {row.name: row.type for node in NODES for row in documented(node) if row.way == "out"}
    return rows | OF_OTHERS


def values_of(tree: Any, keys: tuple[str, ...]) -> Iterator[Any]:
    if isinstance(tree, dict):
        for key, value in tree.items():
            if key in keys:
                yield value
            yield from values_of(value, keys)
    elif isinstance(tree, list):
        for value in tree:
            yield from values_of(value, keys)


def foxglove() -> Any:
    return json.loads((LAYOUTS / "robot_foxglove.json").read_text(encoding="utf-8"))


def message_paths() -> list[str]:
    """What plots and state transitions show: /topic.field.field[0]."""
    return [value for value in values_of(foxglove()["configById"], ("value",)) if isinstance(value, str)]


def fields(kind: str) -> dict[str, str]:
    """The fields of a message and their types; KeyError for what is no message."""
    package, _, name = kind.partition("/msg/")
    if not name:
        raise KeyError(f"{kind} has no fields")
    found: dict[str, str] = getattr(importlib.import_module(f"{package}.msg"), name).get_fields_and_field_types()
    return found


def type_at(path: str) -> str:
    """The ROS type of a message path. Raises KeyError for a topic or field that does not exist."""
    topic, _, rest = path.partition(".")
    kind = published()[topic]
    for part in rest.split("."):
        name, index = re.fullmatch(r"(\w+)(\[\d+\])?", part).groups()  # type: ignore[union-attr]
        kind = fields(kind)[name]
        if index:
            kind = re.fullmatch(r"sequence<(.+)>", kind)[1]  # type: ignore[index]
        if "/" in kind and "/msg/" not in kind:
            kind = kind.replace("/", "/msg/")
    return kind


def test_the_layout_for_foxglove_has_plots() -> None:
    assert len(message_paths()) > 10


@pytest.mark.parametrize("path", message_paths())
def test_each_path_in_the_layout_for_foxglove_is_a_number_or_text_of_a_topic(path: str) -> None:
    assert type_at(path) in ("double", "float", "uint8", "string", "boolean", "uint32")


def test_a_path_that_does_not_exist_is_found() -> None:
    for path in ("/odom.twist.linear.x", "/cmd_vel_out.twist.linear.x", "/motor_driver/status.drives[0].amps"):
        with pytest.raises(KeyError):
            type_at(path)


def test_each_panel_of_foxglove_is_in_the_layout_once() -> None:
    placed = [value for value in values_of(foxglove()["layout"], ("first", "second")) if isinstance(value, str)]
    assert sorted(placed) == sorted(foxglove()["configById"])


def test_the_topics_of_other_panels_exist() -> None:
    tree = foxglove()["configById"]
    shown = {*next(values_of(tree, ("topics",))), *values_of(tree, ("topicPath", "topicToRender"))}
    assert shown <= published().keys()


def test_rviz_shows_topics_and_frames_of_the_robot() -> None:
    tree = YAML(typ="safe").load(LAYOUTS / "robot.rviz")
    topics = [topic["Value"] for topic in values_of(tree, ("Topic", "Description Topic")) if isinstance(topic, dict)]
    assert sorted(topics) == ["/odom", "/robot_description", "/scan"]
    assert set(topics) <= published().keys()
    frames = {*values_of(tree, ("Fixed Frame", "Target Frame"))}
    assert frames == {"odom", "base_link"}, "the defaults of base.odom_frame and base.base_frame"
