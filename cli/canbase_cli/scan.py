"""`canbase bus scan`: the nodes on the bus, their identities, and the drive profile that fits each."""

from __future__ import annotations

from typing import Annotated, Final

import typer

from canbase_cli.bus_options import BitrateOption, ChannelOption, InterfaceOption, SdoTimeoutOption
from canbase_cli.options import ConfigOption

EPILOG: Final = (
    "Examples:  \n"
    "canbase bus scan --channel can0  \n"
    "canbase bus scan --config robot.yaml --passive  \n"
    "canbase bus scan --interface slcan --channel /dev/ttyACM0 --bitrate 500000 --json"
)


def scan(
    config: ConfigOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    seconds: Annotated[
        float,
        typer.Option("--seconds", metavar="SECONDS", min=0.1, max=60.0, help="How long to listen before reading."),
    ] = 1.5,
    timeout_s: SdoTimeoutOption = 0.3,
    passive: Annotated[bool, typer.Option("--passive", help="Only listen, send nothing.")] = False,
    yes: Annotated[
        bool, typer.Option("--yes", "-y", help="Read the nodes even if another master is on the bus.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the nodes as one line of JSON.")] = False,
) -> None:
    """Find the nodes on the bus: identity, profile, NMT state, heartbeat.

    It listens first. Then it reads the identity of every node id by SDO, which changes nothing. If another master is on
    the bus, it reports that and asks you first. A node in NMT state stopped that sends no heartbeat cannot be found.
    It names node ids that several drives have, and drives that answer and send nothing, with the reason.

    Exit codes: 0 nodes found, and all nodes of --config, 1 none, not all, or several drives with one node id, 2 wrong
    command line or robot.yaml.
    """
    from canbase_commissioning.onbus.bus_session import choose_bus
    from canbase_commissioning.onbus.scan_command import run

    bus, robot = choose_bus(config, interface, channel, bitrate)
    run(bus, robot, seconds, timeout_s, passive=passive, yes=yes, as_json=as_json)
