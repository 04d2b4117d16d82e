"""How a command ends when a person has to change something, and its colours.

Exit codes: 0 success, 1 it did not work out, 2 a wrong command line or robot.yaml. A command may add its own.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Final, NoReturn

import typer

if TYPE_CHECKING:
    from canbase_config.load import Loaded

FAILED: Final = 1
"""Exit code: the command was called correctly and did not succeed."""
WRONG_INPUT: Final = 2
"""Exit code: the command line or robot.yaml has to be changed; typer uses it for the command line too."""


def load_config(path: Path | None, *, quiet: bool = False) -> Loaded:
    """The robot in `path`, or the bench sample. Prints warnings unless `quiet`; problems always, and exits with 2."""
    from canbase_config.errors import ConfigError
    from canbase_config.load import load_robot, sample

    path = sample("bench") if path is None else path
    try:
        loaded = load_robot(path)
    except ConfigError as error:
        typer.echo(str(error), err=True)
        count = len(error.problems)
        fail(f"{path} cannot be used: {count} problem{'s' if count > 1 else ''}", WRONG_INPUT)
    for warning in () if quiet else loaded.warnings:
        warn(str(warning))
    return loaded


def warn(text: str) -> None:
    """A line on stderr; the command goes on."""
    typer.secho(f"warning: {text}", err=True, fg=typer.colors.YELLOW, color=colour())


def fail(text: str, code: int) -> NoReturn:
    """Ends the command with a last line on stderr and the exit code `code`."""
    typer.secho(f"canbase: {text}", err=True, fg=typer.colors.RED, color=colour())
    raise typer.Exit(code)


def colour() -> bool | None:
    """For typer's `color`. None: colour on a terminal alone; the user's NO_COLOR (no-color.org) switches that off."""
    return False if os.environ.get("NO_COLOR") else None
