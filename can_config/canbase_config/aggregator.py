"""The parameters of diagnostic_aggregator that follow from a robot.yaml: its groups, and the entries to expect. Pure.

Source: github.com/ros/diagnostics, March 2024: `generic_analyzer.cpp`, `analyzer_group.cpp` and `aggregator.cpp`.
An entry belongs to each analyzer that matches it; here that is one. `expected` makes an entry that never came stale,
and its group an error: no message is no good news.
"""

from __future__ import annotations

import io
from typing import Any, Final

from ruamel.yaml import YAML

from canbase_config.diagnostics import DRIVES, GROUPS, TIMEOUT_S, drive_name, drive_prefix, entry_name
from canbase_config.robot import Robot

NODE: Final = "analyzers"
"""The name of aggregator_node in the launch files of diagnostic_aggregator."""
ROOT: Final = "canbase"
"""First word of every path: /canbase/<robot>/<group>/<entry>."""
_GENERIC: Final = "diagnostic_aggregator/GenericAnalyzer"
_GROUP: Final = "diagnostic_aggregator/AnalyzerGroup"
_HEADER: Final = """\
# Parameters of diagnostic_aggregator for the robot {robot}, printed by canbase print aggregator from its robot.yaml.
#   ros2 run diagnostic_aggregator aggregator_node --ros-args --params-file THIS_FILE
# Several robots in one ROS graph: copy the block robot_{robot} of each file into one file.
"""


def parameters(robot: Robot) -> dict[str, Any]:
    """One analyzer for each group, below one for the robot, so that the files of several robots can be joined."""
    parts = {name.lower(): _parts(robot.name, name, group) for name, group in GROUPS.items()}
    groups = {DRIVES.lower(): _drives(robot), **parts}
    return {NODE: {"ros__parameters": {"path": ROOT, f"robot_{robot.name}": _group(robot.name, groups)}}}


def parameter_file(robot: Robot) -> str:
    """The same as YAML, with how to use it."""
    out = io.StringIO()
    yaml = YAML()
    yaml.width = 120
    yaml.dump(parameters(robot), out)
    return _HEADER.format(robot=robot.name) + out.getvalue()


def _group(path: str, analyzers: dict[str, Any]) -> dict[str, Any]:
    return {"type": _GROUP, "path": path, "analyzers": analyzers}


def _parts(robot: str, group: str, parts: tuple[str, ...]) -> dict[str, Any]:
    names = [entry_name(robot, part) for part in parts]
    return _generic(group, names, list(names), entry_name(robot, ""))  # two lists: ROS reads no YAML aliases


def _drives(robot: Robot) -> dict[str, Any]:
    prefix = drive_prefix(robot.name)
    return _generic(DRIVES, [prefix], [drive_name(robot.name, drive.joint) for drive in robot.drives], prefix)


def _generic(path: str, starts: list[str], expected: list[str], removed: str) -> dict[str, Any]:
    matching = {"startswith": starts, "remove_prefix": [removed], "expected": expected}
    return {"type": _GENERIC, "path": path, **matching, "timeout": TIMEOUT_S}
