"""What canbase knows of Nav2, held against Nav2's own text: `NAVIGATION2=/path/to/navigation2 pytest -k nav2_source`.

The path leads to a checkout of github.com/ros-navigation/navigation2, or to a part of it. None of it is in this
repository: without the variable these tests are skipped. docs/decisions/0078-*.md has the branches that were held.
"""

from __future__ import annotations

import ast
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.load import load_robot, sample
from canbase_config.nav2_chain import NODES, SMOOTHED, TELEOP, VELOCITY
from canbase_config.nav2_params import MPPI, ROS, parameters

ROOT = Path(os.environ.get("NAVIGATION2", "/nonexistent"))
pytestmark = pytest.mark.skipif(not ROOT.is_dir(), reason="NAVIGATION2 is not set to a checkout of Nav2")
LAUNCH, PARAMS = ROOT / "nav2_bringup/launch/navigation_launch.py", ROOT / "nav2_bringup/params/nav2_params.yaml"
EXECUTABLES = {"opennav_docking": "docking_server", "opennav_following": "following_server"}
PACKAGES = {
    "nav2_controller": "controller_server",
    "nav2_behaviors": "behavior_server",
    "nav2_velocity_smoother": "velocity_smoother",
    "nav2_collision_monitor": "collision_monitor",
    "opennav_docking": "docking_server",
    "opennav_following": "following_server",
}
PUBLISHER = re.compile(r'TwistPublisher>\(\s*\w+,\s*"?(\w+)"?')
SUBSCRIBER = re.compile(r'TwistSubscriber>\(\s*\w+,\s*"?(\w+)"?')
ELSEWHERE = {"footprint", "base_frame", "fixed_frame"}
"""Parameters of costmaps and of following_server that are declared in files that a part of a checkout may not have."""


def started() -> Iterator[tuple[str, dict[str, str]]]:
    """(node, its remappings beyond tf) of each Node and each ComposableNode of the launch file, as literals."""
    for call in ast.walk(ast.parse(LAUNCH.read_text(encoding="utf-8"))):
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") in ("Node", "ComposableNode"):
            given = {keyword.arg: keyword.value for keyword in call.keywords}
            name = _literal(given.get("name")) or _literal(given.get("executable"))
            pairs = (
                [pair for pair in ast.walk(given["remappings"]) if isinstance(pair, ast.Tuple)]
                if "remappings" in given
                else []
            )
            yield EXECUTABLES.get(name, name), dict(ast.literal_eval(pair) for pair in pairs)


def _literal(node: Any) -> str:
    return str(node.value) if isinstance(node, ast.Constant) else ""


def sources() -> Iterator[tuple[str, str]]:
    """(node, text) of each C++ file of a package that has one of the nodes, tests apart."""
    for path in sorted((*ROOT.rglob("*.cpp"), *ROOT.rglob("*.hpp"))):
        if "test" not in path.relative_to(ROOT).parts:
            package = next((part for part in reversed(path.parts) if part in PACKAGES), "")
            yield PACKAGES.get(package, package or path.name), path.read_text(encoding="utf-8")


def test_the_launch_file_remaps_cmd_vel_as_we_have_it() -> None:
    seen: dict[str, list[dict[str, str]]] = {}
    for name, remaps in started():
        seen.setdefault(name, []).append(remaps)
    for node in NODES:
        wanted = {VELOCITY: node.launch_remap} if node.launch_remap else {}
        if node.name == "following_server" and node.name not in seen:
            continue  # Jazzy has none
        assert seen[node.name] == [wanted, wanted], "as a process, and in a container"
    others = {name for name, all_remaps in seen.items() if any(VELOCITY in remaps for remaps in all_remaps)}
    assert others <= {node.name for node in NODES}


def test_velocities_are_published_and_read_where_we_have_it() -> None:
    published = {(node, topic) for node, text in sources() for topic in PUBLISHER.findall(text)}
    read = {(node, topic) for node, text in sources() for topic in SUBSCRIBER.findall(text)}
    topics = {"cmd_vel_out_topic": VELOCITY, "cmd_vel_in_topic": SMOOTHED, "cmd_vel_teleop": TELEOP}
    assert {(node, topics.get(topic, topic)) for node, topic in published} <= {(n.name, n.publishes) for n in NODES}
    assert {(node, topics.get(topic, topic)) for node, topic in read} <= {(n.name, n.receives) for n in NODES}
    assert len(published) >= 3, "an expression that finds nothing holds nothing"
    text = "\n".join(text for _, text in sources())
    assert f'"cmd_vel_teleop", rclcpp::ParameterValue(std::string("{TELEOP}"))' in text or (
        f'"cmd_vel_teleop", std::string("{TELEOP}")' in text
    )


def test_every_parameter_that_we_print_is_one_of_nav2() -> None:
    known = yaml.safe_load(PARAMS.read_text(encoding="utf-8"))
    texts = "\n".join(text for _, text in sources())
    for path in parameters(load_robot(sample("bench")).robot):
        value = known
        for key in path:
            value = value.get(key) if isinstance(value, dict) else None
        assert value is not None or f'"{path[-1]}"' in texts or path[-1] in ELSEWHERE, path
    assert known["controller_server"][ROS]["FollowPath"]["plugin"] == MPPI


def test_laid_into_nav2s_own_file_it_is_that_file_with_our_values() -> None:
    result = CliRunner().invoke(app, ["print", "nav2", "--params", str(PARAMS)])
    before, after = yaml.safe_load(PARAMS.read_text(encoding="utf-8")), yaml.safe_load(result.stdout)
    ours = set(parameters(load_robot(sample("bench")).robot))
    assert set(_paths(before)) <= set(_paths(after))
    changed = {path for path, value in _paths(after).items() if _paths(before).get(path) != value}
    assert changed <= ours
    assert {path[-1] for path in changed} >= {
        "cmd_vel_out_topic",
        "enable_stamped_cmd_vel",
        "velocity_timeout",
        "footprint",
    }


def _paths(tree: Any, path: tuple[str, ...] = ()) -> dict[tuple[str, ...], Any]:
    if not isinstance(tree, dict):
        return {path: tree}
    return {inner: value for key, each in tree.items() for inner, value in _paths(each, (*path, key)).items()}
