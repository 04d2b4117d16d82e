"""What `canbase print urdf` prints for ros2_control: the tag of its topic hardware, parameters of
diff_drive_controller."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner
from urdf_parser_py.urdf import URDF

from canbase_cli.main import app
from canbase_config.load import load_robot, sample
from canbase_config.mux import MuxSource
from canbase_config.robot import Robot
from canbase_config.ros2_control import controllers, joint_source
from canbase_config.urdf import urdf

BENCH = load_robot(sample("bench")).robot
CONTROL = MuxSource(topic="wheels/command", type="joint_command", priority=60, timeout_s=0.3)
SITE = Path(__file__).parents[3] / "docs"


def with_sources(robot: Robot = BENCH, **sources: MuxSource) -> Robot:
    mux = robot.mux.model_copy(update={"sources": {**robot.mux.sources, **sources}})
    return robot.model_copy(update={"mux": mux})


def tag_of(robot: Robot) -> ElementTree.Element:
    (tag,) = ElementTree.fromstring(urdf(robot).encode()).iter("ros2_control")
    return tag


def test_a_robot_without_wheel_speeds_as_a_source_has_no_tag() -> None:
    assert joint_source(BENCH) is None
    assert "ros2_control" not in urdf(BENCH)


def test_the_tag_has_the_topics_of_robot_yaml_and_publishes_every_command() -> None:
    robot = with_sources(control=CONTROL)
    tag = tag_of(robot)
    assert (tag.get("name"), tag.get("type")) == ("canbase_wheels", "system")
    assert tag.findtext("hardware/plugin") == "joint_state_topic_hardware_interface/JointStateTopicSystem"
    assert {param.get("name"): param.text for param in tag.findall("hardware/param")} == {
        "joint_commands_topic": "wheels/command",
        "joint_states_topic": "joint_states",
        "trigger_joint_command_threshold": "-1",
    }
    assert URDF.from_xml_string(urdf(robot).encode()).get_root() == "base_link"


def test_each_drive_is_a_joint_with_a_velocity_command_that_begins_with_zero() -> None:
    robot = with_sources(control=CONTROL)
    torque = robot.drives[1].model_copy(update={"rated_torque_nm": 0.5})
    joints = tag_of(robot.model_copy(update={"drives": (robot.drives[0], torque)})).findall("joint")
    assert [joint.get("name") for joint in joints] == ["left_wheel", "right_wheel"]
    for joint in joints:
        (command,) = joint.findall("command_interface")
        assert (command.get("name"), command.findtext("param[@name='initial_value']")) == ("velocity", "0.0")
        assert joint.findtext("state_interface[@name='velocity']/param[@name='initial_value']") == "0.0"
    states = [[state.get("name") for state in joint.findall("state_interface")] for joint in joints]
    assert states == [["position", "velocity"], ["position", "velocity", "effort"]]  # what joint_states has of it


def test_several_sources_of_wheel_speeds_have_no_tag_to_share() -> None:
    other = CONTROL.model_copy(update={"topic": "other", "priority": 61})
    with pytest.raises(ValueError, match=r"several of type joint_command \(control, other\)"):
        urdf(with_sources(control=CONTROL, other=other))


def parameters(robot: Robot) -> Any:
    return YAML(typ="safe").load(controllers(robot))


def test_wheels_of_unequal_radius_are_multipliers_of_the_controller() -> None:
    base = BENCH.base.model_copy(update={"wheel_ratio": 1.02})
    drive = parameters(with_sources(BENCH.model_copy(update={"base": base}), control=CONTROL))
    values = drive["diff_drive_controller"]["ros__parameters"]
    left, right = values["left_wheel_radius_multiplier"], values["right_wheel_radius_multiplier"]
    assert (right / left, (left + right) / 2.0) == pytest.approx((1.02, 1.0), rel=1e-5)


def test_the_controller_has_wheels_and_limits_of_robot_yaml() -> None:
    found = parameters(with_sources(control=CONTROL))
    plugin = {"type": "diff_drive_controller/DiffDriveController"}
    assert found["controller_manager"]["ros__parameters"] == {"update_rate": 50, "diff_drive_controller": plugin}
    drive = found["diff_drive_controller"]["ros__parameters"]
    assert (drive["left_wheel_names"], drive["right_wheel_names"]) == (["left_wheel"], ["right_wheel"])
    assert (drive["wheel_separation"], drive["wheel_radius"]) == (BENCH.base.track_m, BENCH.base.wheel_radius_m)
    assert (drive["left_wheel_radius_multiplier"], drive["right_wheel_radius_multiplier"]) == (1.0, 1.0)
    limits = BENCH.limits
    assert drive["linear"]["x"] == {
        "max_velocity": limits.linear_mps, "min_velocity": -limits.linear_mps,
        "max_acceleration": limits.acceleration_mps2, "max_deceleration": -limits.deceleration_mps2,
        "max_acceleration_reverse": -limits.acceleration_mps2, "max_deceleration_reverse": limits.deceleration_mps2,
    }  # fmt: skip
    assert drive["angular"]["z"]["max_velocity"] == limits.angular_radps
    assert drive["angular"]["z"]["max_deceleration"] == -limits.angular_deceleration_radps2
    assert drive["cmd_vel_timeout"] > 0.0
    assert (drive["enable_odom_tf"], drive["open_loop"]) == (False, False)


def test_every_number_is_a_double_for_ros_and_every_name_a_string() -> None:
    """ROS parameters have one type: 1 is no double, and `on` is no string."""
    drives = (BENCH.drives[0].model_copy(update={"joint": "on"}), BENCH.drives[1])
    base = BENCH.base.model_copy(update={"track_m": 1, "base_frame": "base: #1"})
    robot = with_sources(BENCH.model_copy(update={"drives": drives, "base": base}), control=CONTROL)
    drive = parameters(robot)["diff_drive_controller"]["ros__parameters"]
    assert drive["left_wheel_names"] == ["on"]
    assert drive["base_frame_id"] == "base: #1"
    assert isinstance(drive["wheel_separation"], float)


def test_unequal_sides_and_a_missing_source_are_refused_with_the_cure() -> None:
    third = BENCH.drives[0].model_copy(update={"joint": "third", "node_id": 3})
    robot = with_sources(BENCH.model_copy(update={"drives": (*BENCH.drives, third)}), control=CONTROL)
    with pytest.raises(ValueError, match="as many wheels on each side; drives has 2 on the left, 1 on the right"):
        controllers(robot)
    refused = CliRunner().invoke(app, ["print", "urdf", "--controllers", str(sample("bench"))])
    assert (refused.exit_code, refused.stdout) == (2, "")
    assert "add below mux.sources, for example, control: {topic: joint_command, type: joint_command" in refused.stderr


def test_the_page_shows_what_the_command_prints_for_the_bench(tmp_path: Path) -> None:
    page = (SITE / "ros2_control.md").read_text(encoding="utf-8")
    shown = [block.removeprefix("yaml\n") for block in page.split("```") if block.startswith("yaml\n")]
    own = next(block for block in shown if block.startswith("mux:\n"))
    file = tmp_path / "robot.yaml"
    others = re.sub(r"\nmux:\n(  .*\n)+", "\n", sample("bench").read_text(encoding="utf-8"))
    file.write_text(f"{others}\n{own}", encoding="utf-8")
    printed = CliRunner().invoke(app, ["print", "urdf", "--controllers", str(file)])
    assert (printed.exit_code, printed.stderr) == (0, "")
    assert printed.stdout in shown
