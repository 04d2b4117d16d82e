"""`canbase record start` without --mcap: the motor driver writes what its black box has of the last seconds."""

from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Final

import typer

from canbase_cli.end_signals import end_signals
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


def record_black_box(ctx: typer.Context, seconds: float | None, out: Path | None, namespace: str) -> None:
    """Finds the driver, waits, requests, copies."""
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
        fail(f"--out {out}: its name must end with .asc; the .json file is written beside it", WRONG_INPUT)
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
