"""Results of the matrix as a table for the terminal and for docs/stop_times.md."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from exit_matrix.failures import ROWS
from exit_matrix.page_table import NOTHING, Rows
from exit_matrix.runner import Result
from exit_matrix.stop_table import REAL, TABLE

COLUMNS = ("what", "how", "who caught it", "stood after", "distance", "limit")
LEFT = 3
"""This many columns are text."""


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


def merged(before: str, results: Sequence[Result]) -> str:
    """The part of docs/stop_times.md that was `before`, with the columns of real processes measured again."""
    rows: Rows = {(result.row.what, result.row.how): _row(result) for result in results}
    return TABLE.merged(before, rows, [(row.what, row.how) for row in ROWS])


def _row(result: Result) -> dict[str, str]:
    _, _, caught, time, distance, limit = cells(result)
    return dict(zip(REAL, (caught, limit, NOTHING if result.stop is None else f"{time}, {distance}"), strict=True))
