"""`python -m campaign.worst`: the worst speed, turn, load and moment of each failure, searched for in virtual time.

docs/stop_times.md has each failure at one speed. The worst case of a failure often lies just below a threshold of what
detects it, at a speed that no table has. A coarse grid over all speeds, turns and loads, then CMA-ES from its worst.
Exit code 1: a base did not stop.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import sys
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Final

from rich.console import Console

from canbase_campaign.cruise import JOYSTICK_S, Cruise, Run
from canbase_campaign.robots import DrawnRobot, campaign_robot
from canbase_campaign.twins import JOYSTICK, MEASURED, TWINS, Twin
from canbase_config.robot import Robot
from canbase_config.stopping import longest_ramp_s, max_wheel_mps
from canbase_hazards.catalogue import load
from canbase_hazards.stated_times import stated_s
from canbase_qualification.hazard_figures import faults_of
from canbase_sim.plant.base import PlantParameters
from support.marked_page import rewritten

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # that it cannot plot
    import cma  # type: ignore[import-untyped]

COMMAND: Final = "make worst"
ROWS_COMMAND: Final = "make worst ROWS=1"
SEARCHED: Final = (
    "encoder: lost",
    "encoder: frozen",
    "motor_driver: repeats",
)
"""The failures that are searched, by the begin of their name: those whose time depends on a threshold of speed."""
LINEAR, TURN, LOADS = (0.0, 0.15, 0.3, 0.6, 1.0), (-1.0, -0.5, 0.0, 0.5, 1.0), (1.0, 2.0)
"""The grid: shares of both limits, and multiples of the mass of the empty robot."""
OF_GOALS: Final = ("drive_distance_server", "client", "odometry")
"""A base that the joystick drives does not notice them."""
CORNERS: Final = ((1.0, 0.0, 2.0), (0.125, 1.0, 2.0), (0.3, -0.5, 1.0))
"""Of the rows: full speed and almost in place, with a load; and a slow curve, whose inner wheel is near standstill."""
SIGMA, LEAST_STEP = 0.08, 1.0 / 64.0
"""Of the search, in shares of the limits: how far it looks at first, and how finely."""
OPTIONS: Final = {
    "bounds": [[0.0, -1.0, 0.0], [1.0, 1.0, 1.0]], "maxfevals": 160, "popsize": 10, "seed": 127, "verbose": -9,
    "tolx": LEAST_STEP / 4.0, "tolflatfitness": 6,
}  # fmt: skip
"""Of cma: within the limits, and the same each time."""
STARTS = 2
"""One hill of several need not be the highest."""
SEEDS = 2
"""Moments and wheels of each point."""


@cache
def _robot() -> Robot:
    return campaign_robot()


@dataclass(frozen=True, slots=True)
class Point:
    """Where a failure begins: shares of limits.linear_mps and limits.angular_radps, and the load."""

    linear: float
    turn: float
    load: float = 1.0

    @property
    def is_possible(self) -> bool:
        """Within the limits, moving, and no wheel faster than the driver lets it be."""
        robot = _robot()
        if not (0.0 <= self.linear <= 1.0 and -1.0 <= self.turn <= 1.0 and (self.linear or self.turn)):
            return False
        return self.wheel_mps <= max_wheel_mps(robot) * (1.0 + 1e-9)

    @property
    def wheel_mps(self) -> float:
        """Of the faster wheel's rim."""
        robot = _robot()
        turning_mps = abs(self.turn) * robot.limits.angular_radps * robot.base.track_m / 2.0
        return self.linear * robot.limits.linear_mps + turning_mps

    def __str__(self) -> str:
        limits = _robot().limits
        load = "" if self.load == 1.0 else f", load {self.load:g} ×"
        return f"{self.linear * limits.linear_mps:.2f} m/s, {self.turn * limits.angular_radps:+.2f} rad/s{load}"


@dataclass(frozen=True, slots=True)
class Found:
    """The greatest value, and where. `reported`: of a time, that a component reports the stop; else of standstill."""

    value: float
    point: Point
    reported: bool = True


