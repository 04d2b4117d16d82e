"""Reads a robot from a parameter file of ROS 2: the keys of robot.yaml below `canbase: ros__parameters:` (or `/**:`).

Nested or with dots (limits.linear_mps: 0.8), as ROS has it. ROS knows no list of sections, so these have names there:
`drives.left_wheel.node_id: 1` is a drive with the joint left_wheel. Other nodes' sections are theirs and left alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, Final

from canbase_config.errors import ConfigError, Loc, Place, Problem
from canbase_config.twist_mux_file import PARAMETERS
from canbase_config.yaml_file import YamlFile
from canbase_config.yaml_limits import MAX_DEPTH

NODES: Final = ("/**", "canbase", "/canbase")
"""Whose parameters count; a later one has the last word."""
NAMED: Final[Mapping[Loc, str]] = {("drives",): "joint", ("safety", "limit_zones"): "", ("safety", "more_scans"): ""}
"""Lists of sections, and the key that the name of an entry is."""
OF_EVERY_NODE: Final = "use_sim_time"
"""Launch files set it for all nodes; canbase measures ages by the monotonic clock alone."""

Leaf = tuple[Loc, Any, int | None]


def plain(file: YamlFile) -> YamlFile:
    """`file` as a robot.yaml has it; itself when it is none of ROS. ConfigError: it has nothing for canbase."""
    ros = {str(node): part for node, part in file.values.items() if isinstance(part, dict) and PARAMETERS in part}
    if not ros:
        return file
    mine = [node for node in NODES if isinstance(ros.get(node, {}).get(PARAMETERS), dict)]
    if not mine:
        what = f"it has parameters of {', '.join(ros)} only"
        raise ConfigError([Problem(str(file.path), 1, "", what, "canbase: ros__parameters: or /**: ros__parameters:")])
    values: dict[str, Any] = {}
    lines: dict[Loc, int] = {}
    places: dict[Loc, Place] = {}
    for node in mine:
        for theirs, value, line in _leaves(file, (node, PARAMETERS), ros[node][PARAMETERS]):
            keys = tuple(part for key in theirs for part in str(key).split("."))
            if len(keys) > MAX_DEPTH:
                what = f"nested too deeply: more than {MAX_DEPTH} levels"
                raise ConfigError([Problem(str(file.path), line, ".".join(keys), what)])
            if keys[0] != OF_EVERY_NODE:
                loc = _put(values, keys, value)
                places[loc] = Place(str(file.path), line, ".".join(keys))
                lines |= {loc[: i + 1]: line for i in range(len(loc)) if line is not None and loc[: i + 1] not in lines}
    return replace(file, values=_listed(values), lines=lines, places=places)


def _leaves(file: YamlFile, at: Loc, values: Mapping[str, Any], keys: Loc = ()) -> Iterator[Leaf]:
    for key, value in values.items():
        if isinstance(value, dict) and value:
            yield from _leaves(file, (*at, key), value, (*keys, key))
        else:
            yield (*keys, key), value, file.line((*at, key))


def _put(values: dict[str, Any], keys: tuple[str, ...], value: Any) -> Loc:
    """Lays a value into the nested mappings; where it will stand once named sections are lists."""
    section, loc = values, []
    for i, key in enumerate(keys):
        named = keys[:i] in NAMED
        if i == len(keys) - 1:
            section[key] = value
        else:
            inner = section.get(key)
            section[key] = inner if isinstance(inner, dict) else {}
        loc.append(list(section).index(key) if named else key)
        section = section[key] if isinstance(section[key], dict) else {}
    return tuple(loc)


def _listed(values: dict[str, Any]) -> dict[str, Any]:
    """Named sections as lists, in the order of the file."""
    for path, name_key in NAMED.items():
        section: Any = values
        for key in path[:-1]:
            section = section.get(key) if isinstance(section, dict) else None
        if isinstance(section, dict) and isinstance(section.get(path[-1]), dict):
            section[path[-1]] = [_entry(name, entry, name_key) for name, entry in section[path[-1]].items()]
    return values


def _entry(name: str, entry: Any, name_key: str) -> Any:
    return {name_key: name, **entry} if name_key and isinstance(entry, dict) else entry
