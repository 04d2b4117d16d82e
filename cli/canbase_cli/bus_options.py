"""The options of the commands that use the bus themselves: which bus."""

from __future__ import annotations

from typing import Annotated

import typer

InterfaceOption = Annotated[
    str | None,
    typer.Option(
        "--interface",
        metavar="NAME",
        help="python-can's name of the adapter; replaces that of robot.yaml.",
        show_default="socketcan with --channel",
    ),
]
ChannelOption = Annotated[
    str | None,
    typer.Option(
        "--channel",
        metavar="NAME",
        help="Such as can0; replaces that of robot.yaml.",
        show_default="can0 with --interface",
    ),
]
BitrateOption = Annotated[
    int | None,
    typer.Option("--bitrate", metavar="BIT/S", help="Bit rate, only for adapters that the system does not configure."),
]
SdoTimeoutOption = Annotated[
    float,
    typer.Option("--sdo-timeout", metavar="SECONDS", min=0.02, max=10.0, help="How long to wait for an SDO answer."),
]
