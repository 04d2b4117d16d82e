"""`canbase up`: the whole stack in the foreground, one process a part, ended together."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from canbase_cli.end_signals import end_signals
from canbase_cli.options import BenchOption, ConfigOption, NamespaceOption, named, ros_arguments
from canbase_cli.services import clear_first_records
from canbase_cli.stack import POLL_S, Death, Stack
from canbase_runtime.own_modules import module_command
from canbase_runtime.terminal import FAILED, colour, fail, load_config

if TYPE_CHECKING:
    from canbase_config.robot import Robot


def up(
    ctx: typer.Context,
    config: ConfigOption = None,
    bench: BenchOption = False,
    namespace: NamespaceOption = "",
    sim: Annotated[
        bool | None,
        typer.Option("--sim/--no-sim", help="Start simulated drives too.", show_default="yes on a udp_multicast bus"),
    ] = None,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Show the log of the simulated drives.")] = False,
) -> None:
    """Run the whole stack: watchdog, velocity mux and safety filter, motor driver, action server.

    Ctrl-C stops the robot and ends all processes. If one process dies, the robot is stopped and the others are ended.

    Exit codes: 0 every process ended well after Ctrl-C or SIGTERM, 1 a process died, 2 wrong command line or file.
    """
    loaded = load_config(named(config, bench=bench))
    for_parts, for_readiness = ros_arguments(ctx, ""), ros_arguments(ctx, namespace)
    with_sim = loaded.robot.bus.interface == "udp_multicast" if sim is None else sim
    _refuse_twice(loaded.robot)
    clear_first_records(loaded.robot, simulated=with_sim)
    ended = end_signals()
    stack = Stack(loaded.path.resolve(), namespace=namespace, sim=with_sim, ros_args=for_parts, quiet_sim=not verbose)
    with stack, _reports_when_ready(namespace, for_readiness):
        _say(f"{loaded.robot.name} is starting; Ctrl-C stops the robot and ends it")
        death = _wait(stack, ended)
        _say(f"{death or 'ending'}; stopping the robot")
        codes = stack.stop()
    bad = [str(Death(part, code)) for part, code in codes.items() if code != 0]
    if death is not None or bad:
        fail(f"{'; '.join(bad) or death}; what happened, where a stop was recorded: canbase explain", FAILED)


@contextmanager
def _reports_when_ready(namespace: str, ros_args: list[str]) -> Iterator[None]:
    """READY is printed when it is, by a process of its own (`ready.py`) that no part waits for."""
    command = module_command("canbase_cli.ready", str(os.getpid()), namespace, *ros_args)
    teller = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
    try:
        yield
    finally:
        teller.kill()
        teller.wait()


def _refuse_twice(robot: Robot) -> None:
    """Before any part starts: one that runs already is left alone."""
    from canbase_base.latch_folder import SUFFIX, latch_folder
    from canbase_base.single_instance import WRITER, TakenError, bus_name, check, record_name

    bus = bus_name(robot.bus.arguments())
    record = record_name(latch_folder(os.environ, Path.home(), robot.name) / f"driver{SUFFIX}")
    held = ("driver", bus), ("watchdog", bus), ("velocity process", robot.lease.socket), (WRITER, record)
    try:
        for task, name in held:
            check(task, name)
    except TakenError as error:
        fail(f"{robot.name} is not started: {error}", FAILED)


def _wait(stack: Stack, ended: list[int]) -> Death | None:
    """Until a signal, or the death of a part."""
    while not ended:
        death = stack.death()
        if death is not None:
            return death
        time.sleep(POLL_S)
    return None


def _say(text: str) -> None:
    typer.secho(f"canbase: {text}", err=True, color=colour())
