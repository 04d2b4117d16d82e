"""What the subcommands share: their options, and what ROS takes from the command line."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from typer.core import TyperCommand, TyperGroup

from canbase_cli.log_format import log_times
from canbase_cli.middleware import prefer_udp, stay_on_this_computer, take_no_profile_from_here
from canbase_runtime.terminal import FAILED, ROBOT_HERE, CommandError, colour, fail
from canbase_runtime.wrong_start import WrongStartError

ROS_USAGE: Final = "[OPTIONS] [--ros-args …]"
WRONG_COMMAND_LINE: Final = 2
ROS_FLAG: Final = "--ros-args"
OLD_OPTIONS: Final = {"out": "output", "mcap": "output"}
"""Names of options up to version 0.1, each with the present one. To go in 0.3, as `old_names.py`."""
_GENERATOR: Final = "rosidl_generator_py.generate_py_impl"
"""The messages' package imports the generator of their Python code, a parser with it, wherever that can be imported.
Only a build needs it: 2.6 MB of each process, and 0.02 s of its start."""
_NAMESPACE: Final = re.compile(r"/?([A-Za-z_][A-Za-z0-9_]*(?:/[A-Za-z_][A-Za-z0-9_]*)*)/?")


class Commands(TyperGroup):
    """Commands that end by `CommandError`."""

    def invoke(self, ctx: Any) -> Any:
        """Runs one, to its exit code."""
        try:
            return super().invoke(ctx)
        except CommandError as error:
            if str(error):
                typer.secho(f"canbase: {error}", err=True, fg=typer.colors.RED, color=colour())
            raise typer.Exit(error.code) from error


def new_app(group: type[TyperGroup] = Commands) -> typer.Typer:
    """An app called canbase, without commands."""
    return typer.Typer(
        name="canbase",
        cls=group,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        context_settings={
            "help_option_names": ["-h", "--help"],
            "token_normalize_func": lambda word: OLD_OPTIONS.get(word, word),
        },
    )


def named(config: Path | None, *, bench: bool) -> Path | None:
    """The robot.yaml that the command line names: --config, or with --bench the sample. Raises typer.BadParameter."""
    from canbase_config.load import sample

    if bench and config is not None:
        raise typer.BadParameter("give --config or --bench, not both")
    return sample("bench") if bench else config


def one_of(file: Path | None, config: Path | None) -> Path | None:
    """The robot.yaml of a command that takes it as FILE too. Raises typer.BadParameter."""
    if file is not None and config is not None:
        raise typer.BadParameter("give the robot.yaml once: --config FILE, or FILE alone")
    return config or file


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
    typer.Option("--config", "-c", metavar="FILE", help="The robot.yaml.", show_default=ROBOT_HERE),
]
RobotFile = Annotated[
    Path | None, typer.Argument(metavar="[FILE]", help="The same as --config FILE.", show_default=False)
]
BenchOption = Annotated[bool, typer.Option("--bench", help="The simulated robot that comes with canbase.")]
NamespaceOption = Annotated[
    str,
    typer.Option("--namespace", "-n", metavar="NS", callback=_namespace, help="ROS namespace of this robot's nodes."),
]


UnusedNamespaceOption = Annotated[
    str,
    typer.Option(
        "--namespace", "-n", metavar="NS", callback=_namespace, help="No effect: this process has no ROS node."
    ),
]
"""So that one can start all processes of a robot with the same options."""


class RosCommand(TyperCommand):
    """A command that keeps what stands from `--ros-args` on for rclpy, and reads the rest of its line strictly."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Reads what stands before `--ros-args`."""
        at = args.index(ROS_FLAG) if ROS_FLAG in args else len(args)
        ctx.meta[ROS_FLAG] = args[at + 1 :]
        return super().parse_args(ctx, args[:at])

    def invoke(self, ctx: Any) -> Any:
        """Runs it. A parameter of another type than its node declares (use_sim_time:=3) is a wrong command line.

        ROS looks at types only when a node begins.
        """
        try:
            return super().invoke(ctx)
        except Exception as error:  # its class is that of rclpy, which many commands never import; others go on
            exceptions = sys.modules.get("rclpy.exceptions")
            if exceptions is None or not isinstance(error, exceptions.InvalidParameterTypeException):
                raise
            raise typer.BadParameter(f"behind {ROS_FLAG}: {error}") from error


def ros_arguments(ctx: typer.Context, namespace: str) -> list[str]:
    """Arguments for `rclpy.init`: the namespace, then what the user wrote behind `--ros-args`; empty without both.

    Raises typer.BadParameter for what ROS does not take: call it before anything is opened.
    """
    given = list(ctx.meta.get(ROS_FLAG, ()))
    if given:
        _check_ros_arguments(given)
    remap = ["-r", f"__ns:={namespace}"] if namespace else []
    return [ROS_FLAG, *remap, *given] if remap or given else []


def check_unused_ros_arguments(ctx: typer.Context) -> None:
    """For a process without a ROS node, which launch files start with words for ROS as well: they have no effect.

    Raises typer.BadParameter for what ROS does not take. Without ROS 2, or with one that cannot be loaded, nothing can
    check them: a defect of ROS keeps no watchdog from starting.
    """
    given = list(ctx.meta.get(ROS_FLAG, ()))
    if given and _has_ros():
        _check_ros_arguments(given)


def _has_ros() -> bool:
    if find_spec("rclpy") is None:
        return False
    try:
        import_module("rclpy.context")
    except ImportError:  # of a library that is missing or of another version, too
        return False
    return True


def _check_ros_arguments(given: list[str]) -> None:
    """ROS reads them for a moment, in a context of its own that reaches nobody."""
    with ros_needed():
        from rclpy.context import Context
        from rclpy.impl.implementation_singleton import rclpy_implementation
    context = Context()
    try:
        context.init([ROS_FLAG, *given])
    except rclpy_implementation.UnknownROSArgsError as error:
        words = str(error).strip("[]").replace("'", "")
        raise typer.BadParameter(f"ROS does not know {words} behind {ROS_FLAG}") from error
    except rclpy_implementation.RCLError as error:
        raise typer.BadParameter(f"behind {ROS_FLAG}: {str(error).partition(', at /')[0]}") from error
    context.try_shutdown()


@contextmanager
def right_start() -> Iterator[None]:
    """A wrong command line: use_sim_time, a speed limit that cannot be, a source that is the robot's own output, or
    remap rules that tear an action apart."""
    try:
        yield
    except WrongStartError as error:
        fail(str(error), WRONG_COMMAND_LINE)


@contextmanager
def ros_needed() -> Iterator[None]:
    """Around the import of a module that needs ROS 2: where that is missing, advice and exit code 1."""
    stay_on_this_computer(os.environ)
    prefer_udp(os.environ)
    take_no_profile_from_here(os.environ)
    log_times(os.environ)
    sys.modules.setdefault(_GENERATOR, None)  # type: ignore[arg-type] # documented: its import fails
    try:
        yield
    except ModuleNotFoundError as error:
        if str(error.name).partition(".")[0] == "nav2_msgs":
            fail("action.nav2_behaviors needs nav2_msgs: install ros-<distro>-nav2-msgs, or set it to false", FAILED)
        if str(error.name).partition(".")[0] not in ("rclpy", "canbase"):
            raise
        fail("ROS 2 is not found: source its setup.bash, or install canbase[ros] from PyPI", FAILED)
