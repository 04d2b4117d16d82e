"""`canbase serve vda5050`: the safety part of the VDA 5050 state of a running robot, as lines of JSON."""

from __future__ import annotations

from enum import Enum
from typing import Annotated

import typer

from canbase_cli.options import ConfigOption, NamespaceOption, ros_arguments, ros_needed
from canbase_runtime.terminal import load_config


class Protocol(str, Enum):
    """Version of VDA 5050."""

    V2 = "2.1.0"
    V3 = "3.0.0"


def vda5050(
    ctx: typer.Context,
    config: ConfigOption = None,
    once: Annotated[bool, typer.Option("--once", help="Print one line, and end.")] = False,
    protocol: Annotated[Protocol, typer.Option("--protocol", help="Version of VDA 5050.")] = Protocol.V2,
    namespace: NamespaceOption = "",
) -> None:
    """Print safetyState and errors of the VDA 5050 state message: a line of JSON on change, and each second.

    A fleet client takes these keys into its state message. What is not known is never reported as safe: a topic
    without messages for 1.5 s is an error, the emergency stop is MANUAL and fieldViolation true. It only reads topics.

    Exit codes: 0 ended by Ctrl-C or SIGTERM, or --once has printed; 2 wrong command line or robot.yaml.
    """
    robot = load_config(config, quiet=True).robot
    with ros_needed():
        from canbase_fleet.state_lines import run
    run(robot, ros_arguments(ctx, namespace), once, typer.echo, protocol.value)
