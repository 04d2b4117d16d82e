"""Reads parameter files of twist_mux (ros-teleop/twist_mux) as they are, and lays them into a robot.yaml's `mux`.

Such a file has, below NODE: ros__parameters:, `topics` and `locks`, each entry with topic, timeout and priority, nested
or in dotted keys (topics.joy.timeout: 0.5). A value outside of our ranges is reported with the file's line and key.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

from canbase_config.errors import ConfigError, Loc, Place, Problem, key_path
from canbase_config.yaml_file import YamlFile, read_yaml

PARAMETERS: Final = "ros__parameters"
USE_STAMPED: Final = "use_stamped"
STAMPED_BY_DEFAULT: Final = True
"""As twist_mux since 4.4; older ones know Twist alone."""
NODE: Final = "twist_mux"
ROS_1: Final = "a list, as in files of ROS 1: in ROS 2 each entry has its name as the key"
ENDLESS: Final = "twist_mux_timeout_s"
"""The key of `mux` with the timeout of topics that have none."""
RENAME: Final = "twist_mux_rename"
"""The key of `mux` with topics of these files, and what they are called here."""
FIELDS: Final = {"topic": "topic", "timeout": "timeout_s", "priority": "priority"}
"""Keys of an entry, theirs and ours."""
GROUPS: Final = {"topics": "sources", "locks": "locks"}
EXAMPLE: Final = "twist_mux: {ros__parameters: {topics: {joystick: {topic: joy_vel, timeout: 0.5, priority: 100}}}}"

_WILDCARD: Final = re.compile(r"/\\\*(\\\*)?")
"""Of one name, or of any number of names, in the name of a node; escaped."""

Entry = dict[str, "Parameter"]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One value of a parameter file and where it stands."""

    value: Any
    place: Place


def with_twist_mux(file: YamlFile) -> YamlFile:
    """`file` with the sources and locks of the files that its mux.twist_mux names, which are relative to its folder.

    Without `mux.sources` in `file` these are all the sources. Raises ConfigError for a file that is none of twist_mux,
    and for a name that `file` has too. Types and ranges are left to the model.
    """
    mux = file.values.get("mux")
    if not isinstance(mux, dict):
        return file
    names = mux.get("twist_mux")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) and name for name in names):
        return file
    parameters = _renamed(file, mux.get(RENAME), _parameters([read_yaml(file.path.parent / name) for name in names]))
    return replace(_merged(file, mux, parameters), notes=tuple(_unread(parameters)))


def _merged(file: YamlFile, mux: Mapping[str, Any], parameters: Mapping[str, Parameter]) -> YamlFile:
    merged = {**mux, "twist_mux": []}
    places: dict[Loc, Place] = {}
    stamped = parameters.get(USE_STAMPED)
    for group, ours in GROUPS.items():
        entries = _entries(parameters, group)
        given = merged.get(ours) or {}
        if not entries or not isinstance(given, dict):
            continue  # the model reports what is no section
        for name, entry in entries.items():
            _refuse_second(file, given, ("mux", ours, name), entry)
            places |= _places(("mux", ours, name), group, entry, stamped)
        make = _lock if ours == "locks" else partial(_source, stamped=stamped, endless_s=mux.get(ENDLESS))
        merged[ours] = {**given, **{name: make(entry) for name, entry in entries.items()}}
    lines = {**file.lines, **{loc: place.line for loc, place in places.items() if place.line is not None}}
    return replace(file, values={**file.values, "mux": merged}, lines=lines, places=places)


def _parameters(files: Sequence[YamlFile]) -> dict[str, Parameter]:
    """All parameters of the one node in the files that has topics or locks, by their dotted names.

    As in rclcpp (parameter_map.cpp) those of `/**` and the like belong to it as well, and of two values that one holds
    whose node is named later.
    """
    nodes: dict[str, dict[str, Parameter]] = {}
    for file in files:
        for node, section, loc in _nodes(file.values, ()):
            name = "/" + "/".join(str(part).strip("/") for part in node)
            nodes.setdefault(name, {}).update(_flat(section, loc, (), file))
    own = _own_node(nodes)
    parameters: dict[str, Parameter] = {}
    for name, given in nodes.items():
        if re.fullmatch(_WILDCARD.sub(_any_names, re.escape(name)), own):
            parameters |= given
        elif foreign := next((parameter for dotted, parameter in given.items() if _in_a_group(dotted)), None):
            what = f"topics or locks of {name}, which is not the node {own}: keep those of one node"
            raise ConfigError([Problem(foreign.place.file, foreign.place.line, foreign.place.key, what)])
    _refuse_useless(files, parameters)
    return parameters


def _own_node(nodes: Mapping[str, Mapping[str, Parameter]]) -> str:
    """The node that has topics or locks itself; where only `/**` has them, the one that is called twist_mux."""
    named = (name for name, given in nodes.items() if "*" not in name and any(map(_in_a_group, given)))
    return next(named, next((name for name in nodes if name.endswith(f"/{NODE}")), f"/{NODE}"))


def _any_names(wildcard: re.Match[str]) -> str:
    return rf"(/\w+){'*' if wildcard[1] else ''}"


def _in_a_group(dotted: str) -> bool:
    return dotted.partition(".")[0] in GROUPS


def _refuse_useless(files: Sequence[YamlFile], parameters: Mapping[str, Parameter]) -> None:
    """A file of another node, and all where no topics and locks are left."""
    useful = {parameter.place.file for parameter in parameters.values()} if any(map(_in_a_group, parameters)) else ()
    for file in files:
        if str(file.path) not in useful:
            old = next((group for group in GROUPS if isinstance(file.values.get(group), list)), None)
            what = "has no topics and no locks of twist_mux" if old is None else f"{old} is {ROS_1}"
            raise ConfigError([Problem(str(file.path), None, "", what, hint=f"it should look like {EXAMPLE}")])


