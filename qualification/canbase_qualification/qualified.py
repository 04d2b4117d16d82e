"""What a report is about: the robot, what was asked for, with which configuration and software."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from canbase_config.robot import Robot
from canbase_qualification.job import Load


@dataclass(frozen=True, slots=True)
class Setup:
    """What was asked for, with which configuration and software. `asked`: how many runs of each kind."""

    robot_file: str
    robot: Robot
    configuration_sha256: str
    configuration: str
    """The effective robot.yaml."""
    versions: Mapping[str, str]
    load: Load
    asked: Mapping[str, int]
    assumed: tuple[str, ...] = ()
    """What robot.yaml does not say, or virtual time has otherwise, in sentences."""
    not_judged: tuple[str, ...] = ()
    """What of this robot the campaign cannot represent, in sentences."""
    problems: tuple[str, ...] = ()
    """What is wrong with the results themselves."""
