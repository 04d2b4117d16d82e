"""All benchmarks, or those that are named, against the budgets: `python benchmarks/run.py [NAME …] [--write FILE]`."""

from __future__ import annotations

import argparse
import io
import os
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from pathlib import Path

from rich.console import Console
from rich.table import Table

import boot
import chain
import cycle
import intake
import kept
import latency
import reaction
import startup
import stop_service
import virtual_time
from figures import Figure

BENCHMARKS: dict[str, Callable[[], list[Figure]]] = {
    "latency": latency.measure,
    "stop": stop_service.measure,
    "reaction": reaction.measure,
    "startup": startup.measure,
    "boot": boot.measure,
    "chain": chain.measure,
    "cycle": cycle.measure,
    "intake": intake.measure,
    "virtual_time": virtual_time.measure,
}
"""In the order of the table: what a user notices first."""
QUICK: dict[str, Callable[[], list[Figure]]] = {
    "boot": boot.measure,
    "virtual_time": virtual_time.quick,
    "chain": chain.quick,
}
"""Those that together take less than a minute."""
COLUMNS = ("what", "measured", "beside it, in the same run", "ratio", "budget", "kept")

BEGIN, END = "<!-- make bench: begin -->", "<!-- make bench: end -->"


def main() -> int:
    """Exit code 0: every budget is kept."""
    parser = argparse.ArgumentParser(prog="benchmarks/run.py", description="measured, beside a floor, against a budget")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"some of {', '.join(BENCHMARKS)}; all without")
    parser.add_argument("--write", type=Path, metavar="FILE", help="write the table into docs/performance.md")
    parser.add_argument("--quick", action="store_true", help=f"{', '.join(QUICK)} alone, in less than a minute")
    parser.add_argument("--json", type=Path, metavar="FILE", help="keep the figures in this file")
    parser.add_argument(
        "--compare",
        type=Path,
        metavar="FILE",
        help="name the ratios that are worse than in a file of --json",
    )
    parser.add_argument("--list", action="store_true", help="list them and what they measure, run none")
    arguments = parser.parse_args()
    there = QUICK if arguments.quick else BENCHMARKS
    unknown = sorted(set(arguments.names) - set(there))
    if unknown:
        parser.error(f"there is no benchmark {', '.join(unknown)}; expected some of {', '.join(there)}")
    if arguments.list:
        print("\n".join(f"{name:14}{_purpose(there[name])}" for name in arguments.names or there))
        return 0
    try:
        before = kept.ratios(arguments.compare) if arguments.compare else None
    except (OSError, ValueError) as error:
        parser.error(str(error))
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    figures = _measured({name: there[name] for name in arguments.names or there})
    Console(width=None if sys.stdout.isatty() else 160).print(_table(figures))
    if arguments.write:
        text = arguments.write.read_text(encoding="utf-8")
        arguments.write.write_text(rewritten(text, kept.machine(), figures), encoding="utf-8")
    if arguments.json:
        kept.write(arguments.json, figures)
    if before is not None:
        losses = kept.losses(figures, before)
        print(
            "\n".join(f"warning: {loss}" for loss in losses) or "no ratio is worse than before by more than its noise"
        )
        return 0
    return 0 if all(figure.kept for figure in figures) else 1


def _measured(chosen: Mapping[str, Callable[[], list[Figure]]]) -> list[Figure]:
    """The figures of these benchmarks, one after the other; on stderr which one runs, and how long each took."""
    figures: list[Figure] = []
    for number, (name, measure) in enumerate(chosen.items(), 1):
        print(f"[{number}/{len(chosen)}] {name} … ", end="", file=sys.stderr, flush=True)
        started_s = time.monotonic()
        with redirect_stdout(io.StringIO()):  # the output of the processes of a robot
            figures += measure()
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


def rewritten(text: str, machine: str, figures: list[Figure]) -> str:
    """`text` with the table between BEGIN and END. Raises ValueError when these lines are not there."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ValueError(f"the file has no lines {BEGIN} and {END}: between them the table is written")
    lines = [f"| {' | '.join(cells(figure))} |" for figure in figures]
    head = f"| {' | '.join(COLUMNS)} |\n|---|---|---|---:|---|---|"
    return "\n".join((f"{before}{begin}", f"{machine}, the virtual bus:\n", head, *lines, f"{end}{after}"))


if __name__ == "__main__":
    sys.exit(main())
