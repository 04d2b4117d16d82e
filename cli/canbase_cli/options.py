"""What the subcommands share: the options, reading robot.yaml, and how they end when the user has to change something.

Exit codes: 0 success, 1 it did not work out, 2 a wrong command line or robot.yaml. A subcommand may add its own.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NoReturn

import typer
from typer.core import TyperCommand

from canbase_cli.middleware import prefer_udp, stay_on_this_computer, take_no_profile_from_here

if TYPE_CHECKING:
    from canbase_config.load import Loaded

FAILED: Final = 1
"""Exit code: it was asked for rightly and did not work out."""
WRONG_INPUT: Final = 2
"""Exit code: the command line or robot.yaml has to be changed; typer uses it for the command line too."""

_ROS_FLAG: Final = "--ros-args"
_NAMESPACE: Final = re.compile(r"/?([A-Za-z_][A-Za-z0-9_]*(?:/[A-Za-z_][A-Za-z0-9_]*)*)/?")


def _namespace(text: str) -> str:
    """`text` as ROS wants a namespace: `/robot1`. An empty one stays empty."""
    if not text.strip("/"):
        return ""
    match = _NAMESPACE.fullmatch(text)
    if match is None:
        raise typer.BadParameter(f"{text!r} is no ROS namespace; expected names of letters, digits and _, joined by /")
    return f"/{match[1]}"


ConfigOption = Annotated[
    Path | None,
    typer.Option("--config", "-c", metavar="FILE", help="The robot.yaml.", show_default="the bench sample"),
]
NamespaceOption = Annotated[
    str,
    typer.Option("--namespace", "-n", metavar="NS", callback=_namespace, help="ROS namespace of this robot's nodes."),
]


UnusedNamespaceOption = Annotated[
    str,
    typer.Option("--namespace", "-n", metavar="NS", callback=_namespace, help="Changes nothing: no ROS node in here."),
]
"""So that one can start all processes of a robot with the same options."""


class RosCommand(TyperCommand):
    """A command that keeps what stands from `--ros-args` on for rclpy, and reads the rest of its line strictly."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Reads what stands before `--ros-args`."""
        at = args.index(_ROS_FLAG) if _ROS_FLAG in args else len(args)
        ctx.meta[_ROS_FLAG] = args[at + 1 :]
        return super().parse_args(ctx, args[:at])


def ros_arguments(ctx: typer.Context, namespace: str) -> list[str]:
    """Arguments for `rclpy.init`: the namespace, then what the user wrote behind `--ros-args`; empty without both."""
    given = list(ctx.meta.get(_ROS_FLAG, ()))
    remap = ["-r", f"__ns:={namespace}"] if namespace else []
    return [_ROS_FLAG, *remap, *given] if remap or given else []


def load_config(path: Path | None) -> Loaded:
    """The robot in `path`, or the bench sample. Prints warnings; what is wrong in the file too, and exits with 2."""
    from canbase_config.errors import ConfigError
    from canbase_config.load import load_robot, sample

    path = sample("bench") if path is None else path
    try:
        loaded = load_robot(path)
    except ConfigError as error:
        typer.echo(str(error), err=True)
        count = len(error.problems)
        fail(f"{path} cannot be used: {count} problem{'s' if count > 1 else ''}", WRONG_INPUT)
    for warning in loaded.warnings:
        typer.secho(f"warning: {warning}", err=True, fg=typer.colors.YELLOW, color=colour())
    return loaded


@contextmanager
def ros_needed() -> Iterator[None]:
    """Around the import of a module that needs ROS 2: where that is missing, advice and exit code 1."""
    stay_on_this_computer(os.environ)
    prefer_udp(os.environ)
    take_no_profile_from_here(os.environ)
    try:
        yield
    except ModuleNotFoundError as error:
        if str(error.name).partition(".")[0] not in ("rclpy", "canbase"):
            raise
        fail("ROS 2 is not found: source its setup.bash, or install canbase[ros] from PyPI", FAILED)


def fail(text: str, code: int) -> NoReturn:
    """Ends the command with a last line on stderr and the exit code `code`."""
    typer.secho(f"canbase: {text}", err=True, fg=typer.colors.RED, color=colour())
    raise typer.Exit(code)


def colour() -> bool | None:
    """For typer's `color`. None: colour on a terminal alone; the user's NO_COLOR (no-color.org) switches that off."""
    return False if os.environ.get("NO_COLOR") else None
