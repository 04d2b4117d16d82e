"""`canbase up`: the whole stack in the foreground, one process a part, ended together."""

from __future__ import annotations

import signal
import time
from types import FrameType
from typing import Annotated

import typer

from canbase_cli.options import FAILED, ConfigOption, NamespaceOption, colour, fail, load_config
from canbase_cli.stack import POLL_S, Stack


def up(
    ctx: typer.Context,
    config: ConfigOption = None,
    namespace: NamespaceOption = "",
    sim: Annotated[
        bool | None,
        typer.Option("--sim/--no-sim", help="Simulated drives too.", show_default="yes on a udp_multicast bus"),
    ] = None,
) -> None:
    """Run the whole stack: watchdog, velocity mux and safety filter, motor driver, action server.

    Ctrl-C stops the robot and ends all parts. When one of them dies, the robot is stopped and the others are ended.

    Exit codes: 0 ended by Ctrl-C or SIGTERM and every part ended well, 1 a part died, 2 wrong command line or file.
    """
    loaded = load_config(config)
    with_sim = loaded.robot.bus.interface == "udp_multicast" if sim is None else sim
    stack = Stack(loaded.path, namespace=namespace, sim=with_sim, ros_args=rest_of(ctx))
    ended: list[int] = []

    def end(number: int, _frame: FrameType | None) -> None:
        ended.append(number)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, end)
    stack.start()
    typer.secho(f"canbase: {loaded.robot.name} is up; Ctrl-C stops the robot and ends it", err=True, color=colour())
    while not ended and stack.death() is None:
        time.sleep(POLL_S)
    death = stack.death()
    typer.secho(f"canbase: {death or 'ending'}; stopping the robot", err=True, color=colour())
    codes = stack.stop()
    bad = {part: code for part, code in codes.items() if code != 0}
    if death is not None or bad:
        fail(f"not ended well: {bad}", FAILED)


def rest_of(ctx: typer.Context) -> list[str]:
    """What the user wrote from --ros-args on, with that word."""
    given = list(ctx.meta.get("--ros-args", ()))
    return ["--ros-args", *given] if given else []
