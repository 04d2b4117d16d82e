"""The URDF of a robot.yaml, read back by ROS's own parser."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner
from urdf_parser_py.urdf import URDF

from canbase_cli.main import app
from canbase_config.load import load_robot, sample, samples
from canbase_config.robot import Robot
from canbase_config.urdf import scanner_frame, urdf


def changed(name: str, **changes: Any) -> Robot:
    values = load_robot(sample(name)).robot.model_dump()
    for path, value in changes.items():
        *sections, key = path.split("__")
        section = values
        for part in sections:
            section = section[part]
        section[key] = value
    return Robot.model_validate(values)


@dataclass(frozen=True)
class Parsed:
    """What the parser has understood."""

    tree: Any

    def joint(self, name: str) -> Any:
        return self.tree.joint_map[name]


def parsed(robot: Robot) -> Parsed:
    return Parsed(URDF.from_xml_string(urdf(robot).encode()))


@pytest.mark.parametrize("name", samples())
def test_every_sample_is_one_tree_below_its_base_frame_with_the_joints_of_joint_states(name: str) -> None:
    robot = load_robot(sample(name)).robot
    found = parsed(robot)
    assert found.tree.get_root() == robot.base.base_frame
    turning = [joint.name for joint in found.tree.joints if joint.type == "continuous"]
    assert turning == [drive.joint for drive in robot.drives]


def test_wheels_touch_the_floor_at_the_track_and_turn_forward_about_y() -> None:
    robot = changed("bench", base__wheel_radius_m=0.08, base__track_m=0.4)
    for joint, y_m in (("left_wheel", 0.2), ("right_wheel", -0.2)):
        wheel = parsed(robot).joint(joint)
        assert wheel.origin.xyz == pytest.approx([0.0, y_m, 0.08])
        assert wheel.axis == [0.0, 1.0, 0.0]
        assert parsed(robot).tree.link_map[wheel.child].visual.geometry.radius == pytest.approx(0.08)


def test_several_wheels_of_a_side_stand_one_behind_the_other_inside_the_footprint() -> None:
    robot = load_robot(sample("bench")).robot
    left, right = robot.drives
    four = tuple(
        drive.model_copy(update={"joint": f"{drive.joint}_{place}", "node_id": node_id})
        for node_id, (drive, place) in enumerate([(left, "a"), (right, "a"), (left, "b"), (right, "b")], start=1)
    )
    found = parsed(robot.model_copy(update={"drives": four}))
    front, rear = (found.joint(f"left_wheel_{place}").origin.xyz[0] for place in "ab")
    assert 0.0 < front < robot.safety.footprint.front_m
    assert rear == pytest.approx(-front)
    assert found.joint("right_wheel_b").origin.xyz[0] == pytest.approx(rear)


def test_the_body_is_as_long_and_wide_as_the_footprint_and_lies_where_it_does() -> None:
    robot = changed("bench", safety__footprint={"front_m": 0.5, "rear_m": 0.1, "left_m": 0.35, "right_m": 0.25})
    body = parsed(robot).tree.link_map["base_link"].visual
    assert body.geometry.size[:2] == pytest.approx([0.6, 0.6])
    assert body.origin.xyz[:2] == pytest.approx([0.2, 0.05])
    assert body.origin.xyz[2] - body.geometry.size[2] / 2 > 0.0


def test_a_scanner_is_where_robot_yaml_has_it_and_one_that_tf_places_is_left_out() -> None:
    mounted = {"x_m": 0.2, "y_m": -0.1, "yaw_rad": 0.5, "upside_down": True, "topic": "front/scan"}
    bench = load_robot(sample("bench")).robot.safety.scan.model_dump()
    robot = changed("bench", safety__scan=bench | mounted)
    (joint,) = (joint for joint in parsed(robot).tree.joints if joint.type == "fixed")
    assert joint.child == scanner_frame(robot.safety.scan) == "front_scan"
    assert joint.origin.xyz[:2] == pytest.approx([0.2, -0.1])
    assert joint.origin.rpy == pytest.approx([math.pi, 0.0, 0.5], abs=1e-5)
    by_tf = changed("bench", safety__scan=bench | {"pose": "tf"})
    assert [joint for joint in parsed(by_tf).tree.joints if joint.type == "fixed"] == []


def test_two_links_of_one_name_are_refused_with_the_keys_that_cure_it() -> None:
    with pytest.raises(ValueError, match=r"would be called left_wheel_link: rename base\.base_frame"):
        urdf(changed("bench", base__base_frame="left_wheel_link"))


def test_names_that_xml_does_not_take_as_they_are_come_back_unchanged() -> None:
    assert parsed(changed("bench", base__base_frame='base <&"> ü')).tree.get_root() == 'base <&"> ü'


def test_the_command_prints_it_and_an_unusable_robot_yaml_ends_it_with_2(tmp_path: Path) -> None:
    good = CliRunner().invoke(app, ["print", "urdf", str(sample("bench"))])
    assert (good.exit_code, good.stdout) == (0, urdf(load_robot(sample("bench")).robot))
    twins = tmp_path / "robot.yaml"
    twins.write_text(sample("bench").read_text().replace("base:\n", "base:\n  base_frame: left_wheel_link\n", 1))
    refused = CliRunner().invoke(app, ["print", "urdf", "--config", str(twins)])
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert "left_wheel_link" in refused.stderr
    assert CliRunner().invoke(app, ["print", "urdf", str(tmp_path / "none.yaml")]).exit_code == 2
    assert CliRunner().invoke(app, ["print", "urdf", str(twins), "--config", str(twins)]).exit_code == 2
