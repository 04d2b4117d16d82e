"""`canbase bus dump`: the frames of a bus as they are received, decoded. It sends nothing."""

from __future__ import annotations

import os
import sys
from typing import Annotated, Final

import typer

from canbase_cli.bus_options import BitrateOption, ChannelOption, InterfaceOption
from canbase_cli.end_signals import end_signals
from canbase_cli.explain import EdsOption
from canbase_cli.options import ConfigOption
from canbase_recording.kind import Kind
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail

EPILOG: Final = (
    "Examples:  \ncanbase bus dump --channel can0  \ncanbase bus dump --config robot.yaml --node 1 "
    "--kind emcy --kind sdo  \n"
    "canbase bus dump | head -100"
)


def dump(
    config: ConfigOption = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    nodes: Annotated[
        list[int] | None,
        typer.Option(
            "--node", metavar="ID", min=1, max=127, help="Frames of this node; repeatable.", show_default="all"
        ),
    ] = None,
    kinds: Annotated[
        list[Kind] | None, typer.Option("--kind", help="Frames of this kind; repeatable.", show_default="all")
    ] = None,
    eds: EdsOption = None,
    file: Annotated[str, typer.Argument(hidden=True)] = "",
) -> None:
    """Show each frame on the bus in words, until Ctrl-C. It sends nothing.

    Without --config and --channel it listens to the bus of the robot here. PDO mappings come from robot.yaml, or from
    the SDO transfers that are seen; an assumed mapping is marked. `canbase explain` reads recordings.

    Exit codes: 0 ended by Ctrl-C or by its reader, 1 the bus failed, 2 wrong command line or robot.yaml.
    """
    from canbase_commissioning.onbus.bus_session import choose_bus
    from canbase_config.eds_file import EdsError
    from canbase_recording.explain_file import known_objects
    from canbase_recording.live_bus import LiveBus, LiveBusError
    from canbase_recording.live_words import LiveWords

    if file:
        raise typer.BadParameter(f"dump listens to a bus. A recording: canbase explain {file}")
    bus, robot = choose_bus(config, interface, channel, bitrate)
    try:
        words = LiveWords(robot, known_objects(eds or ()), frozenset(nodes or ()), frozenset(kinds or ()))
    except EdsError as error:
        fail(f"--eds: {error}", WRONG_INPUT)
    ended = end_signals()
    try:
        with LiveBus(bus) as live:
            for frame in live.frames(lambda: bool(ended)):
                if (line := words.line(frame)) is not None:
                    print(line, flush=True)
    except LiveBusError as error:
        fail(str(error), FAILED)
    except BrokenPipeError:  # its reader has enough: head, less
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
