"""`canbase print nav2`: what follows from a robot.yaml for Nav2, as parameters and as a launch file."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

import pytest
import yaml
from typer.testing import CliRunner, Result

from canbase_cli.main import app
from canbase_config.commissioned import uncommissioned_mps
from canbase_config.load import load_robot, sample
from canbase_config.nav2_chain import chain
from canbase_config.nav2_params import ROS, Bounded, parameters, speeds
from canbase_config.nav2_text import merged_file
from canbase_config.robot import Robot

NAVIGATION = {"topic": "cmd_vel_nav", "priority": 50, "timeout_s": 0.5}
DOCKING = {"topic": "cmd_vel_docking", "priority": 55, "timeout_s": 0.5, "neutral_after_s": 2.0, "stamped": False}
NAV2 = """\
# by hand
velocity_smoother:
  ros__parameters:
    smoothing_frequency: 20.0  # kept
    max_velocity: [0.5, 0.0, 2.5]
    velocity_timeout: 0.3
controller_server:
  ros__parameters:
    FollowPath: {plugin: PLUGIN, vx_max: 3.0, ax_max: 0.4, model_dt: 0.05}
    FollowPath.wz_max: 9.0
    FollowPath.vx_min: -0.1
behavior_server:
  ros__parameters: {max_rotational_vel: 5.0, min_rotational_vel: 0.2, tolerance: 1.0e-10}
local_costmap:
  local_costmap:
    ros__parameters:
      inflation_layer: {inflation_radius: 1.5}
