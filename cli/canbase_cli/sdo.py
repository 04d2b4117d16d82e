"""`canbase bus sdo`: reads or writes one object of one node."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from canbase_cli import completion
from canbase_cli.bus_options import BitrateOption, ChannelOption, InterfaceOption
from canbase_cli.options import ConfigOption

app = typer.Typer(help="Read or write one object of a node.", no_args_is_help=True)

READ_EPILOG: Final = (
    "Examples:  \ncanbase bus sdo read 1 6041 --channel can0  \ncanbase bus sdo read 2 1018:4 --config robot.yaml  \n"
    "canbase bus sdo read 1 0x2000:0 --type u16 --raw  \ncanbase bus sdo read 1 'Target velocity' --eds vendor.eds  \n"
    "canbase bus sdo read 1 Identity.Vendor-ID --channel can0"
)
WRITE_EPILOG: Final = (
    "Examples:  \ncanbase bus sdo write 1 1017 100 --channel can0  \ncanbase bus sdo write 1 605A 0x2 "
    "--config robot.yaml  \n"
    "canbase bus sdo write 1 'Profile acceleration' 2000 --eds vendor.eds"
)

NodeArgument = Annotated[
    int,
    typer.Argument(
        metavar="NODE", min=1, max=127, help="Node id.", show_default=False, autocompletion=completion.node_ids
    ),
]
ObjectArgument = Annotated[
    str,
    typer.Argument(
        metavar="OBJECT",
        help="INDEX or INDEX:SUB, the index hexadecimal: 6041, 0x1018:4; or a name from the EDS.",
        show_default=False,
        autocompletion=completion.objects,
    ),
]
TypeOption = Annotated[
    str | None,
    typer.Option("--type", metavar="TYPE", help="u8 … i64, f32, str, hex.", show_default="from EDS or profile"),
]
EdsOption = Annotated[Path | None, typer.Option("--eds", metavar="FILE", help="EDS file of the drive: types, names.")]
IgnoreEdsOption = Annotated[
    bool, typer.Option("--ignore-eds", help="Even against access or range of --eds, where that file is wrong.")
]
TimeoutOption = Annotated[
    float,
    typer.Option("--sdo-timeout", metavar="SECONDS", min=0.02, max=10.0, help="How long to wait for an SDO answer."),
]


@app.callback()
def _group() -> None:
    """Read or write one object of a node."""


@app.command("read", epilog=READ_EPILOG)
def read(
    node: NodeArgument,
    at: ObjectArgument,
    config: ConfigOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    kind: TypeOption = None,
    eds: EdsOption = None,
    timeout_s: TimeoutOption = 0.5,
    ignore_eds: IgnoreEdsOption = False,
    raw: Annotated[bool, typer.Option("--raw", help="Print the value alone, for scripts.")] = False,
) -> None:
    """Read one object: name, value in hexadecimal and decimal, meaning; with --eds also its access and range.

    Exit codes: 0 read, 1 refused by the drive or no answer, 2 wrong command line or robot.yaml.
    """
    from canbase_commissioning.onbus.bus_session import choose_bus
    from canbase_commissioning.onbus.sdo_command import Target, run_read

    bus, robot = choose_bus(config, interface, channel, bitrate)
    target = Target.of(node, at, kind, eds, robot)
    run_read(bus, target, timeout_s, raw=raw, ignore_eds=ignore_eds)


@app.command("write", epilog=WRITE_EPILOG, context_settings={"ignore_unknown_options": True})
def write(
    node: NodeArgument,
    at: ObjectArgument,
    value: Annotated[str, typer.Argument(metavar="VALUE", help="80, 0x50, 50h, -80, or text.", show_default=False)],
    config: ConfigOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    kind: TypeOption = None,
    eds: EdsOption = None,
    timeout_s: TimeoutOption = 0.5,
    ignore_eds: IgnoreEdsOption = False,
    force: Annotated[
        bool, typer.Option("--force", help="Even while a motor has power, or canbase's driver runs.")
    ] = False,
) -> None:
    """Write one object, and read it back.

    Refused while a motor of this node has power, and while canbase's driver runs on this bus: after each write of
    another client the driver boots the drive anew, as soon as no motor of it has power, and the watchdog stops the
    robot if one has. With --eds, a read-only object and a value out of range are refused before anything is sent;
    --force does not change that.

    Exit codes: 0 written and read back, 1 refused or no answer, 2 wrong command line, value or robot.yaml.
    """
    from canbase_commissioning.onbus.bus_session import choose_bus
    from canbase_commissioning.onbus.sdo_command import Target, run_write

    bus, robot = choose_bus(config, interface, channel, bitrate)
    target = Target.of(node, at, kind, eds, robot)
    run_write(bus, target, value, timeout_s, force=force, ignore_eds=ignore_eds)
