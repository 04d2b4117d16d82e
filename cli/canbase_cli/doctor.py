"""`canbase doctor`: looks at a running robot and says what is wrong with it. Orders nothing, changes nothing."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.console import Console

from canbase_cli.options import ConfigOption, NamespaceOption, load_config, ros_arguments, ros_needed

SecondsOption = Annotated[float, typer.Option("--seconds", metavar="SECONDS", min=0.5, max=60.0, help="to listen for")]


def doctor(
    ctx: typer.Context, config: ConfigOption = None, seconds: SecondsOption = 3.0, namespace: NamespaceOption = ""
) -> None:
    """Look at a running robot: what is there, what is wrong, what to do next.

    It only listens: nothing moves by it, at any time.

    Exit codes: 0 nothing failed, 1 something did, 2 wrong command line or robot.yaml.
    """
    loaded = load_config(config)
    with ros_needed():
        from canbase_cli.checks import exit_code, table
        from canbase_cli.observe import observe
        from canbase_cli.robot_checks import robot_checks
    checks = robot_checks(observe(loaded, ros_arguments(ctx, namespace), seconds))
    Console().print(table(f"{loaded.robot.name} at {namespace or '/'}", checks))
    raise typer.Exit(exit_code(checks))
