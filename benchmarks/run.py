"""All benchmarks, or those that are named, against the budgets: `python benchmarks/run.py [NAME …] [--write FILE]`."""

from __future__ import annotations

import argparse
import io
import os
import platform
import sys
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
    arguments = parser.parse_args()
    unknown = sorted(set(arguments.names) - set(BENCHMARKS))
    if unknown:
        parser.error(f"there is no benchmark {', '.join(unknown)}; expected some of {', '.join(BENCHMARKS)}")
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    figures: list[Figure] = []
    for name in arguments.names or BENCHMARKS:
        print(f"{name} …", file=sys.stderr)
        with redirect_stdout(io.StringIO()):  # what the processes of a robot have said
            figures += BENCHMARKS[name]()
    Console(width=None if sys.stdout.isatty() else 160).print(_table(figures))
    if arguments.write:
        text = arguments.write.read_text(encoding="utf-8")
        arguments.write.write_text(rewritten(text, figures), encoding="utf-8")
    return 0 if all(figure.kept for figure in figures) else 1


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
