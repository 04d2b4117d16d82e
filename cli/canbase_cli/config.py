"""`canbase config`: what a robot.yaml says and what is wrong with it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from canbase_cli.options import colour, load_config

app = typer.Typer(help="Look at a robot.yaml.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Look at a robot.yaml."""


@app.command()
def check(
    file: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="The robot.yaml.", show_default="the bench sample")
    ] = None,
) -> None:
    """Check FILE and print the whole configuration that it stands for, the defaults marked.

    What is printed is a robot.yaml itself. Exit code 0: FILE can be used. 2: all its problems are on stderr.
    """
    from canbase_config.effective import DEFAULT_MARK, effective

    loaded = load_config(file)
    for line in effective(loaded).splitlines():
        typer.secho(line, dim=line.endswith(f"# {DEFAULT_MARK}"), color=colour())
    counts = f"{len(loaded.given)} values from the file, {len(loaded.defaults)} defaults"
    typer.secho(f"{loaded.path} is good: {counts}", err=True, fg=typer.colors.GREEN, color=colour())
