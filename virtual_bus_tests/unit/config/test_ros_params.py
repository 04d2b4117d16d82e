"""A robot in a parameter file of ROS 2 is the same robot, and what is wrong in it is told with its own lines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from canbase_config.errors import ConfigError
from canbase_config.load import load_robot, sample


def bench() -> dict[str, Any]:
    """The sample robot of the bench, as plain values with all its keys."""
    return load_robot(sample("bench")).robot.model_dump(mode="json", exclude_none=True)


def in_ros_form(values: dict[str, Any], dots: bool) -> dict[str, Any]:
    """The same with named drives; nested, or all keys with dots."""
    drives = {drive.pop("joint"): drive for drive in values["drives"]}
    nested = {**values, "drives": drives, "use_sim_time": False}
    return dict(dotted(nested, "")) if dots else nested


def dotted(values: dict[str, Any], before: str) -> list[tuple[str, Any]]:
    pairs = []
    for key, value in values.items():
        inner = isinstance(value, dict) and bool(value)
        pairs += dotted(value, f"{before}{key}.") if inner else [(f"{before}{key}", value)]
    return pairs


def written(folder: Path, values: dict[str, Any]) -> Path:
    path = folder / "params.yaml"
    YAML(typ="safe").dump(values, path)
    return path


@pytest.mark.parametrize("dots", [False, True], ids=["nested", "dots"])
@pytest.mark.parametrize("node", ["/**", "canbase", "/canbase"])
def test_the_same_robot_comes_out_of_it(tmp_path: Path, node: str, dots: bool) -> None:
    parameters = in_ros_form(bench(), dots)
    others = {"controller_server": {"ros__parameters": {"limits.linear_mps": 9.0}}}
    path = written(tmp_path, {**others, node: {"ros__parameters": parameters}})
    assert load_robot(path).robot == load_robot(sample("bench")).robot


def test_the_own_section_has_the_last_word_over_the_one_for_all_nodes(tmp_path: Path) -> None:
    everywhere = in_ros_form(bench(), dots=False)
    own = {"limits.linear_mps": 0.5, "drives.left_wheel.gear_ratio": 7.0}
    path = written(tmp_path, {"canbase": {"ros__parameters": own}, "/**": {"ros__parameters": everywhere}})
    robot = load_robot(path).robot
    assert robot.limits.linear_mps == 0.5
    assert [drive.gear_ratio for drive in robot.drives] == [7.0, 20.0]


def test_zones_have_names_there(tmp_path: Path) -> None:
    zone = {"front_m": 1.0, "rear_m": 1.0, "left_m": 1.0, "right_m": 1.0, "linear_mps": 0.1, "angular_radps": 0.2}
    parameters = in_ros_form(bench(), dots=False)
    parameters["safety"]["limit_zones"] = {"near": zone, "nearer": {**zone, "linear_mps": 0.05}}
    zones = load_robot(written(tmp_path, {"canbase": {"ros__parameters": parameters}})).robot.safety.limit_zones
    assert [zone.linear_mps for zone in zones] == [0.1, 0.05]


def test_what_is_wrong_is_told_with_the_line_and_the_key_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "params.yaml"
    path.write_text(
        "canbase:\n  ros__parameters:\n    limits.linear_mps: 0.8\n    limits.angular_radps: -1.0\n"
        "    drives.left_wheel.node_id: 200\n    drives:\n      right_wheel:\n        node_idd: 2\n"
    )
    with pytest.raises(ConfigError) as told:
        load_robot(path)
    shown = str(told.value)
    assert f"{path}:4: limits.angular_radps" in shown
    assert f"{path}:5: drives.left_wheel.node_id" in shown
    assert f"{path}:8: drives.right_wheel.node_idd" in shown


def test_a_file_for_other_nodes_alone_is_told_so(tmp_path: Path) -> None:
    path = written(tmp_path, {"amcl": {"ros__parameters": {"x": 1}}})
    with pytest.raises(ConfigError, match="it has parameters of amcl only, expected canbase: ros__parameters:"):
        load_robot(path)


def test_the_defaults_are_told_apart_from_what_is_given(tmp_path: Path) -> None:
    parameters = in_ros_form(bench(), dots=True)
    del parameters["limits.jerk_mps3"]
    loaded = load_robot(written(tmp_path, {"canbase": {"ros__parameters": parameters}}))
    assert ("limits", "jerk_mps3") in loaded.defaults
    assert ("limits", "linear_mps") in loaded.given
    assert ("drives", 1, "gear_ratio") in loaded.given
