"""`canbase urdf`: the robot of a robot.yaml for robot_state_publisher, RViz and Foxglove."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from canbase_cli.options import ConfigOption
from canbase_runtime.terminal import WRONG_INPUT, fail, load_config


def urdf(
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="The same as --config FILE.", show_default=False)
    ] = None,
    config: ConfigOption = None,
) -> None:
    """Print the URDF of a robot.yaml: base, wheels, scanners. For example: canbase urdf robot.yaml > robot.urdf

    The joints have the names of joint_states, and the base is base.base_frame. A scanner with pose: config is a link
    called like its topic. Heights are not in robot.yaml: they are chosen.

    Exit codes: 0 printed, 2 the robot.yaml cannot be used.
    """
    from canbase_config.urdf import urdf as of_robot

    if file is not None and config is not None:
        raise typer.BadParameter("give the robot.yaml once: --config FILE, or FILE alone")
    robot = load_config(config or file, quiet=True).robot
    try:
        text = of_robot(robot)
    except ValueError as error:
        fail(str(error), WRONG_INPUT)
    typer.echo(text, nl=False)
