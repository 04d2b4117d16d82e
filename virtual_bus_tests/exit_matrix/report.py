"""Results of the matrix as a table for the terminal and for docs/stop_times.md."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from exit_matrix.layers import ALLOWANCE_S, SPEED_MPS
from exit_matrix.runner import Result

COLUMNS = ("what", "how", "who caught it", "stood after", "way", "limit")
LEFT = 3
"""So many columns are text."""


def table(results: Sequence[Result]) -> Table:
    """For the terminal; rows that failed are red."""
    made = Table()
    for number, column in enumerate(COLUMNS):
        made.add_column(column, justify="left" if number < LEFT else "right")
    for result in results:
        made.add_row(*cells(result), style="red" if result.problem else None)
    return made


def cells(result: Result) -> tuple[str, ...]:
    """The row as text: times in s, the way in mm."""
    caught = ", ".join(f"{who}: {cause}" for who, cause in result.caught) or "–"
    if result.stop is None:
        return result.row.what, result.row.how, caught, "–", "–", "–"
    times = f"{result.stop.after_s:.2f} s", f"{result.stop.way_m * 1000.0:.0f} mm", f"{result.limit_s:.2f} s"
    return result.row.what, result.row.how, caught, *times


def section(results: Sequence[Result]) -> str:
    """The part of docs/stop_times.md that `make exit-matrix` writes."""
    head = f"| {' | '.join(COLUMNS)} |\n|{'---|' * LEFT}{'---:|' * (len(COLUMNS) - LEFT)}"
    rows = "\n".join(f"| {' | '.join(cells(result))} |" for result in results)
    return f"Driven at {SPEED_MPS} m/s, {ALLOWANCE_S} s of allowance.\n\n{head}\n{rows}"
