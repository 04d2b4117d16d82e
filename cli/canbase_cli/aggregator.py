"""`canbase print aggregator`: the parameters of diagnostic_aggregator for a robot.yaml."""

from __future__ import annotations

import typer

from canbase_cli.options import ConfigOption, RobotFile, one_of
from canbase_runtime.terminal import load_config


def aggregator(
    file: RobotFile = None,
    config: ConfigOption = None,
) -> None:
    """Print parameters of diagnostic_aggregator: the groups of /diagnostics, and what must be there.

    For example: canbase print aggregator robot.yaml > aggregator.yaml

    An entry that does not come makes its group an error. deploy/diagnostics/aggregator.yaml is that of the bench.

    Exit codes: 0 printed, 2 the robot.yaml cannot be used.
    """
    from canbase_config.aggregator import parameter_file

    typer.echo(parameter_file(load_config(one_of(file, config), quiet=True).robot), nl=False)