"""
MPPI, RPP = (
    "nav2_mppi_controller::MPPIController",
    "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController",
)


def robot(name: str = "bench", **changes: Any) -> Robot:
    values = load_robot(sample(name)).robot.model_dump()
    for path, value in changes.items():
        section, _, key = path.rpartition("__")
        (values[section] if section else values)[key] = value
    return Robot.model_validate(values)


def canbase(*words: str) -> Result:
    return CliRunner().invoke(app, ["print", "nav2", *words])


def laid(tmp_path: Path, text: str, *words: str) -> Any:
    path = tmp_path / "nav2_params.yaml"
    path.write_text(text, encoding="utf-8")
    result = canbase("--params", str(path), *words)
    assert result.exit_code == 0, result.stderr
    return yaml.safe_load(result.stdout)  # PyYAML, as Nav2's launch file reads it


def test_the_name_of_the_lecture_reaches_the_mux_and_nav2s_own_topic_gets_another_one() -> None:
    wiring = chain(robot())
    assert (wiring.out, wiring.controllers, wiring.stamped) == ("cmd_vel_nav", "cmd_vel_controller", True)
    assert wiring.remappings == (
        ("controller_server:cmd_vel", "cmd_vel_controller"),
        ("behavior_server:cmd_vel", "cmd_vel_controller"),
        ("velocity_smoother:cmd_vel", "cmd_vel_controller"),
        ("docking_server:cmd_vel", "cmd_vel_docking"),
        ("following_server:cmd_vel", "cmd_vel_following"),
    )


@pytest.mark.parametrize(
    ("topic", "namespace", "renamed"),
    [
        ("cmd_vel_monitored", "", False),
        ("/cmd_vel_nav", "", True),
        ("/cmd_vel_nav", "/robot1", False),
        ("/robot1/cmd_vel_nav", "/robot1", True),
    ],
)
def test_nav2_keeps_its_own_name_where_no_source_has_it(topic: str, namespace: str, renamed: bool) -> None:
    wiring = chain(robot(mux__sources={"navigation": NAVIGATION | {"topic": topic}}), namespace)
    assert (wiring.controllers == "cmd_vel_controller") is renamed
    assert len(wiring.remappings) == (5 if renamed else 2)
    assert (
        parameters(robot(mux__sources={"navigation": NAVIGATION | {"topic": topic}}), namespace)[
            "collision_monitor", ROS, "cmd_vel_out_topic"
        ]
        == topic
    )


def test_docking_has_the_topic_and_type_of_its_source_and_a_note_without_one() -> None:
    sources = {"navigation": NAVIGATION, "docking": DOCKING | {"topic": "dock/cmd_vel"}}
    wiring, values = chain(robot(mux__sources=sources)), parameters(robot(mux__sources=sources))
    assert ("docking_server:cmd_vel", "dock/cmd_vel") in wiring.remappings
    assert values["docking_server", ROS, "enable_stamped_cmd_vel"] is False
    assert values["collision_monitor", ROS, "enable_stamped_cmd_vel"] is True
    assert [note.split()[0] for note in wiring.notes] == ["following_server"]
    assert [note.split()[0] for note in chain(robot()).notes] == ["docking_server", "following_server"]


@pytest.mark.parametrize(
    ("sources", "told"),
    [
        ({"planner": NAVIGATION}, "no source called navigation, only planner"),
        (
            {"navigation": NAVIGATION | {"type": "joint_command"}},
            "has the type joint_command, wheel speeds, which Nav2",
        ),
        ({"navigation": NAVIGATION | {"topic": "cmd_vel_smoothed"}}, "drive past collision_monitor"),
    ],
)
def test_a_robot_without_a_way_for_nav2_is_refused(sources: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        chain(robot(mux__sources=sources))


def test_a_joystick_on_the_topic_of_assisted_teleop_is_noted() -> None:
    joystick = {"topic": "cmd_vel_teleop", "priority": 100, "timeout_s": 0.3}
    notes = chain(robot(mux__sources={"navigation": NAVIGATION, "joystick": joystick})).notes
    assert "mux.sources.joystick.topic is cmd_vel_teleop" in notes[-1]


def test_speeds_are_those_that_the_filter_lets_through() -> None:
    ceiling = {"linear_mps": 0.6, "angular_radps": 3.0, "acceleration_mps2": 1.0, "angular_acceleration_radps2": 1.0}
    slow = speeds(robot(safety__ceiling=ceiling))
    assert (slow.linear_mps, slow.angular_radps) == (0.6, 2.0)
    fresh = robot("example_can0")
    assert speeds(fresh).linear_mps == uncommissioned_mps(fresh) < fresh.limits.linear_mps


def test_a_number_of_nav2_stays_within_what_robot_yaml_permits() -> None:
    assert Bounded(1.0, high=0.5).of(None) == 0.5
    assert Bounded(1.0, high=2.0).of(1.5) == 1.5
    assert Bounded(1.0, high=2.0).of(2.5) == 2.0
    assert Bounded(-0.35, low=-0.2).of(None) == -0.2
    assert Bounded(1.0, high=2.0).of("fast") == 1.0
    assert Bounded(1.0, high=2.0).of(True) == 1.0


def test_behaviours_that_canbase_serves_are_taken_out_of_behavior_server_and_no_others() -> None:
    place = ("behavior_server", ROS, "behavior_plugins")
    assert place not in parameters(robot())
    plugins = parameters(robot(action__nav2_behaviors=True))[place]
    assert plugins.of(["backup", "my_dance", "spin", "wait"]) == ["my_dance", "wait"]
    assert plugins.of(None) == ["assisted_teleop", "wait"]


def test_a_file_of_nav2_keeps_its_other_behaviours(tmp_path: Path) -> None:
    given = tmp_path / "given.yaml"
    given.write_text('behavior_server: {ros__parameters: {behavior_plugins: ["spin", "my_dance"]}}\n', encoding="utf-8")
    serving = robot(action__nav2_behaviors=True)
    text, _ = merged_file(serving.name, parameters(serving), chain(serving), given)
    assert yaml.safe_load(text)["behavior_server"][ROS]["behavior_plugins"] == ["my_dance"]


def test_parameters_alone_are_those_of_the_bench() -> None:
    result = canbase("-n", "robot1")
    assert result.exit_code == 0
    values = yaml.safe_load(result.stdout)
    smoother = values["velocity_smoother"][ROS]
    assert smoother["max_velocity"] == [0.8, 0.0, 2.0]
    assert smoother["min_velocity"] == [-0.8, 0.0, -2.0]
    assert "-0.0," not in result.stdout
    assert smoother["max_decel"] == [-1.0, 0.0, -5.0]
    assert smoother["velocity_timeout"] == 0.5
    local = values["local_costmap"]["local_costmap"][ROS]
    assert yaml.safe_load(local["footprint"]) == [[0.3, 0.3], [0.3, -0.3], [-0.3, -0.3], [-0.3, 0.3]]
    assert local["voxel_layer"]["scan"]["topic"] == "/robot1/scan"
    assert values["amcl"][ROS]["base_frame_id"] == values["route_server"][ROS]["base_frame"] == "base_link"
    assert values["smoother_server"][ROS]["robot_base_frame"] == "base_link"
    assert all(type(number) is float for number in smoother["max_velocity"] + smoother["max_accel"])
    assert "docking: {topic: cmd_vel_docking" in result.stderr


def test_the_inflation_reaches_as_far_as_the_filter_stops() -> None:
    footprint = {"front_m": 0.6, "rear_m": 0.3, "left_m": 0.45, "right_m": 0.3}
    layer = parameters(robot(safety__footprint=footprint))["local_costmap", "local_costmap", ROS, "inflation_layer",
                                                           "inflation_radius"]  # fmt: skip
    assert layer.of(0.7) == pytest.approx(0.9), "0.75 m to the corner, 0.15 m of stop_distance_m"
    assert layer.of(1.2) == 1.2


def test_every_scanner_is_a_source_of_both_costmaps_and_of_the_monitor() -> None:
    more = ({"topic": "rear/scan", "required": True},)
    values = parameters(robot(safety__more_scans=more))
    assert values["collision_monitor", ROS, "observation_sources"] == ["scan", "rear_scan"]
    assert values["collision_monitor", ROS, "rear_scan", "topic"] == "rear/scan"
    for costmap, layer in (("local_costmap", "voxel_layer"), ("global_costmap", "obstacle_layer")):
        assert values[costmap, costmap, ROS, layer, "observation_sources"] == "scan rear_scan"
        assert values[costmap, costmap, ROS, layer, "rear_scan", "data_type"] == "LaserScan"


def test_laid_into_a_file_of_nav2_what_else_is_there_stays(tmp_path: Path) -> None:
    values = laid(tmp_path, NAV2.replace("PLUGIN", MPPI))
    assert values["velocity_smoother"][ROS]["smoothing_frequency"] == 20.0
    assert values["velocity_smoother"][ROS]["max_velocity"] == [0.5, 0.0, 2.0], "lowered, never raised"
    assert values["velocity_smoother"][ROS]["velocity_timeout"] == 0.3, "shorter than the source's timeout"
    follow = values["controller_server"][ROS]
    assert follow["FollowPath"] | {"vx_max": 0.8, "ax_max": 0.4, "model_dt": 0.05} == follow["FollowPath"]
    assert follow["FollowPath.wz_max"] == 2.0, "with dots or nested, ROS takes both"
    assert follow["FollowPath.vx_min"] == -0.1
    assert {"wz_max", "vx_min"}.isdisjoint(follow["FollowPath"])
    behaviors = values["behavior_server"][ROS]
    assert (behaviors["max_rotational_vel"], behaviors["min_rotational_vel"]) == (2.0, 0.2)
    assert behaviors["tolerance"] == 1e-10
    assert values["local_costmap"]["local_costmap"][ROS]["inflation_layer"]["inflation_radius"] == 1.5
    assert "# by hand" in (printed := canbase("--params", str(tmp_path / "nav2_params.yaml")).stdout)
    assert "# kept" in printed


def test_another_controller_keeps_its_own_speeds_and_is_noted(tmp_path: Path) -> None:
    values = laid(tmp_path, NAV2.replace("PLUGIN", RPP))
    assert values["controller_server"][ROS]["FollowPath"] == {
        "plugin": RPP, "vx_max": 3.0, "ax_max": 0.4, "model_dt": 0.05
    }  # fmt: skip
    assert values["controller_server"][ROS]["enable_stamped_cmd_vel"] is True
    result = canbase("--params", str(tmp_path / "nav2_params.yaml"))
    assert "set them to at most 0.8 m/s and 2 rad/s" in result.stderr


def test_controllers_have_the_names_of_controller_plugins(tmp_path: Path) -> None:
    plugins = {"Fast": {"plugin": MPPI, "vx_max": 0.26}, "Dock": {"plugin": RPP},
               "Shim": {"plugin": "nav2_rotation_shim_controller::RotationShimController", "primary_controller": MPPI,
                        "vx_max": 2.0}}  # fmt: skip
    text = yaml.safe_dump({"controller_server": {ROS: {"controller_plugins": list(plugins), **plugins}}})
    server = laid(tmp_path, text)["controller_server"][ROS]
    assert (server["Fast"]["vx_max"], server["Shim"]["vx_max"]) == (0.26, 0.8)
    assert server["Dock"] == {"plugin": RPP}
    assert "FollowPath" not in server
    assert f"not {MPPI}: Dock. " in canbase("--params", str(tmp_path / "nav2_params.yaml")).stderr


def test_odometry_is_that_of_the_filter_that_publishes_the_transform() -> None:
    nodes = ("bt_navigator", "controller_server", "velocity_smoother")
    filtered = parameters(robot(odometry__publish_tf=False))
    assert {filtered[node, ROS, "odom_topic"] for node in nodes} == {"odometry/filtered"}
    assert {parameters(robot())[node, ROS, "odom_topic"] for node in nodes} == {"odom"}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("canbase: {ros__parameters: {}}\n", "has none of controller_server"),
        ("controller_server: [\n", "nav2_params.yaml:2: not YAML"),
        ("", "nav2_params.yaml"),
        (None, "nav2_params.yaml"),
    ],
)
def test_a_file_that_is_none_of_nav2_is_refused(tmp_path: Path, text: str | None, told: str) -> None:
    path = tmp_path / "nav2_params.yaml"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    result = canbase("--params", str(path))
    assert (result.exit_code, result.stdout) == (2, "")
    assert told in result.stderr


def test_a_section_that_is_no_mapping_is_replaced(tmp_path: Path) -> None:
    values = laid(tmp_path, "velocity_smoother: {ros__parameters: 3}\ncontroller_server:\n")
    assert values["velocity_smoother"][ROS]["velocity_timeout"] == 0.5
    assert values["controller_server"][ROS]["odom_topic"] == "odom"


def test_launch_and_params_are_two_calls() -> None:
    assert canbase("--launch", "--params", "x.yaml").exit_code == 2
    assert canbase("one.yaml", "--config", "two.yaml").exit_code == 2


def test_the_launch_file_puts_its_remappings_around_nav2s_own() -> None:
    """Run with stand-ins of launch, which is not on PyPI: they keep what they are given."""
    made: list[tuple[str, tuple[Any, ...], dict[str, Any]]] = []

    class Anything(ModuleType):
        def __getattr__(self, name: str) -> Any:
            def call(*args: Any, **options: Any) -> str:
                made.append((name, args, options))
                return name

            return call

    names = ("launch", "launch.actions", "launch.launch_description_sources", "launch.substitutions",
             "launch_ros", "launch_ros.actions", "launch_ros.substitutions")  # fmt: skip
    space: dict[str, Any] = {}
    with patch.dict(sys.modules, {name: Anything(name) for name in names}):
        exec(canbase("--launch", "-n", "robot1").stdout, space)
        space["generate_launch_description"]()
    remaps = [options for name, _, options in made if name == "SetRemap"]
    assert remaps == [{"src": source, "dst": target} for source, target in chain(robot()).remappings]
    declared = {
        args[0]: options.get("default_value") for name, args, options in made if name == "DeclareLaunchArgument"
    }
    assert declared == {
        "params_file": None, "namespace": "robot1", "use_namespace": "true"
    }  # fmt: skip
    group = next(args[0] for name, args, _ in made if name == "GroupAction")
    assert group == ["SetRemap"] * 5 + ["IncludeLaunchDescription"], "a remapping holds for what comes after it"
