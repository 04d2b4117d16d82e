"""Pages made of canbase_hazards/hazards.yaml: docs/hazards.md, a card for each, and the ten rows of docs/safety.md."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_hazards.catalogue import Braking, Catalogue, Part, Row
from canbase_hazards.formula import evaluate
from canbase_hazards.promise import worst_distance_m
from exit_matrix.page_table import NOTHING
from hazards.measured import longest_stop
from hazards.proofs import ROOT, stops
from support.marked_page import rewritten

PAGE = ROOT / "docs" / "safety.md"
"""Has the ten rows."""
CARDS_PAGE = ROOT / "docs" / "hazards.md"
"""Has the cards, and nothing else."""
COMMAND = "make hazards"
SAMPLE = "bench"
FIRST = (
    "driver_killed_or_hung",
    "watchdog_killed_or_hung",
    "computer_freezes",
    "cable_cut",
    "source_stale",
    "scan_or_estop_stale",
    "estop_pressed",
    "drive_fault",
    "drive_restarts",
    "encoder_lost_at_speed",
)
"""What an integrator asks about first."""
BRAKES = {
    Braking.RAMP: "driver's ramp",
    Braking.QUICK_STOP: "quick stop",
    Braking.COAST: "coasts",
    Braking.NONE: "",
}
TEN = """\
| failure | stopped by | acts within | braking, distance from {speed_mps} m/s | longest measured from 0.4 m/s |
|---|---|---|---|---|"""
CARDS = """\
# Hazards

Every failure that canbase has a rule for. `make hazards` writes this page from
`qualification/canbase_hazards/hazards.yaml`. [Safety](safety.md) has the limits of canbase. Everything here limits
damage; nothing here is a certified safety function.

- The first line is the failure; in italics the unsafe control action that it could cause; in brackets the hazard of
  STPA.
- **Must hold**: the constraint that prevents the hazard. **Detected by**: the component that enforces it.
- **Acts within**: the time from the failure until that component acts, for the sample robot of the bench, and its
  formula over robot.yaml. `stopping.…` is computed by `canbase_config/stopping.py`.
- **Stop**: what the component does, and the stop category of IEC 60204-1 that this resembles. The category describes
  the behaviour; it is not claimed.
- **Distance**: in that time at `limits.linear_mps`, and braking: by the driver's ramp (`limits.deceleration_mps2`) or
  by the drives' quick stop (`limits.emergency_deceleration_mps2`). Add the jerk limit and the delays of your drives.
- **Measured**: the longest stop from 0.4 m/s in [stop times](stop_times.md).
- **Proof**: `matrix` is a row of `make exit-matrix`, `virtual robot` a scenario of `make vm-test`. The other names are
  tests below `virtual_bus_tests/`. A hazard whose test does not exist, is skipped or fails breaks the build.
"""


def sample_robot() -> Robot:
    """The robot of the bench, whose numbers the pages show beside each formula."""
    return load_robot(sample(SAMPLE)).robot


def pages(catalogue: Catalogue) -> dict[Path, str]:
    """Both pages, up to date."""
    robot, safety = sample_robot(), PAGE.read_text(encoding="utf-8")
    return {PAGE: rewritten(safety, COMMAND, ten_rows(catalogue, robot)), CARDS_PAGE: cards(catalogue, robot)}


def out_of_date(made: Mapping[Path, str]) -> list[str]:
    """The pages that have another text now."""
    return [str(path.relative_to(ROOT)) for path, text in made.items() if path.read_text(encoding="utf-8") != text]


def ten_rows(catalogue: Catalogue, robot: Robot) -> str:
    """The table of docs/safety.md."""
    rows = {row.id: row for row in catalogue.rows}
    head = TEN.format(speed_mps=robot.limits.linear_mps)
    return "\n".join([head, *(_line(rows[row_id], robot) for row_id in FIRST)])


def cards(catalogue: Catalogue, robot: Robot) -> str:
    """The page docs/hazards.md: a heading for each part of a robot, below it one for each hazard."""
    linked = _linked(catalogue)
    parts = [CARDS]
    for part in Part:
        rows = [row for row in catalogue.rows if row.part is part]
        parts += [f"## {part.heading}\n", *(card(row, robot, linked) for row in rows)]
    return "\n".join(parts)


def _linked(catalogue: Catalogue) -> Callable[[str], str]:
    """Makes links of the ids of rows within a text."""
    ids = sorted((row.id for row in catalogue.rows if "_" in row.id), key=len, reverse=True)
    name = re.compile(rf"\b({'|'.join(ids)})\b")
    return lambda text: name.sub(lambda found: f"[{found[1]}](#{anchor(found[1])})", text)


def anchor(row_id: str) -> str:
    """The heading of a card, as links name it."""
    return row_id.replace("_", "-")


def card(row: Row, robot: Robot, linked: Callable[[str], str]) -> str:
    """One hazard."""
    heading = row.id.replace("_", " ").capitalize()
    first = f"{row.failure} *{row.unsafe_control_action}* ({row.hazard.value.replace('_', ' ')})"
    lines = (f"- **{name}:** {text}" for name, text in _facts(row, robot, linked) if text)
    return "\n".join([f"### {heading}", "", first, "", *lines, ""])


def _facts(row: Row, robot: Robot, linked: Callable[[str], str]) -> Iterator[tuple[str, str]]:
    stop = longest_stop(row, stops())
    yield "Must hold", linked(row.constraint)
    yield "Detected by", row.layer
    yield "Acts within", f"{_time(row, robot)}, `{row.within_s}`" if row.within_s else ""
    yield "Stop", f"{row.reaction}{_category(row)}"
    yield "Distance", _distance(row, robot)
    yield "Measured", f"{stop.cell} ({stop.name}, {stop.source})" if stop else ""
    yield "Not covered", linked(row.not_covered)
    yield "Proof", "; ".join(f"`{name}`" if ".py" in name else name for name in row.tests)


def _line(row: Row, robot: Robot) -> str:
    stop = longest_stop(row, stops())
    cells = (
        f"[{row.failure.rstrip('.')}](hazards.md#{anchor(row.id)})",
        row.layer,
        _time(row, robot) or NOTHING,
        _distance(row, robot) or NOTHING,
        stop.cell if stop else NOTHING,
    )
    return f"| {' | '.join(cells)} |"


def _time(row: Row, robot: Robot) -> str:
    return f"{evaluate(row.within_s, robot):.2f} s" if row.within_s else ""


def _distance(row: Row, robot: Robot) -> str:
    distance_m = worst_distance_m(row, robot)
    known = (BRAKES[row.braking], "" if distance_m is None else f"{distance_m:.2f} m")
    return ", ".join(filter(None, known))


def _category(row: Row) -> str:
    return "" if row.stop_category == "none" else f" (like stop category {row.stop_category})"
