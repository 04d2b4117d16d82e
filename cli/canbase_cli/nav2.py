"""`canbase print nav2`: the parameters and remappings that Nav2 needs on the base of a robot.yaml."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from canbase_cli.options import ConfigOption, NamespaceOption, RobotFile, one_of
from canbase_runtime.terminal import WRONG_INPUT, fail, load_config

ParamsOption = Annotated[
    Path | None,
    typer.Option(
        "--params", "-p", metavar="FILE", help="A parameter file of Nav2 to lay them into.", show_default=False
    ),
]
LaunchOption = Annotated[bool, typer.Option("--launch", help="Print a launch file with the remappings instead.")]


def nav2(
    file: RobotFile = None,
    config: ConfigOption = None,
    params: ParamsOption = None,
    launch: LaunchOption = False,
    namespace: NamespaceOption = "",
) -> None:
    """Print what Nav2 needs for this robot: parameters (limits, footprint, frames, topics), or a launch file.

    For example: canbase print nav2 robot.yaml --params nav2_params.yaml > nav2.yaml

    The launch file includes Nav2's own and adds remappings, so that Nav2's velocities reach the mux, and never the
    driver. What is missing in robot.yaml is reported on stderr. canbase doctor checks the running system.

    Exit codes: 0 printed, 2 the robot.yaml or FILE cannot be used.
    """
    from canbase_config.errors import ConfigError
    from canbase_config.nav2_chain import chain
    from canbase_config.nav2_params import parameters, speeds
    from canbase_config.nav2_text import launch_file, merged_file, other_controllers, parameter_file

    if launch and params is not None:
        raise typer.BadParameter(
            "--launch prints no parameters: call canbase print nav2 once with --params, once with --launch"
        )
    robot = load_config(one_of(file, config), quiet=True).robot
    try:
        wiring, values = chain(robot, namespace), parameters(robot, namespace)
        notes: list[str] = list(wiring.notes)
        others: tuple[str, ...] = ()
        if launch:
            text = launch_file(robot.name, wiring, namespace)
        elif params is None:
            text = parameter_file(robot.name, values, wiring)
        else:
            text, others = merged_file(robot.name, values, wiring, params)
    except (ValueError, ConfigError) as error:
        fail(str(error), WRONG_INPUT)
    notes += [other_controllers(others, speeds(robot))] if others else []
    for note in notes:
        typer.echo(f"note: {note}", err=True)
    typer.echo(text, nl=False)
