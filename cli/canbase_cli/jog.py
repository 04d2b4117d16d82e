"""`canbase jog`: turns one wheel, slowly, while a key is held."""

from __future__ import annotations

from typing import Annotated, Final

import typer

from canbase_cli import completion
from canbase_cli.options import ConfigOption

EPILOG: Final = (
    "Examples:  \ncanbase jog left_wheel --config robot.yaml  \n"
    "canbase jog right_wheel --config robot.yaml --speed 0.02"
)


def jog(
    joint: Annotated[
        str,
        typer.Argument(metavar="JOINT", help="As in robot.yaml.", show_default=False, autocompletion=completion.joints),
    ],
    config: ConfigOption = None,
    speed_mps: Annotated[float, typer.Option("--speed", metavar="M/S", min=0.005, max=0.2, help="of the rim")] = 0.05,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="The wheels are up: do not ask.")] = False,
) -> None:
    """Turn one wheel while a key is held: WHEELS UP. w or arrow up forward, s or arrow down backward, q ends.

    The key is a dead-man key: the wheel turns only while it repeats, and stops a quarter of a second after it was
    released. Refused while canbase's driver, its watchdog or any other master speaks on this bus.

    The key released, q, Ctrl-C, a signal, a terminal that goes, an error: each stops the wheel and takes the power
    away. After SIGKILL the drive stops by itself, as its heartbeat consumer (1016h) was set before: jog says so where a
    drive cannot.

    Exit codes: 0 ended by q, 1 refused or a fault, 2 wrong command line, robot.yaml, or no terminal; 128 + a signal.
    """
    from canbase_commissioning.onbus.jog_command import run

    run(config, joint, speed_mps, yes=yes)
