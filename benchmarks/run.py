"""All benchmarks, or those that are named, against the budgets: `python benchmarks/run.py [NAME …] [--write FILE]`."""

from __future__ import annotations

import argparse
import io
import os
import platform
import sys
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path

from rich.console import Console
from rich.table import Table

import boot
import cycle
import intake
import latency
import reaction
import startup
import stop_service
import virtual_time
from figures import Figure

BENCHMARKS: dict[str, Callable[[], list[Figure]]] = {
    "reaction": reaction.measure,
    "intake": intake.measure,
    "cycle": cycle.measure,
    "latency": latency.measure,
    "stop": stop_service.measure,
    "startup": startup.measure,
    "boot": boot.measure,
    "virtual_time": virtual_time.measure,
}
COLUMNS = ("what", "measured", "beside it, in the same run", "ratio", "budget", "kept")

BEGIN, END = "<!-- make bench: begin -->", "<!-- make bench: end -->"


def main() -> int:
    """Exit code 0: every budget is kept."""
    parser = argparse.ArgumentParser(prog="benchmarks/run.py", description="measured, beside a floor, against a budget")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"some of {', '.join(BENCHMARKS)}; all without")
    parser.add_argument("--write", type=Path, metavar="FILE", help="write the table into docs/performance.md")
    parser.add_argument("--list", action="store_true", help="list them and what they measure, run none")
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.names) - set(BENCHMARKS))
    if unknown:
        parser.error(f"there is no benchmark {', '.join(unknown)}; expected some of {', '.join(BENCHMARKS)}")
    if arguments.list:
        print("\n".join(f"{name:14}{_purpose(BENCHMARKS[name])}" for name in arguments.names or BENCHMARKS))
        return 0
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    figures = _measured(arguments.names or list(BENCHMARKS))
    Console(width=None if sys.stdout.isatty() else 160).print(_table(figures))
    if arguments.write:
        text = arguments.write.read_text(encoding="utf-8")
        arguments.write.write_text(rewritten(text, figures), encoding="utf-8")
    return 0 if all(figure.kept for figure in figures) else 1


def _measured(names: list[str]) -> list[Figure]:
    """The figures of these benchmarks, one after the other; on stderr which one runs, and how long each took."""
    figures: list[Figure] = []
    for number, name in enumerate(names, 1):
        print(f"[{number}/{len(names)}] {name} … ", end="", file=sys.stderr, flush=True)
        started_s = time.monotonic()
        with redirect_stdout(io.StringIO()):  # what the processes of a robot have said
            figures += BENCHMARKS[name]()
        print(f"{time.monotonic() - started_s:.0f} s", file=sys.stderr, flush=True)
    return figures


def _purpose(measure: Callable[[], list[Figure]]) -> str:
    """The first line of its file."""
    return (sys.modules[measure.__module__].__doc__ or "").partition("\n")[0]


def cells(figure: Figure) -> tuple[str, ...]:
    """A figure as text."""
    ratio = "–" if figure.ratio is None else f"{figure.ratio:.2f}"
    kept = "–" if figure.budget == "–" else "yes" if figure.kept else "**no**"
    return figure.what, figure.measured, figure.beside, ratio, figure.budget, kept


def _table(figures: list[Figure]) -> Table:
    table = Table(*COLUMNS)
    for figure in figures:
        table.add_row(*cells(figure), style=None if figure.kept else "red")
    return table


def rewritten(text: str, figures: list[Figure]) -> str:
    """`text` with the table between BEGIN and END. Raises ValueError when these lines are not there."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"the file has no lines {BEGIN} and {END}: between them the table is written")
    processors = f"{os.cpu_count()} processors ({platform.machine()}), Python {platform.python_version()}"
    lines = [f"| {' | '.join(cells(figure))} |" for figure in figures]
    head = f"| {' | '.join(COLUMNS)} |\n|---|---|---|---:|---|---|"
    return "\n".join((f"{before}{begin}", f"{processors}, the virtual bus:\n", head, *lines, f"{end}{after}"))


if __name__ == "__main__":
    sys.exit(main())
