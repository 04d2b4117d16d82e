"""`canbase bus adopt`: drives fresh from the box get node ids and a bit rate."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from canbase_cli.bus_options import ChannelOption, InterfaceOption
from canbase_cli.options import ConfigOption
from canbase_runtime.terminal import WRONG_INPUT, fail

EPILOG: Final = (
    "Examples:  \n"
    "sudo canbase bus adopt --channel can0 --set-link  \n"
    "canbase bus adopt --config robot.yaml  \n"
    "canbase bus adopt --channel can0 --bitrate 500000 --present-bitrate 125000"
)


def adopt(
    config: ConfigOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: Annotated[
        int | None,
        typer.Option(
            "--bitrate", metavar="BIT/S", help="What the drives shall have.", show_default="robot.yaml, or 500000"
        ),
    ] = None,
    present: Annotated[
        int | None,
        typer.Option("--present-bitrate", metavar="BIT/S", help="What the drives have.", show_default="searched"),
    ] = None,
    sets_link: Annotated[
        bool, typer.Option("--set-link", help="Set the bit rate of a SocketCAN interface by ip link; needs root.")
    ] = False,
    answers: Annotated[
        Path | None, typer.Option("--answers", metavar="FILE", help="YAML with answers by key, for scripts.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Confirm, and take the proposed node ids.")] = False,
) -> None:
    """Give drives fresh from the box their node ids and bit rate (LSS, CiA 305). Nothing moves.

    It listens at every bit rate, and asks only where nothing was received. It refuses while a motor has power, or
    another master is on the bus. Then it finds every drive by its serial number, also when several have one node id,
    and asks which node id each shall have. All change the bit rate at once; each setting is verified, then stored.
    Before that a power cycle brings back the old settings. Ctrl-C leaves the drives in LSS waiting.

    Keys of --answers: start (--yes confirms it), serial_N (hexadecimal): node id, few: go on although drives
    are missing.

    Exit codes: 0 all drives ready, 1 not, 2 wrong command line or robot.yaml, 130 Ctrl-C.
    """
    from canbase_commissioning.onbus.adopt_command import run
    from canbase_commissioning.onbus.bus_session import choose_bus
    from canbase_config.bit_rate import BIT_RATES

    bus, robot = choose_bus(config, interface, channel, bitrate)
    wanted = bitrate or bus.bitrate
    for rate in (wanted, present):
        if rate is not None and rate not in BIT_RATES:
            fail(
                f"{rate} bit/s is no bit rate of CANopen, expected one of {', '.join(map(str, BIT_RATES))}", WRONG_INPUT
            )
    if wanted != bus.bitrate:
        fail(f"--bitrate {wanted} contradicts bus.bitrate of robot.yaml, {bus.bitrate}: change it there", WRONG_INPUT)
    run(bus, robot, answers, present, yes=yes, sets_link=sets_link)
