"""Reads a robot.yaml into a validated `Robot`, and finds the sample files. What is wrong in a file: `errors.py`."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from canbase_config import bus_load
from canbase_config.commissioned import kind_alone, uncommissioned, uncommissioned_mps, without_proof
from canbase_config.doubtful_values import doubtful_values
from canbase_config.errors import ConfigError, Loc, Problem
from canbase_config.robot import Robot
from canbase_config.ros_params import plain
from canbase_config.runtime_folder import with_runtime_folder
from canbase_config.schema import Schema
from canbase_config.stop_checks import uncertain_stops
from canbase_config.twist_mux_file import with_twist_mux
from canbase_config.validation_errors import explain
from canbase_config.yaml_file import YamlFile, read_yaml

ROBOT_SCHEMA = Schema(Robot)


@dataclass(frozen=True, slots=True)
class Loaded:
    """A robot and where it came from. `given` and `defaults` share out all leaf keys of the effective configuration.

    `warnings`: what can be used, and had better be changed. `files`: the user's own files that belong to it (drive
    profiles, parameters of twist_mux), by the paths that it names them with.
    """

    robot: Robot
    path: Path
    given: frozenset[Loc]
    defaults: frozenset[Loc]
    warnings: tuple[Problem, ...] = ()
    files: Mapping[str, Path] = field(default_factory=dict)


def load_robot(path: str | Path) -> Loaded:
    """The robot that `path` describes, a robot.yaml or a parameter file of ROS; files of `mux.twist_mux` are read in.

    Raises ConfigError, which carries all problems found.
    """
    alone = plain(read_yaml(path))
    file = with_twist_mux(alone)
    try:
        values = with_runtime_folder(file.values, os.environ, os.geteuid())
        robot = Robot.model_validate(values, context={"folder": file.path.parent})
    except ValidationError as error:
        raise ConfigError(explain(error, file, ROBOT_SCHEMA)) from error
    keys = frozenset(leaf_keys(robot.model_dump()))
    given = keys & file.lines.keys()
    return Loaded(robot, file.path, given, keys - given, tuple(_warnings(robot, file)), _named(alone))


def _named(file: YamlFile) -> dict[str, Path]:
    """Of a file that is known to be valid."""
    profiles = [str(drive.get("profile", "")) for drive in file.values["drives"]]
    own = [name for name in profiles if name.endswith((".yaml", ".yml"))]
    return {name: file.path.parent / name for name in [*own, *(file.values.get("mux") or {}).get("twist_mux", ())]}


def _warnings(robot: Robot, file: YamlFile) -> Iterator[Problem]:
    yield from file.notes
    busy = bus_load.busy(robot)
    if busy:
        at = next((loc for loc in (("bus", "bitrate"), ("rates", "control_hz")) if loc in file.lines), ("bus",))
        place = file.place(at)
        yield Problem(place.file, place.line, place.key, busy)
    if why := uncommissioned(robot):
        place = file.place(("commissioned",) if ("commissioned",) in file.lines else ("drives",))
        limit = f"{uncommissioned_mps(robot):g} m/s (safety.uncommissioned_mps{_tenth(robot)})"
        slow = f"until canbase setup commission it goes {limit}"
        yield Problem(place.file, place.line, place.key, f"{why}: {slow}")
    if robot.safety.require_self_stop and (why := without_proof(robot)):
        place = file.place(("safety", "require_self_stop"))
        yield Problem(place.file, place.line, place.key, f"no drive gets power: {why}")
    elif robot.safety.require_self_stop and (why := kind_alone(robot)):
        place = file.place(("safety", "require_self_stop"))
        yield Problem(place.file, place.line, place.key, why)
    for loc, sentence in (*uncertain_stops(robot), *doubtful_values(robot)):
        place = file.place(loc if loc in file.lines else loc[:-1])
        yield Problem(place.file, place.line, place.key, sentence)


def _tenth(robot: Robot) -> str:
    if uncommissioned_mps(robot) == robot.safety.uncommissioned_mps:
        return ""
    return "; a tenth of limits.linear_mps until `scale` has proven the units of the drives"


def samples() -> list[str]:
    """Names of the robot files that come with canbase."""
    return sorted(file.stem for file in _samples().glob("*.yaml"))


def sample(name: str) -> Path:
    """Path of a robot file that comes with canbase: `bench` or `example_can0`. Raises ValueError for another name."""
    if name not in samples():
        raise ValueError(f"there is no sample {name!r}, expected one of {', '.join(samples())}")
    return _samples() / f"{name}.yaml"


def _samples() -> Path:
    return Path(str(resources.files("canbase_config"))) / "robots"


def leaf_keys(value: Any, loc: Loc = ()) -> Iterator[Loc]:
    """Every place in nested mappings and lists that holds a plain value, a list of them, or something empty."""
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from leaf_keys(inner, (*loc, key))
    elif isinstance(value, (list, tuple)) and any(isinstance(inner, (dict, list, tuple)) for inner in value):
        for index, inner in enumerate(value):
            yield from leaf_keys(inner, (*loc, index))
    else:
        yield loc
