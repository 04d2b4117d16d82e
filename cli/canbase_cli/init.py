"""`canbase setup init`: a robot.yaml from the drives on a bus."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from canbase_cli.bus_options import BitrateOption, ChannelOption, InterfaceOption, SdoTimeoutOption

EPILOG: Final = (
    "Examples:  \n"
    "canbase setup init --channel can0  \n"
    "canbase setup init --interface slcan --channel /dev/ttyACM0 --bitrate 500000 --output robot.yaml  \n"
    "canbase setup init --config robot.yaml --output new.yaml      (the same bus; while canbase serve sim runs)"
)


def init(
    config: Annotated[
        Path | None,
        typer.Option("--config", "-c", metavar="FILE", help="Take the bus of this robot.yaml.", show_default="can0"),
    ] = None,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The file to write.")] = Path(
        "robot.yaml"
    ),
    timeout_s: SdoTimeoutOption = 0.3,
    answers: Annotated[
        Path | None, typer.Option("--answers", metavar="FILE", help="YAML with answers by key, for scripts.")
    ] = None,
    yes: Annotated[
        bool, typer.Option("--yes", "-y", help="Take the proposed answer of each question that has one.")
    ] = False,
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Ask and be answered in lines of JSON, for another program: docs/ros_api.md."),
    ] = False,
) -> None:
    """Write a robot.yaml: find the drives on the bus, and ask about the robot. Nothing moves.

    It listens first, and ends if another master is on the bus. Then it reads identity, encoder resolution and gear
    ratio of every drive by SDO, which changes nothing. It asks for what no drive reports: sides, wheels, edges, speed.
    A bare Enter takes the proposed answer. The file passes `canbase config check`; an existing file is kept. Drives
    fresh from the box often have one node id all, or another bit rate: `canbase bus adopt` comes first for them.

    Keys of --answers: name, nodeN.side, nodeN.gear_ratio, nodeN.counts_per_motor_rev, nodeN.velocity_unit (N: node id),
    wheel_radius_m, track_m, front_m, rear_m, half_width_m, linear_mps, scanner, scanner.x_m, scanner.y_m,
    scanner.yaw_deg, scanner.upside_down, estop.

    Exit codes: 0 written, 1 no drives, another master or values that do not fit, 2 wrong command line.
    """
    from canbase_commissioning.onbus.bus_session import choose_bus
    from canbase_commissioning.onbus.init_command import run

    named = channel if config else channel or "can0"
    run(choose_bus(config, interface, named, bitrate)[0], output, answers, timeout_s, yes=yes, as_json=as_json)
