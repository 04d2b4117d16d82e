"""`canbase print sample`: a robot.yaml that comes with canbase, to start one's own from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from canbase_runtime.terminal import WRONG_INPUT, fail


def _names() -> list[str]:
    from canbase_config.load import samples

    return samples()


def sample(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME", help="Name of the sample.", show_default="list the names", autocompletion=_names
        ),
    ] = None,
) -> None:
    """Print a sample robot.yaml, for example: canbase print sample bench > robot.yaml

    Exit codes: 0 printed, 2 there is no such sample.
    """
    from canbase_config.load import sample as path_of

    if name is None:
        typer.echo("\n".join(_names()))
        return
    try:
        path: Path = path_of(name)
    except ValueError as error:
        fail(str(error), WRONG_INPUT)
    typer.echo(path.read_text(encoding="utf-8"), nl=False)
