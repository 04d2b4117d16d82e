"""`canbase bus emcy`: the present and the stored errors of a drive, decoded; `--clear` empties the history."""

from __future__ import annotations

from typing import Annotated, Final

import typer

from canbase_cli.bus_options import BitrateOption, ChannelOption, InterfaceOption, SdoTimeoutOption
from canbase_cli.options import ConfigOption
from canbase_cli.sdo import NodeArgument

EPILOG: Final = "Examples:  \ncanbase bus emcy 1 --config robot.yaml  \ncanbase bus emcy 1 --clear --channel can0"


def emcy(
    node: NodeArgument,
    config: ConfigOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    timeout_s: SdoTimeoutOption = 0.5,
    clear: Annotated[bool, typer.Option("--clear", help="Empty the history (1003h) instead.")] = False,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask before it is emptied.")] = False,
) -> None:
    """Show the errors of a drive: the error register, the present code (603Fh), the history (1003h), in words.

    It may read beside the driver. The manufacturer's codes are those of the drive's profile. --clear asks first, and
    is refused while a driver or another master is on the bus. It clears no fault: that is canbase reset.

    Exit codes: 0 read or emptied, 1 no answer, refused, or the drive keeps no history, 2 wrong command line.
    """
    from canbase_commissioning.onbus.bus_session import choose_bus
    from canbase_commissioning.onbus.emcy_command import run_clear, run_emcy

    bus, robot = choose_bus(config, interface, channel, bitrate)
    if clear:
        run_clear(bus, node, timeout_s, yes=yes)
    else:
        run_emcy(bus, robot, node, timeout_s)
