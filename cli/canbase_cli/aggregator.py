"""`canbase print aggregator`: the parameters of diagnostic_aggregator for a robot.yaml."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from canbase_cli.options import ConfigOption
from canbase_runtime.terminal import load_config


def aggregator(
    file: Annotated[
        Path | None, typer.Argument(metavar="[FILE]", help="The same as --config FILE.", show_default=False)
    ] = None,
    config: ConfigOption = None,
) -> None:
    """Print parameters of diagnostic_aggregator: the groups of /diagnostics, and what must be there.

    For example: canbase print aggregator robot.yaml > aggregator.yaml

    An entry that does not come makes its group an error. deploy/diagnostics/aggregator.yaml is that of the bench.

    Exit codes: 0 printed, 2 the robot.yaml cannot be used.
    """
    from canbase_config.aggregator import parameter_file

    if file is not None and config is not None:
        raise typer.BadParameter("give the robot.yaml once: --config FILE, or FILE alone")
    typer.echo(parameter_file(load_config(config or file, quiet=True).robot), nl=False)
