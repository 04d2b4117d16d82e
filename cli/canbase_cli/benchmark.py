"""`canbase prove benchmark`: the benchmarks of the sources. An installation has none: they need the simulated robot."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import typer

import canbase_cli
from canbase_runtime.terminal import FAILED, fail


def benchmark(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]…", help="Benchmarks to run.", show_default="all")
    ] = None,
    list_them: Annotated[bool, typer.Option("--list", help="List them, run none.")] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Only the fast ones, in less than a minute.")] = False,
    ratios: Annotated[
        Path | None, typer.Option("--ratios", metavar="FILE", help="Keep the ratios in this file.")
    ] = None,
    compare: Annotated[
        Path | None,
        typer.Option("--compare", metavar="FILE", help="Name the ratios that are worse than in a file of --ratios."),
    ] = None,
    write: Annotated[Path | None, typer.Option("--write", metavar="FILE", help="Write the table as Markdown.")] = None,
) -> None:
    """Measure this computer: reaction times, latencies, processor load, each compared with its budget.

    Exit codes: 0 every budget is met, 1 one is not, or the sources are missing, 2 there is no such benchmark. With
    --compare: 0, whatever was measured.
    """
    root = Path(canbase_cli.__file__).resolve().parents[2]
    script = root / "benchmarks" / "run.py"
    if not script.exists():
        fail("the benchmarks come with the sources: clone the repository, and there `make bench`", FAILED)
    files = {"--write": write, "--json": ratios, "--compare": compare}
    options = [word for name, path in files.items() if path for word in (name, str(path.resolve()))]
    options += [name for name, chosen in {"--list": list_them, "--quick": quick}.items() if chosen]
    environment = os.environ | {"PYTHONPATH": str(root / "virtual_bus_tests")}
    command = [sys.executable, str(script), *(names or []), *options]
    raise typer.Exit(subprocess.call(command, env=environment, cwd=root))  # its children import from there at most
