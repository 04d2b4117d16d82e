"""What `canbase print nav2` prints: a parameter file of Nav2, alone or laid into Nav2's own, and a launch file."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any, Final

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from canbase_config.nav2_chain import NODES, Chain
from canbase_config.nav2_params import CONTROLLER, MPPI, ROS, Bounded, BoundedList, Path, Speeds, Without
from canbase_config.yaml_file import read_yaml

_SERVER: Final = ("controller_server", ROS)
_HEADER: Final = """\
# Parameters of Nav2 for the robot {robot}, printed by canbase print nav2 from its robot.yaml.
# {how}
# Nodes with a remapping beyond those of Nav2's own launch file (canbase print nav2 --launch prints a launch file with
# them):
{remappings}
"""
_ALONE: Final = (
    "Only what follows from robot.yaml; canbase print nav2 --params FILE lays it into a parameter file of Nav2."
)
_LAID: Final = "Laid into {file}."
_LAUNCH: Final = '''\
"""Nav2 for the robot {robot}: its own launch file with the remappings that canbase needs, by canbase print nav2.

    ros2 launch ./nav2.launch.py params_file:=nav2.yaml map:=map.yaml
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import SetRemap
from launch_ros.substitutions import FindPackageShare

REMAPPINGS = (
{remappings}
)


def generate_launch_description():
    """Each remapping holds for one node, and before those of Nav2's launch file. Other arguments are passed on."""
    arguments = {{name: LaunchConfiguration(name) for name in ("params_file", "namespace", "use_namespace")}}
    path = PathJoinSubstitution([FindPackageShare("nav2_bringup"), "launch", "bringup_launch.py"])
    nav2 = IncludeLaunchDescription(PythonLaunchDescriptionSource(path), launch_arguments=arguments.items())
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", description="what canbase print nav2 --params has printed"),
            DeclareLaunchArgument("namespace", default_value="{namespace}"),
            DeclareLaunchArgument("use_namespace", default_value="{uses}"),
            GroupAction([*(SetRemap(src=src, dst=dst) for src, dst in REMAPPINGS), nav2]),
        ]
    )
'''


def parameter_file(robot: str, values: Mapping[Path, Any], wiring: Chain) -> str:
    """YAML with `values` alone."""
    return _printed(robot, _ALONE, _laid(CommentedMap(), values), wiring)


def merged_file(robot: str, values: Mapping[Path, Any], wiring: Chain, path: FilePath) -> tuple[str, tuple[str, ...]]:
    """The parameter file of Nav2 at `path` with `values` laid into it; what else is there stays, comments too.

    And the controllers whose limits are not known: they keep their own. Raises ConfigError for a file that is no YAML,
    ValueError for one without Nav2's nodes.
    """
    read_yaml(path)  # refuses what is too large or broken, with its line
    base = _yaml().load(path.read_text(encoding="utf-8"))
    if not any(node.name in base for node in NODES):
        names = ", ".join(node.name for node in NODES)
        raise ValueError(
            f"{path} has none of {names} as a key: expected a file like params/nav2_params.yaml of nav2_bringup"
        )
    known = {name: _is_mppi(base, name) for name in _controllers(base)}
    kept = {
        tuple(name if key == CONTROLLER else key for key in key_path): value
        for key_path, value in values.items()
        for name in ([name for name, is_known in known.items() if is_known] if CONTROLLER in key_path else [CONTROLLER])
    }
    others = tuple(name for name, is_known in known.items() if not is_known)
    return _printed(robot, _LAID.format(file=path.name), _laid(base, kept), wiring), others


def _controllers(base: Any) -> list[str]:
    """The names in controller_plugins of Nav2's file, or Nav2's own."""
    names = _get(base, (*_SERVER, "controller_plugins"))
    return [str(name) for name in names] if isinstance(names, list) else [CONTROLLER]


def _is_mppi(base: Any, name: str) -> bool:
    """A rotation shim has the parameters of its primary_controller beside its own."""
    inner, plugin = (_get(base, (*_SERVER, name, key)) for key in ("primary_controller", "plugin"))
    return (inner or plugin) in (None, MPPI)


def other_controllers(names: Sequence[str], most: Speeds) -> str:
    """The note of a file whose controllers `names` keep their own limits."""
    return (
        f"not {MPPI}: {', '.join(names)}. The speeds of these controllers are left as they are; set them to at most "
        f"{most.linear_mps:g} m/s and {most.angular_radps:g} rad/s. velocity_smoother limits them in any case"
    )


def launch_file(robot: str, wiring: Chain, namespace: str) -> str:
    """A Python launch file that includes Nav2's own."""
    lines = "\n".join(f'    ("{source}", "{target}"),' for source, target in wiring.remappings)
    uses = "true" if namespace else "false"
    return _LAUNCH.format(robot=robot, remappings=lines, namespace=namespace.strip("/"), uses=uses)


def _printed(robot: str, how: str, tree: Any, wiring: Chain) -> str:
    lines = "\n".join(f"#   -r {source}:={target}" for source, target in wiring.remappings)
    text = io.StringIO()
    _yaml().dump(tree, text)
    return _HEADER.format(robot=robot, how=how, remappings=lines) + text.getvalue()


def _laid(tree: Any, values: Mapping[Path, Any]) -> Any:
    for path, value in values.items():
        given = _get(tree, path)
        _set(tree, path, value.of(given) if isinstance(value, (Bounded, BoundedList, Without)) else value)
    return tree


def _get(tree: Any, path: Path) -> Any:
    """ROS joins levels by dots where it likes: `FollowPath: {vx_max: …}` and `FollowPath.vx_max: …` are the same."""
    for end in range(len(path), 0, -1):
        key = ".".join(path[:end])
        if isinstance(tree, Mapping) and key in tree:
            return tree[key] if end == len(path) else _get(tree[key], path[end:])
    return None


def _set(tree: Any, path: Path, value: Any) -> None:
    end = next((end for end in range(len(path), 0, -1) if ".".join(path[:end]) in tree), 1)
    key, rest = ".".join(path[:end]), path[end:]
    if not rest:
        tree[key] = _in_one_line(value) if isinstance(value, list) else value
        return
    if not isinstance(tree.get(key), Mapping):
        tree[key] = CommentedMap()
    _set(tree[key], rest, value)


def _in_one_line(values: list[Any]) -> CommentedSeq:
    sequence = CommentedSeq(values)
    sequence.fa.set_flow_style()
    return sequence


def _yaml() -> YAML:
    yaml = YAML()
    yaml.width = 4096
    yaml.indent(mapping=2, sequence=4, offset=2)
    yaml.preserve_quotes = True
    return yaml
