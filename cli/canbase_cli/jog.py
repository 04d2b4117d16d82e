"""`canbase bus jog`: turns one wheel, slowly, while a key is held."""

from __future__ import annotations

from typing import Annotated, Final

import typer

from canbase_cli import completion
from canbase_cli.options import ConfigOption

EPILOG: Final = (
    "Examples:  \ncanbase bus jog left_wheel --config robot.yaml  \n"
    "canbase bus jog right_wheel --config robot.yaml --speed 0.02"
)


def jog(
    joint: Annotated[
        str,
        typer.Argument(metavar="JOINT", help="As in robot.yaml.", show_default=False, autocompletion=completion.joints),
    ],
    config: ConfigOption = None,
    speed_mps: Annotated[float, typer.Option("--speed", metavar="M/S", min=0.005, max=0.2, help="of the rim")] = 0.05,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Confirm that the wheels are up.")] = False,
) -> None:
    """Turn one wheel while a key is held: WHEELS UP. w or up arrow: forward, s or down arrow: backward, q: quit.

    The key is a dead-man switch: the wheel turns only while the key repeats, and stops 0.25 s after its release.
    Refused while canbase's driver, its watchdog or any other master is on this bus.

    Release, q, Ctrl-C, a signal, a closed terminal, an error: each stops the wheel and switches its power off. After
    SIGKILL the drive stops by itself, because jog has set its heartbeat consumer (1016h); jog warns if it has none.

    Exit codes: 0 ended by q, 1 refused or a fault, 2 wrong command line, robot.yaml, or no terminal; 128 + a signal.
    """
    from canbase_commissioning.onbus.jog_command import run

    run(config, joint, speed_mps, yes=yes)
