"""Results of the matrix as a table for the terminal and as the page docs/stop_times.md."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from exit_matrix.layers import ALLOWANCE_S
from exit_matrix.runner import Result
from exit_matrix.scene import SPEED_MPS

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


def page(results: Sequence[Result]) -> str:
    """docs/stop_times.md."""
    lines = [f"| {' | '.join(cells(result))} |" for result in results]
    head = f"| {' | '.join(COLUMNS)} |\n|{'---|' * LEFT}{'---:|' * (len(COLUMNS) - LEFT)}"
    rows = "\n".join(lines)
    return f"""# Stop times: every way out, measured

Written by `make exit-matrix`. Each row is a whole robot of real processes on a virtual bus, with the timeouts of the
sample robot. It drives at {SPEED_MPS} m/s; then the failure is made to happen, and the simulator's ground truth tells
when the last wheel stood and how far the base had gone. A row passes when

- it stands within {ALLOWANCE_S} s + the timeout of the layer that caught it + the time to brake, all from robot.yaml
  (`virtual_bus_tests/exit_matrix/layers.py`);
- a layer that was expected to catch it says that it did (`rows.py` has the table);
- it stays at rest, also when a joystick orders motion (where the stop is latched or its cause stands), and also when
  what failed is repaired or goes on. Then a reset is given, and the robot has to drive the next row.

{head}
{rows}

The numbers are of one run on a virtual bus; those of a robot depend on its mass and drives. None of this is a
certified safety function: see [safety.md](safety.md).
"""
