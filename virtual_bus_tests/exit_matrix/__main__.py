"""The whole matrix: `python -m exit_matrix [--only TEXT] [--write FILE]`. Exit code 0: every row passed."""

from __future__ import annotations

import argparse
import io
import os
import sys
import tempfile
from contextlib import redirect_stdout
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from exit_matrix.failures import ROWS, Row
from exit_matrix.report import merged, table
from exit_matrix.runner import Result, Runner
from exit_matrix.stop_table import COMMANDS
from support.marked_page import rewritten, section

WIDTH = 140
"""Of the table where the width of the terminal is unknown."""

PRIORITY = 25
"""Below the processes of the chain (`canbase_cli.raise_priority`)."""


def main() -> int:
    """Runs the rows and prints them."""
    parser = argparse.ArgumentParser(prog="exit_matrix", description="every way out stops the robot, measured")
    parser.add_argument("--only", metavar="TEXT", default="", help="rows with this in their name")
    parser.add_argument("--write", type=Path, metavar="FILE", help="put the rows that passed into its table")
    arguments = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    _raise_priority()
    rows = [row for row in ROWS if arguments.only in row.name]
    console = Console(file=sys.stdout, width=None if sys.stdout.isatty() else WIDTH)
    said = io.StringIO()
    with redirect_stdout(said):
        results = _run(rows, console)
    console.print(table(results))
    failed = [result for result in results if result.problem]
    for result in failed:
        console.print(f"[red]{result.row.name}[/red]: {result.problem}", soft_wrap=True)
    console.print(f"{len(results)} rows, {len(failed)} failed")
    if failed:
        log = Path(tempfile.gettempdir()) / "canbase_exit_matrix.log"
        log.write_text(said.getvalue(), encoding="utf-8")
        console.print(f"what the processes said: {log}", soft_wrap=True)
    if arguments.write:
        page, passed = arguments.write.read_text(encoding="utf-8"), [result for result in results if not result.problem]
        table_text = merged(section(page, COMMANDS), passed)
        arguments.write.write_text(rewritten(page, COMMANDS, table_text), encoding="utf-8")
    return 1 if failed or not results else 0


def _raise_priority() -> None:
    """This process stands in for scanner, joystick and stop button: a loaded computer must not delay them.

    Its children start without it, and those of the chain see to themselves.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except OSError as error:
        print(f"no real-time priority ({error}): on a loaded computer rows may fail for the tests' own lateness")


def _run(rows: list[Row], console: Console) -> list[Result]:
    results = []
    with Runner() as runner, Progress(console=console, redirect_stdout=True) as progress:
        task = progress.add_task("", total=len(rows))
        for row in rows:
            progress.update(task, description=row.name)
            results.append(runner.run(row))
            progress.advance(task)
            if not console.is_terminal:
                console.print(f"{row.name}: {results[-1].problem or 'ok'}", soft_wrap=True)
    return results


if __name__ == "__main__":
    sys.exit(main())