def grid() -> list[Point]:
    """The coarse one, of what is possible."""
    points = (Point(linear, turn, load) for load in LOADS for linear in LINEAR for turn in TURN)
    return [point for point in points if point.is_possible]


def worst(value: Callable[[Point], float], start: Iterable[Point]) -> Found:
    """The greatest `value` that CMA-ES finds from each of the STARTS worst points of `start`; the same each time.

    An evolution strategy takes cliffs as they come: the worst case of a failure often lies just below one.
    """
    ordered = sorted((Found(value(point), point) for point in start), key=lambda found: found.value, reverse=True)
    return max((_evolved(value, found) for found in ordered[:STARTS]), key=lambda found: found.value)


def _evolved(value: Callable[[Point], float], best: Found) -> Found:
    at = [best.point.linear, best.point.turn, (best.point.load - LOADS[0]) / (LOADS[-1] - LOADS[0])]
    search = cma.CMAEvolutionStrategy(at, SIGMA, OPTIONS)
    while not search.stop():
        drawn = search.ask()
        found = [_valued(value, *each) for each in drawn]
        search.tell(drawn, [-each.value for each in found])
        best = max(best, *found, key=lambda each: each.value)
    return best


def _valued(value: Callable[[Point], float], linear: float, turn: float, load: float) -> Found:
    """Of a point that the robot may drive, rounded as the page prints it; of any other one the least that there is."""
    point = Point(_rounded(linear), _rounded(turn), LOADS[0] + _rounded(load, 0.25) * (LOADS[-1] - LOADS[0]))
    return Found(value(point) if point.is_possible else 0.0, point)


def _rounded(share: float, step: float = LEAST_STEP) -> float:
    return round(share / step) * step


@cache
def _cruise(point: Point) -> Cruise:
    robot = _robot()
    drawn = DrawnRobot(0, robot, PlantParameters(payload_factor=point.load))
    limits = robot.limits
    return Cruise(JOYSTICK, point.linear * limits.linear_mps, drawn, point.turn * limits.angular_radps)


@cache
def runs(twin: Twin, point: Point) -> tuple[Run, ...]:
    """Of `SEEDS` moments and wheels."""
    return tuple(_cruise(point).fork(twin, seed) for seed in range(SEEDS))


MEASURES: Final[dict[str, tuple[str, Callable[[Run], float]]]] = {
    "longest time": ("{:.2f} s", lambda run: run.time_s),
    "longest distance": ("{:.0f} mm", lambda run: run.distance_m * 1000.0),
    "fastest wheel": ("{:.2f} m/s", lambda run: run.peak_mps),
}


def searched(twin: Twin) -> dict[str, Found]:
    """The worst of each measure."""

    visited: dict[Point, tuple[Run, ...]] = {}

    def value_of(measure: Callable[[Run], float]) -> Callable[[Point], float]:
        def value(point: Point) -> float:
            visited[point] = runs(twin, point)
            return max(measure(run) for run in visited[point])

        return value

    for _, measure in MEASURES.values():
        worst(value_of(measure), grid())
    return {name: _greatest(visited, measure) for name, (_, measure) in MEASURES.items()}


def _greatest(visited: dict[Point, tuple[Run, ...]], measure: Callable[[Run], float]) -> Found:
    """Of all points: the search for one measure may meet the worst of another."""
    return max(
        (Found(max(measure(run) for run in each), point) for point, each in visited.items()),
        key=lambda found: found.value,
    )


def twins(only: str) -> list[Twin]:
    """The failures that are searched, with `only` in their name."""
    named = ((f"{twin.what}: {twin.how}", replace(twin, by=JOYSTICK)) for twin in TWINS)
    return [twin for name, twin in named if name.startswith(SEARCHED) and only in name]


def _searched(name: str) -> dict[str, Found]:
    (twin,) = twins(name)
    return searched(twin)


