"""`canbase print urdf`: the robot of a robot.yaml for robot_state_publisher, RViz and Foxglove."""

from __future__ import annotations

from typing import Annotated

import typer

from canbase_cli.options import ConfigOption, RobotFile, one_of
from canbase_runtime.terminal import WRONG_INPUT, fail, load_config


def urdf(
    file: RobotFile = None,
    config: ConfigOption = None,
    controllers: Annotated[
        bool,
        typer.Option("--controllers", help="Print controllers.yaml for diff_drive_controller of ros2_control instead."),
    ] = False,
) -> None:
    """Print the URDF of a robot.yaml: base, wheels, scanners. For example: canbase print urdf robot.yaml > robot.urdf

    The joints have the names of joint_states, and the base is base.base_frame. A scanner with pose: config is a link
    called like its topic. Heights are not in robot.yaml: they are chosen. With a source of type joint_command in
    mux.sources the URDF has a ros2_control tag for it: docs/ros2_control.md.

    Exit codes: 0 printed, 2 the robot.yaml cannot be used.
    """
    from canbase_config import ros2_control
    from canbase_config.urdf import urdf as of_robot

    robot = load_config(one_of(file, config), quiet=True).robot
    try:
        text = ros2_control.controllers(robot) if controllers else of_robot(robot)
    except ValueError as error:
        fail(str(error), WRONG_INPUT)
    typer.echo(text, nl=False)
