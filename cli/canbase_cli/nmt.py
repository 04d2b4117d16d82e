"""`canbase bus nmt`: sends one NMT command to a node or to all, and shows what it does to the motors."""

from __future__ import annotations

from enum import Enum
from typing import Annotated, Final

import typer

from canbase_cli import completion
from canbase_cli.bus_options import BitrateOption, ChannelOption, InterfaceOption, SdoTimeoutOption
from canbase_cli.options import ConfigOption

EPILOG: Final = (
    "Examples:  \ncanbase bus nmt 1 reset --config robot.yaml  \ncanbase bus nmt all preop --channel can0  \n"
    "canbase bus nmt 2 start --channel can0"
)
ALL: Final = "all"


class Command(str, Enum):
    """NMT commands, as canbase_commissioning.nmt_command has them."""

    START = "start"
    STOP = "stop"
    PREOP = "preop"
    RESET = "reset"
    RESET_COMM = "reset-comm"


def nmt(
    node: Annotated[
        str,
        typer.Argument(
            metavar="NODE|all", help="Node id, or all.", show_default=False, autocompletion=completion.node_ids_or_all
        ),
    ],
    order: Annotated[Command, typer.Argument(help="The command.", show_default=False)],
    config: ConfigOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    timeout_s: SdoTimeoutOption = 0.5,
    force: Annotated[
        bool, typer.Option("--force", help="Even beside a driver, a watchdog or another master: the robot may stop.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask, even if a motor may have power.")] = False,
) -> None:
    """Send an NMT command (CiA 301): start, stop, preop, reset, reset-comm.

    It listens first, and refuses while canbase's driver, its watchdog or another master is on the bus. Then it reads
    whether the motors have power, says what the command does to them, and asks where one has power or it is unknown.
    NMT stop is no emergency stop: a motor with power stops only as the drive's 6007h orders.

    Exit codes: 0 the nodes report the state, or show none, 1 refused or not obeyed, 2 wrong command line.
    """
    from canbase_commissioning.nmt_command import Order
    from canbase_commissioning.onbus.bus_session import choose_bus
    from canbase_commissioning.onbus.nmt_on_bus import run_nmt

    if node != ALL and not (node.isdecimal() and 1 <= int(node) <= 127):
        raise typer.BadParameter(f"{node!r} is no node: expected 1 to 127, or all", param_hint="NODE")
    bus, robot = choose_bus(config, interface, channel, bitrate)
    target = 0 if node == ALL else int(node)
    run_nmt(bus, robot, target, Order(order.value), timeout_s, force=force, yes=yes)
