"""`canbase bus params`: the parameters of a drive in a file: saved, compared, restored; stored in the drive, reset."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated, Final

import typer

from canbase_cli.bus_options import BitrateOption, ChannelOption, InterfaceOption, SdoTimeoutOption
from canbase_cli.options import ConfigOption
from canbase_cli.sdo import NodeArgument

app = typer.Typer(help="Save, compare and restore the parameters of a drive.", no_args_is_help=True)

SAVE_EPILOG: Final = (
    "Example:  \ncanbase bus params save 1 --eds vendor.eds left.dcf --config robot.yaml"
)  # fmt: skip
DIFF_EPILOG: Final = (
    "Examples:  \ncanbase bus params diff left.dcf 1 --config robot.yaml      (what has changed since)  \n"
    "canbase bus params diff 1 2 --eds vendor.eds --channel can0  (two drives)  \n"
    "canbase bus params diff left.dcf boot --config robot.yaml   (what canbase sets at its start)  \n"
    "canbase bus params diff vendor.eds 1 --channel can0          (against the manufacturer's defaults)"
)
RESTORE_EPILOG: Final = (
    "Examples:  \ncanbase bus params restore left.dcf --config robot.yaml  \n"
    "canbase bus params restore left.dcf --node 2 --channel can0   (COB-IDs move with the node id)"
)


class Group(str, Enum):
    """Parameters of 1010h and 1011h."""

    ALL = "all"
    COMMUNICATION = "communication"
    APPLICATION = "application"


NeededEdsOption = Annotated[Path, typer.Option("--eds", metavar="FILE", help="EDS file of the drive.", dir_okay=False)]
YesOption = Annotated[bool, typer.Option("--yes", "-y", help="Do not ask.")]
WithoutStatuswordOption = Annotated[
    bool,
    typer.Option("--without-statusword", help="For a node that has no statusword: you know that no motor has power."),
]
GroupOption = Annotated[Group, typer.Option("--group", help="Which parameters.")]


@app.callback()
def _group() -> None:
    """Save, compare and restore the parameters of a drive."""


@app.command("save", epilog=SAVE_EPILOG)
def save(
    node: NodeArgument,
    out: Annotated[Path, typer.Argument(metavar="OUT.dcf", help="The file to write.", show_default=False)],
    eds: NeededEdsOption,
    config: ConfigOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    timeout_s: SdoTimeoutOption = 0.5,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file if it is there.")] = False,
) -> None:
    """Read every object that the EDS lists, and write a DCF (CiA 306).

    It only reads, so it may run beside the driver; long objects come by SDO block transfer where the drive has it. The
    file also has who the drive is (1018h, 1008h, 1009h, 100Ah), and each object that it refused, with the reason.

    Exit codes: 0 written, 1 no answer, 2 wrong command line, EDS or robot.yaml.
    """
    from canbase_commissioning.onbus.bus_session import choose_bus
    from canbase_commissioning.onbus.params_command import run_save

    bus, robot = choose_bus(config, interface, channel, bitrate)
    run_save(bus, robot, node, eds, out, timeout_s, overwrite=overwrite)


@app.command("diff", epilog=DIFF_EPILOG)
def diff(
    first: Annotated[str, typer.Argument(metavar="A", help="A DCF or EDS file, or a node id.", show_default=False)],
    second: Annotated[
        str, typer.Argument(metavar="B", help="The same; or boot: what the driver sets.", show_default=False)
    ],
    config: ConfigOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    eds: Annotated[
        Path | None, typer.Option("--eds", metavar="FILE", help="EDS file of the drive.", show_default="the file's own")
    ] = None,
    timeout_s: SdoTimeoutOption = 0.5,
    everything: Annotated[bool, typer.Option("--all", help="Measurements, states and commands too.")] = False,
) -> None:
    """Compare the settings of two files or drives, or with those of the driver's boot. It only reads.

    COB-IDs that contain the node id are compared for the node id of B. An EDS file counts with its defaults.

    Exit codes: 0 alike, 1 no answer or the boot would fail, 2 wrong command line or file, 3 they differ.
    """
    from canbase_commissioning.onbus.bus_session import choose_bus, robot_if_given
    from canbase_commissioning.onbus.params_command import Side, run_diff

    needs_bus = any(Side.of(word).node for word in (first, second))
    bus, robot = choose_bus(config, interface, channel, bitrate) if needs_bus else (None, robot_if_given(config))
    run_diff(bus, robot, first, second, eds, timeout_s, all_=everything)


@app.command("restore", epilog=RESTORE_EPILOG)
def restore(
    file: Annotated[Path, typer.Argument(metavar="FILE.dcf", help="From canbase bus params save.", show_default=False)],
    config: ConfigOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    node: Annotated[
        int | None,
        typer.Option("--node", metavar="NODE", min=1, max=127, help="Node id.", show_default="that of the file"),
    ] = None,
    timeout_s: SdoTimeoutOption = 0.5,
    yes: YesOption = False,
    other_firmware: Annotated[
        bool, typer.Option("--other-firmware", help="Do not ask about a drive with other firmware.")
    ] = False,
    without_statusword: WithoutStatuswordOption = False,
) -> None:
    """Write the settings that differ from the file, in a safe order, and read each one back.

    Refused while a driver or another master is on the bus, while a motor has power or a wheel turns, and for another
    product (1018h). Commands, targets and states are never written. A PDO is off while it changes.

    Exit codes: 0 the drive has the settings of the file, 1 refused, not everything, or no answer, 2 wrong command line
    or file.
    """
    from canbase_commissioning.onbus.bus_session import choose_bus
    from canbase_commissioning.onbus.params_restore import run_restore

    bus, robot = choose_bus(config, interface, channel, bitrate)
    run_restore(
        bus, robot, file, node, timeout_s,
        yes=yes, other_firmware=other_firmware, without_statusword=without_statusword,
    )  # fmt: skip


@app.command("store")
def store(
    node: NodeArgument,
    config: ConfigOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    group: GroupOption = Group.ALL,
    yes: YesOption = False,
    without_statusword: WithoutStatuswordOption = False,
) -> None:
    """Have the drive keep its present parameters over a power cycle (1010h, "save").

    Refused under the conditions of restore. Exit codes: 0 stored, 1 refused or no answer, 2 wrong command line.
    """
    from canbase_commissioning.onbus.bus_session import choose_bus
    from canbase_commissioning.onbus.params_restore import run_order
    from canbase_commissioning.parameters.storing import Order

    bus, robot = choose_bus(config, interface, channel, bitrate)
    run_order(bus, robot, node, Order.STORE, group.value, yes=yes, without_statusword=without_statusword)


@app.command("defaults")
def defaults(
    node: NodeArgument,
    config: ConfigOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    group: GroupOption = Group.ALL,
    yes: YesOption = False,
    without_statusword: WithoutStatuswordOption = False,
) -> None:
    """Give the drive its manufacturer's parameters back, with its next reset (1011h, "load").

    Save them first: canbase bus params save. Refused under the conditions of restore.

    Exit codes: 0 ordered, 1 refused or no answer, 2 wrong command line.
    """
    from canbase_commissioning.onbus.bus_session import choose_bus
    from canbase_commissioning.onbus.params_restore import run_order
    from canbase_commissioning.parameters.storing import Order

    bus, robot = choose_bus(config, interface, channel, bitrate)
    run_order(bus, robot, node, Order.DEFAULTS, group.value, yes=yes, without_statusword=without_statusword)
