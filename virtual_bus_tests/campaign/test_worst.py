"""The search for the worst speed, turn and load of a failure; and the worst points that it found."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from campaign.worst import (
    COMMAND,
    CORNERS,
    LEAST_STEP,
    ROWS_COMMAND,
    SEARCHED,
    Found,
    Point,
    grid,
    latest,
    rows_table,
    runs,
    stated_rows,
    twins,
    worst,
)
from support.marked_page import section

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(600)]
PAGE = Path(__file__).parents[2] / "docs" / "stop_times.md"


@pytest.mark.parametrize("threshold", [0.05, 0.2, 0.31, 0.5, 0.77, 1.0])
def test_a_value_that_is_worst_just_below_a_threshold_is_found_between_the_points_of_the_grid(threshold: float) -> None:
    def value(point: Point) -> float:
        return 1.0 + point.linear if point.linear <= threshold else 0.5 * point.linear

    found = worst(value, grid())
    assert threshold - 1.5 * LEAST_STEP <= found.point.linear <= threshold


def test_a_lower_hill_that_the_grid_meets_first_does_not_hide_the_higher_one() -> None:
    def value(point: Point) -> float:
        narrow = 3.0 - 10.0 * math.hypot(point.linear - 0.45, point.turn + 0.1)
        return max(1.0 - abs(point.turn - 1.0) / 4.0, narrow)

    assert worst(value, grid()).value > 2.8


def test_every_point_is_one_that_the_robot_may_drive() -> None:
    assert all(point.is_possible for point in grid())
    assert {point.load for point in grid()} == {1.0, 2.0}
    for point in (Point(0.0, 0.0), Point(1.01, 0.0), Point(-0.1, 0.5), Point(0.5, 1.1), Point(1.0, 1.0)):
        assert not point.is_possible, point


def test_the_page_has_the_worst_of_each_failure_that_is_searched() -> None:
    rows = [line for line in section(PAGE.read_text(encoding="utf-8"), COMMAND).splitlines() if line.startswith("| ")]
    assert [row.split(" | ")[0][2:] for row in rows[1:]] == [f"{twin.what}: {twin.how}" for twin in twins("")]
    assert len(twins("")) == len(SEARCHED)
    assert not any("inf" in row or "nan" in row for row in rows)


def test_the_page_has_each_stated_time_beside_the_worst_that_was_found() -> None:
    """A new row with a failure that a driving base can have is missing on the page until it was searched."""
    lines = section(PAGE.read_text(encoding="utf-8"), ROWS_COMMAND).splitlines()[2:]
    on_page = [(line.split(" | ")[0].removeprefix("| "), line.split(" | ")[1]) for line in lines]
    assert on_page == stated_rows()


@pytest.mark.parametrize(
    "name", ["cmd_vel: another node publishes to it, then zero is commanded", "encoder: lost: nothing counts, no speed"]
)
def test_the_page_has_the_time_that_is_found_today(name: str) -> None:
    """Of two failures whose reaction depends on many rules; `make worst ROWS=1` writes all."""
    page = section(PAGE.read_text(encoding="utf-8"), ROWS_COMMAND)
    assert [
        line for line in rows_table({row: latest(name) for row in stated_rows(name)}).splitlines() if line not in page
    ] == []


def test_each_corner_is_one_that_the_robot_may_drive() -> None:
    assert all(Point(*corner).is_possible for corner in CORNERS)


def test_a_time_beyond_the_stated_one_is_marked() -> None:
    name, point = "motor_driver: SIGKILL", Point(1.0, 0.0)
    lines = [rows_table({("driver_killed_or_hung", name): Found(time_s, point)}) for time_s in (0.29, 0.31)]
    assert ["**" in line for line in lines] == [False, True]


def test_a_driver_that_is_killed_is_missed_in_the_stated_time() -> None:
    assert 0.1 < latest("motor_driver: SIGKILL").value <= 0.3


# just below the drop of a velocity that no wheel can do; and a loaded base on a curve, whose slower wheel is there
@pytest.mark.parametrize(
    ("point", "time_s", "distance_m", "peak_mps"),
    [
        (Point(0.3125, 0.0), 2.4, 0.62, 1.52),
        (Point(0.6, -0.625, 2.0), 3.46, 1.30, 1.52),
        (Point(0.63125, -0.5, 2.0), 3.46, 1.30, 1.52),
    ],
    ids=str,
)
def test_the_worst_of_a_lost_encoder_is_no_worse_than_stated(
    point: Point, time_s: float, distance_m: float, peak_mps: float
) -> None:
    (lost,) = twins("encoder: lost")
    found = runs(lost, point)
    assert max(run.time_s for run in found) <= time_s
    assert max(run.distance_m for run in found) <= distance_m
    assert max(run.peak_mps for run in found) <= peak_mps