def _driven() -> dict[str, Twin]:
    """Failures of a base that the joystick drives, by name; those that only a goal knows are not among them."""
    twins = (replace(twin, by=JOYSTICK) for twin in MEASURED if twin.what not in OF_GOALS)
    return {": ".join(twin.key): twin for twin in twins}


def stated_rows(only: str = "") -> list[tuple[str, str]]:
    """Each row of hazards.yaml with a stated time, and each of its failures that a driving base can have here."""
    failures, rows = _driven(), load().rows
    pairs = ((row.id, name) for row in rows for name in faults_of(row) if row.within_s and name in failures)
    return [(row, name) for row, name in pairs if only in f"{row} {name}"]


def latest(name: str) -> Found:
    """The longest time until a component reports that it stops the base, or the base stands, at the CORNERS."""
    twin, points = _driven()[name], [Point(*corner) for corner in CORNERS]
    runs_of = [(_cruise(point).fork(twin, seed=0), point) for point in points]
    found = (Found(min(run.acts_s, run.time_s), point, math.isfinite(run.acts_s)) for run, point in runs_of)
    return max(found, key=lambda each: each.value)


def rows_table(found: dict[tuple[str, str], Found]) -> str:
    """For the page: what the row states, and the worst that was found."""
    lines = ["| row | failure | stated | worst found |", "|---|---|---|---|"]
    for (row, name), worst_found in found.items():
        row_s = stated_s(row, _robot()) + JOYSTICK_S * ("then zero" in name)
        ramp_s = 0.0 if worst_found.reported else longest_ramp_s(_robot())
        beyond = "**" if worst_found.value > row_s + ramp_s else ""
        stands = "" if worst_found.reported or worst_found.value == math.inf else ", at standstill"
        value = f"{worst_found.value:.2f} s" if worst_found.value < math.inf else "no stop"
        cell = f"{beyond}{value}{beyond}{stands} at {worst_found.point}"
        lines.append(f"| {row} | {name} | {row_s:.2f} s | {cell} |")
    return "\n".join(lines)


def table(rows: dict[str, dict[str, Found]]) -> str:
    """For the page."""
    lines = [f"| failure | {' | '.join(MEASURES)} |", f"|---|{'---|' * len(MEASURES)}"]
    for name, row in rows.items():
        cells = (f"{MEASURES[key][0].format(found.value)} at {found.point}" for key, found in row.items())
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> int:
    """Search; with --write put the table into a page, between its marks."""
    parser = argparse.ArgumentParser(prog="campaign.worst", description=__doc__)
    parser.add_argument("--only", default="", help="failures with this in their name")
    parser.add_argument("--rows", action="store_true", help="all rows of hazards.yaml, at the corners alone")
    parser.add_argument("--write", type=Path, help="the page; not with --only")
    given = parser.parse_args()
    if given.only and given.write:
        parser.error("a page has all failures")
    if given.rows:
        return _rows(given.only, given.write)
    rows: dict[str, dict[str, Found]] = {}
    out = Console(soft_wrap=True, highlight=False, markup=False)
    names = [f"{twin.what}: {twin.how}" for twin in twins(given.only)]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for name, row in zip(names, pool.imap(_searched, names), strict=True):
            rows[name] = row
            out.print(table(rows).splitlines()[-1])
    if given.write:
        page = given.write.read_text(encoding="utf-8")
        given.write.write_text(rewritten(page, COMMAND, table(rows)), encoding="utf-8")
    return 0 if all(math.isfinite(found.value) for row in rows.values() for found in row.values()) else 1


def _rows(only: str, page: Path | None) -> int:
    pairs = stated_rows(only)
    names = list(dict.fromkeys(name for _, name in pairs))
    found: dict[str, Found] = {}
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for name, each in zip(names, pool.imap(latest, names), strict=True):
            found[name] = each
            print(f"{name}: {each.value:.2f} s at {each.point}", flush=True)
    text = rows_table({(row, name): found[name] for row, name in pairs})
    if page is None:
        print(text)
    else:
        page.write_text(rewritten(page.read_text(encoding="utf-8"), ROWS_COMMAND, text), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
