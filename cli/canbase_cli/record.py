"""`canbase record start`: the motor driver writes what its black box has of the last seconds."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Annotated, Final

import typer

from canbase_cli.end_signals import end_signals
from canbase_cli.options import NamespaceOption
from canbase_cli.trigger import Caller
from canbase_runtime.foreign_text import printable
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail

SERVICE: Final = "motor_driver/record"
FIND_S: Final = 5.0
SLICE_S: Final = 0.1
SUFFIXES: Final = (".json", ".asc")
"""In the order in which they appear: who sees the second one has both."""
MOST_BYTES: Final = 200_000_000
_NAME: Final = re.compile(r"record_[^/]*\.asc")
"""The only files that are copied: the path comes from another process."""


EPILOG: Final = (
    "Examples:  \ncanbase record start              the last seconds, into the folder of the black box  \n"
    "canbase record start --seconds 5 --output turn.asc;  canbase explain turn.asc"
)


def record(
    ctx: typer.Context,
    out: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE.asc", help="Copy it there, with its .json; it must not exist yet."
        ),
    ] = None,
    seconds: Annotated[
        float | None, typer.Option("--seconds", min=0.1, help="End after this time.", show_default="now")
    ] = None,
    namespace: NamespaceOption = "",
) -> None:
    """Record the bus of a running robot with all commands and states, also while it drives.

    The motor driver writes what its black box has of the last seconds (black_box.seconds, 10 by default), as for a
    stop: an .asc and a .json file that canbase explain, export and replay read. With --seconds it does so after that
    time, or at Ctrl-C. One recording at a time, at most one in 5 s; the newest black_box.files are kept. The robot is
    not affected. Topics alone: ros2 bag record.

    Exit codes: 0 recorded, 1 nothing was recorded or the file could not be written, 2 wrong command line, 6 no motor
    driver.
    """
    if out is not None:
        _check(out)
    with Caller(ctx, namespace, FIND_S) as caller:
        caller.need_driver(SERVICE)
        if seconds is not None:
            _wait(seconds)
        path = Path(caller.call(SERVICE))
    if out is None:
        typer.echo(path)
    else:
        _copy(path, out)
        typer.echo(out)


def _check(out: Path) -> None:
    if out.suffix != ".asc":
        fail(f"--output {out}: its name must end with .asc; the .json file is written beside it", WRONG_INPUT)
    for each in (out.with_suffix(suffix) for suffix in SUFFIXES):
        if each.exists() or each.is_symlink():
            fail(f"{each} exists already", WRONG_INPUT)


def _wait(seconds: float) -> None:
    """Until the time is over, or until a signal: then the recording is written at once."""
    ended = end_signals()
    until_s = time.monotonic() + seconds
    while not ended and time.monotonic() < until_s:
        time.sleep(min(SLICE_S, max(0.0, until_s - time.monotonic())))


def _copy(path: Path, out: Path) -> None:
    """Regular files of the black box alone."""
    from canbase_doctor.careful_read import read_end

    if not path.is_absolute() or _NAME.fullmatch(path.name) is None:
        fail(f"the motor driver answered {printable(path)!r}, which is no recording", FAILED)
    try:
        for suffix in SUFFIXES:
            _, content = read_end(path.with_suffix(suffix), MOST_BYTES)
            with out.with_suffix(suffix).open("xb") as file:
                file.write(content)
    except OSError as error:
        fail(f"the motor driver has written {path}; it cannot be copied to {out}: {error.strerror or error}", FAILED)
