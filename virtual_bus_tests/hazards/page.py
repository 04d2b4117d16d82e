"""The tables of docs/safety.md, made of canbase_hazards/hazards.yaml. What stands around them is written by hand."""

from __future__ import annotations

from collections.abc import Iterator

from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_hazards.catalogue import Braking, Catalogue, Hazard, Part, Row
from canbase_hazards.formula import evaluate
from canbase_hazards.promise import worst_distance_m
from exit_matrix.page_table import NOTHING
from hazards.measured import longest_stop
from hazards.proofs import ROOT, stops

PAGE = ROOT / "docs" / "safety.md"
COMMAND = "make hazards"
SAMPLE = "bench"
BRAKES = {
    Braking.RAMP: "driver's ramp",
    Braking.QUICK_STOP: "quick stop",
    Braking.COAST: "coasts",
    Braking.NONE: "–",
}
HEAD = """| failure | must hold | component | acts within | braking, distance | measured at 0.4 m/s | reaction | proof |
|---|---|---|---|---|---|---|---|"""


def sample_robot() -> Robot:
    """The robot of the bench, whose numbers the page shows beside each formula."""
    return load_robot(sample(SAMPLE)).robot


def tables(catalogue: Catalogue, robot: Robot) -> str:
    """All tables, and after them what the rows do not cover."""
    parts = [_table(part, [row for row in catalogue.rows if row.part is part], robot) for part in Part]
    return "\n\n".join([*(part for part in parts if part), _gaps(catalogue)])


def _table(part: Part, rows: list[Row], robot: Robot) -> str:
    if not rows:
        return ""
    return "\n".join([f"## {part.heading}", "", HEAD, *(_line(row, robot) for row in rows)])


def _line(row: Row, robot: Robot) -> str:
    cells = (
        f'<a id="{row.id}"></a>{row.failure} *{row.unsafe_control_action}* ({_words(row.hazard)})',
        row.constraint,
        row.layer,
        _time(row, robot),
        _distance(row, robot),
        _measured(row),
        f"{row.reaction} {_category(row)}",
        "<br>".join(f"`{name}`" if name.endswith(".py") or "::" in name else name for name in row.tests),
    )
    return f"| {' | '.join(cell.replace('|', '∣') for cell in cells)} |"


def _time(row: Row, robot: Robot) -> str:
    if not row.within_s:
        return "–"
    return f"`{row.within_s}` = {evaluate(row.within_s, robot):.2f} s"


def _distance(row: Row, robot: Robot) -> str:
    distance_m = worst_distance_m(row, robot)
    return BRAKES[row.braking] if distance_m is None else f"{BRAKES[row.braking]}, {distance_m:.2f} m"


def _measured(row: Row) -> str:
    stop = longest_stop(row, stops())
    return NOTHING if stop is None else f"{stop.cell}: {stop.name}, {stop.source}"


def _category(row: Row) -> str:
    return "" if row.stop_category == "none" else f"(like stop category {row.stop_category})"


def _words(hazard: Hazard) -> str:
    return hazard.value.replace("_", " ")


def _gaps(catalogue: Catalogue) -> str:
    return "\n".join(["## What these rows do not cover", "", *_gap_lines(catalogue)])


def _gap_lines(catalogue: Catalogue) -> Iterator[str]:
    for row in catalogue.rows:
        if row.not_covered:
            yield f"- **{row.failure.rstrip('.')}**: {row.not_covered}"
