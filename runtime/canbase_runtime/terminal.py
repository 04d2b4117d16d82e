"""What a command prints: filtered, coloured; and how it ends when a person has to change something.

Exit codes: 0 success, 1 it did not work out, 2 a wrong command line or robot.yaml. A command may add its own.
"""

from __future__ import annotations

import io
import os
import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final, NoReturn, TextIO

import typer

if TYPE_CHECKING:
    from canbase_config.load import Loaded

FAILED: Final = 1
"""Exit code: the command was called correctly and did not succeed."""
WRONG_INPUT: Final = 2
"""Exit code: the command line or robot.yaml has to be changed; typer uses it for the command line too."""
ROBOT_HERE: Final = "CANBASE_ROBOT; the robot that runs or is installed here; ./robot.yaml"
"""Whose robot.yaml is meant without --config (which_robot.py), in a help."""
_COLOURS: Final = "\x1b\\[[0-9;]*m"
_CURSOR: Final = "\r|\x1b\\[[?0-9;]*[ABCDHJKhlm]"
_CONTROLS: Final = "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]"
"""All of Unicode's category Cc but line feed and tab, line and paragraph separators, and what turns the direction."""


class CommandError(Exception):
    """A command ends here: a last line for stderr, none where all is printed, and its exit code. The command line
    (`canbase_cli.options`) is the one place that prints and exits."""

    def __init__(self, text: str, code: int) -> None:
        super().__init__(text)
        self.code = code


class Screen(io.TextIOWrapper):
    """What a command prints. Names from DDS, files and CAN control no terminal, whichever command prints them: control
    characters become \\u001b (so in JSON too), except those of `passes`, a regular expression."""

    with_cursor: TextIO
    """The same for a bar or a picture."""

    def __init__(self, stream: io.TextIOWrapper, passes: str = _COLOURS) -> None:
        super().__init__(
            stream.buffer, stream.encoding, "backslashreplace",
            line_buffering=stream.line_buffering, write_through=stream.write_through,
        )  # fmt: skip
        self._stream = stream  # it would close the descriptor with its end
        self._controls = re.compile(f"({passes})|{_CONTROLS}")

    def write(self, text: str) -> int:
        """As every stream. The length is that of `text`."""
        super().write(self._controls.sub(lambda found: found[1] or f"\\u{ord(found[0]):04x}", text))
        return len(text)


def filter_output() -> None:
    """For a whole process, at its start. A descriptor that was closed stays so."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper):
            screen = Screen(stream)
            screen.with_cursor = Screen(stream, _CURSOR)
            setattr(sys, name, screen)


def with_cursor(stream: TextIO) -> TextIO:
    """For what moves the cursor: a progress bar, a picture. It shows nothing of others."""
    return stream.with_cursor if isinstance(stream, Screen) else stream


def load_config(path: Path | None, *, quiet: bool = False) -> Loaded:
    """The robot in `path`, or the one that is meant (which_robot.py), which it names.

    Prints warnings unless `quiet`; problems always, and exits with 2.
    """
    from canbase_config.errors import ConfigError
    from canbase_config.load import load_robot
    from canbase_runtime.which_robot import NoRobotError, which_robot

    try:
        meant = which_robot(path)
    except NoRobotError as error:
        fail(str(error), WRONG_INPUT)
    try:
        loaded = load_robot(meant.path)
    except ConfigError as error:
        typer.echo(str(error), err=True)
        count = len(error.problems)
        fail(f"{meant.path} cannot be used: {count} problem{'s' if count > 1 else ''}", WRONG_INPUT)
    if meant.why:
        typer.echo(f"robot {loaded.robot.name}: {meant.path} ({meant.why})", err=True)
    for warning in () if quiet else loaded.warnings:
        warn(str(warning))
    return loaded


def warn(text: str) -> None:
    """A line on stderr; the command goes on."""
    typer.secho(f"warning: {text}", err=True, fg=typer.colors.YELLOW, color=colour())


def agreed(question: str) -> bool:
    """Whether the person at the terminal says yes."""
    return typer.confirm(question, default=False, err=True)


def fail(text: str, code: int) -> NoReturn:
    """Ends the command with a last line on stderr and the exit code `code`."""
    raise CommandError(text, code)


def colour() -> bool | None:
    """For typer's `color`. None: colour on a terminal alone; the user's NO_COLOR (no-color.org) switches that off."""
    return False if os.environ.get("NO_COLOR") else None