def _renamed(file: YamlFile, rename: Any, parameters: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """With the topics as mux.twist_mux_rename has them; what is no section is reported by the model."""
    names = {str(topic).removeprefix("/"): name for topic, name in rename.items()} if isinstance(rename, dict) else {}
    topics = {
        dotted: str(parameter.value).removeprefix("/")
        for dotted, parameter in parameters.items()
        if _in_a_group(dotted) and dotted.endswith(".topic")
    }
    if unknown := sorted(set(names) - set(topics.values())):
        place = file.place(("mux", RENAME))
        raise ConfigError([Problem(place.file, place.line, place.key, f"no topic of these files is {unknown[0]}")])
    return {
        dotted: replace(parameter, value=names.get(topics.get(dotted, ""), parameter.value))
        for dotted, parameter in parameters.items()
    }


def _unread(parameters: Mapping[str, Parameter]) -> Iterator[Problem]:
    """Keys of topics and locks that neither twist_mux nor canbase reads."""
    for dotted, parameter in parameters.items():
        field = dotted.rpartition(".")[2]
        if _in_a_group(dotted) and field not in FIELDS:
            use = f"; {USE_STAMPED} beside topics holds for all of them" if field == "stamped" else ""
            place = parameter.place
            yield Problem(place.file, place.line, place.key, f"is not read, as in twist_mux{use}")


def _nodes(values: Any, loc: Loc) -> Iterator[tuple[Loc, Mapping[str, Any], Loc]]:
    """Name, parameters and place of each node: `twist_mux`, `/**`, or a node below its namespace."""
    if not isinstance(values, dict):
        return
    for key, inner in values.items():
        if key == PARAMETERS and isinstance(inner, dict):
            yield loc, inner, (*loc, key)
        elif key != PARAMETERS:
            yield from _nodes(inner, (*loc, key))


def _flat(values: Any, loc: Loc, name: tuple[str, ...], file: YamlFile) -> Iterator[tuple[str, Parameter]]:
    if isinstance(values, dict) and values:
        for key, inner in values.items():
            yield from _flat(inner, (*loc, key), (*name, str(key)), file)
    else:
        dotted = ".".join(name)
        yield dotted, Parameter(values, Place(str(file.path), file.line(loc), dotted))


def _entries(parameters: Mapping[str, Parameter], group: str) -> dict[str, Entry]:
    """`topics.joy.timeout` → entries["joy"]["timeout"]. Keys that twist_mux does not read are left out, as it does."""
    entries: dict[str, Entry] = {}
    for dotted, parameter in parameters.items():
        first, _, rest = dotted.partition(".")
        name, _, field = rest.rpartition(".")
        if first == group and not name:
            what = f"{first} must hold entries with {', '.join(FIELDS)}"
            what = f"{first} is {ROS_1}" if isinstance(parameter.value, list) else what
            raise ConfigError([Problem(parameter.place.file, parameter.place.line, dotted, what)])
        if first == group:
            entries.setdefault(name, {})[field] = parameter
    return entries


def _source(entry: Entry, stamped: Parameter | None, endless_s: Any) -> dict[str, Any]:
    """A timeout of 0 means in twist_mux that the topic never expires. Here it becomes `endless_s`, or is refused."""
    values = _known(entry)
    if _is_zero(values.get("timeout_s")):
        if endless_s is None:
            raise ConfigError([_endless(entry["timeout"].place)])
        values["timeout_s"] = endless_s
    return {**values, "stamped": STAMPED_BY_DEFAULT if stamped is None else stamped.value}


def _lock(entry: Entry) -> dict[str, Any]:
    """A timeout of 0 means in twist_mux that the lock needs no messages."""
    values = _known(entry)
    timeout = values.get("timeout_s")
    if _is_zero(timeout):
        del values["timeout_s"]
        return {**values, "required": False}
    return {**values, "required": True} if timeout is not None else {"timeout_s": None, **values}


def _endless(place: Place) -> Problem:
    what = "got 0: the last command of this topic would be valid for ever"
    hint = f"give it a timeout, or set mux.{ENDLESS}: 0.5 in robot.yaml for all topics with timeout 0"
    return Problem(place.file, place.line, place.key, what, hint=hint)


def _is_zero(timeout: Any) -> bool:
    """No boolean and no text."""
    return type(timeout) in (int, float) and timeout == 0


def _known(entry: Entry) -> dict[str, Any]:
    return {FIELDS[field]: parameter.value for field, parameter in entry.items() if field in FIELDS}


def _places(loc: Loc, group: str, entry: Entry, stamped: Parameter | None) -> dict[Loc, Place]:
    """Also of what is missing: there the line of the entry."""
    first = next(iter(entry.values())).place
    name = f"{group}.{loc[-1]}"
    places = {(*loc, ours): replace(first, key=f"{name}.{theirs}") for theirs, ours in FIELDS.items()}
    places[loc] = replace(first, key=name)
    if stamped is not None:
        places |= {(*loc, "stamped"): stamped.place}
    return places | {(*loc, FIELDS[field]): value.place for field, value in entry.items() if field in FIELDS}


def _refuse_second(file: YamlFile, given: Mapping[str, Any], loc: Loc, entry: Entry) -> None:
    if loc[-1] in given:
        place = next(iter(entry.values())).place
        what = f"{key_path(loc)} is given in {file.path.name} too"
        raise ConfigError([Problem(place.file, place.line, place.key, what, hint="keep one, or rename one")])
