"""Free way around a footprint of 0.4 m ahead, 0.2 m behind, 0.3 m left and 0.25 m right of base_link."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_config.safety import Footprint
from canbase_config.safety import Scan as ScanConfig
from canbase_velocity.clearance import FREE, ClearanceReader, Clearances, Scan, swept_radius_m

FOOTPRINT = Footprint(front_m=0.4, rear_m=0.2, left_m=0.3, right_m=0.25)
QUARTER_RAD = math.pi / 2
INF, NAN = math.inf, math.nan


def read(ranges_m: list[float], **changes: float) -> Clearances | None:
    """Clearances of beams 90° apart, the first to the rear, the second to the right, then ahead, then left."""
    geometry = {"angle_min_rad": -math.pi, "angle_increment_rad": QUARTER_RAD, "range_min_m": 0.05, "range_max_m": 10.0}
    pose = {key: changes.pop(key) for key in ("x_m", "y_m", "yaw_rad") if key in changes}
    reader = ClearanceReader(FOOTPRINT, ScanConfig.model_validate({"required": True, **pose}))
    return reader.read(Scan(ranges_m, **(geometry | changes)))


def points(*places_m: tuple[float, float]) -> Clearances:
    """Clearances of points in base_link, each seen by a beam of its own."""
    nearest = Clearances(INF, INF, INF)
    for x_m, y_m in places_m:
        seen = read([math.hypot(x_m, y_m)], angle_min_rad=math.atan2(y_m, x_m), range_min_m=0.0)
        assert seen is not None
        nearest = Clearances(
            min(nearest.ahead_m, seen.ahead_m),
            min(nearest.behind_m, seen.behind_m),
            min(nearest.around_m, seen.around_m),
        )
    return nearest


def approx(value: float) -> Any:
    return pytest.approx(value, abs=1e-9)


def test_ahead_and_behind_are_measured_from_the_edges_of_the_footprint() -> None:
    clearances = read([2.0, INF, 3.0, INF])
    assert clearances == Clearances(approx(2.6), approx(1.8), INF)


def test_nothing_seen_is_free() -> None:
    assert read([INF, INF, INF, INF]) == FREE


@pytest.mark.parametrize(
    ("y_m", "blocks"),
    [(0.2999, True), (0.3001, False), (-0.2499, True), (-0.2501, False), (0.0, True), (5.0, False)],
)
def test_only_the_corridor_of_the_footprint_counts(y_m: float, blocks: bool) -> None:
    assert (points((1.0, y_m)).ahead_m < INF) is blocks
    assert (points((-1.0, y_m)).behind_m < INF) is blocks


@pytest.mark.parametrize("y_m", [0.3, -0.25])
def test_a_point_exactly_on_the_edge_of_the_corridor_is_in_it(y_m: float) -> None:
    assert read([1.0], angle_min_rad=0.0, y_m=y_m) == Clearances(approx(0.6), INF, INF)


def test_a_point_ahead_is_not_behind_and_the_other_way_round() -> None:
    assert points((1.0, 0.0)) == Clearances(approx(0.6), INF, INF)
    assert points((-1.0, 0.0)) == Clearances(INF, approx(0.8), INF)


def test_a_point_inside_the_footprint_touches_it_on_its_half() -> None:
    assert points((0.39, 0.1)) == Clearances(0.0, INF, 0.0)
    assert points((-0.1, 0.1)) == Clearances(INF, 0.0, 0.0)
    assert read([1.0], angle_min_rad=0.0, x_m=-1.0) == Clearances(INF, 0.0, 0.0)  # exactly in the middle


def test_turning_sees_the_points_inside_the_swept_circle_by_their_distance_from_the_rectangle() -> None:
    assert swept_radius_m(FOOTPRINT) == approx(0.5)
    assert points((0.0, 0.45)).around_m == approx(0.15)  # beside it
    assert points((0.43, 0.0)).around_m == approx(0.03)  # ahead of it
    assert points((0.0, 0.501)).around_m == INF  # the corners pass it
    assert points((-0.23, 0.34)).around_m == approx(0.05)  # off the corner: 0.03 and 0.04


def test_the_pose_of_the_scanner_is_applied() -> None:
    # Mounted 0.3 m ahead and 0.1 m to the left, turned left by 90°: its beam ahead looks to the left of the base.
    clearances = read([INF, 1.0, INF, INF], x_m=0.3, y_m=0.1, yaw_rad=QUARTER_RAD)
    assert clearances == Clearances(approx(0.9), INF, INF)  # its beam to the right looks ahead of the base


@pytest.mark.parametrize("reading_m", [NAN, 0.0, 0.0499, -1.0, 10.001, INF])
def test_readings_that_are_none_or_see_nothing_do_not_block(reading_m: float) -> None:
    clearances = read([2.0, INF, reading_m, INF])
    assert clearances == Clearances(INF, approx(1.8), INF)


@pytest.mark.parametrize("reading_m", [0.05, 10.0])
def test_readings_at_the_ends_of_the_range_count(reading_m: float) -> None:
    clearances = read([INF, INF, reading_m, INF])
    assert clearances is not None
    assert clearances.ahead_m == approx(max(0.0, reading_m - 0.4))


def test_too_close_to_be_measured_counts_as_the_shortest_range() -> None:
    """REP 117: -infinity means that something is nearer than range_min."""
    clearances = read([INF, INF, -INF, INF], range_min_m=0.5)
    assert clearances == Clearances(approx(0.1), INF, approx(0.1))


@pytest.mark.parametrize(
    ("ranges_m", "changes"),
    [
        ([], {}),
        ([NAN, NAN, NAN, NAN], {}),  # blind
        ([0.0, 0.01, 0.0, NAN], {}),  # covered
        ([1.0], {"angle_min_rad": NAN}),
        ([1.0], {"angle_increment_rad": INF}),
        ([1.0], {"range_min_m": NAN}),
        ([1.0], {"range_min_m": -0.1}),
        ([1.0], {"range_max_m": NAN}),
        ([1.0], {"range_max_m": 0.05}),
    ],
)
def test_a_scan_that_says_nothing_is_none(ranges_m: list[float], changes: dict[str, float]) -> None:
    assert read(ranges_m, **changes) is None


def test_an_infinite_range_max_leaves_infinite_readings_free() -> None:
    assert read([INF, INF, 2.0, INF], range_max_m=INF) == Clearances(approx(1.6), INF, INF)


def test_a_scanner_that_changes_its_beams_is_followed() -> None:
    reader = ClearanceReader(FOOTPRINT, ScanConfig(required=True))
    ahead, behind = Scan([1.0], 0.0, 0.1, 0.0, 10.0), Scan([1.0], math.pi, 0.1, 0.0, 10.0)
    assert [reader.read(scan) for scan in (ahead, behind, ahead)] == [
        Clearances(approx(0.6), INF, INF),
        Clearances(INF, approx(0.8), INF),
        Clearances(approx(0.6), INF, INF),
    ]


anything = st.floats(width=32)


@given(ranges_m=st.lists(anything, min_size=1, max_size=40), extra_m=anything)
def test_clearances_are_never_negative_and_one_more_reading_never_frees_the_way(
    ranges_m: list[float], extra_m: float
) -> None:
    reader = ClearanceReader(FOOTPRINT, ScanConfig(required=True))
    scan = Scan(np.array(ranges_m), -1.0, 0.1, 0.05, 10.0)
    more = Scan(np.array([*ranges_m, extra_m]), -1.0, 0.1, 0.05, 10.0)
    before, after = reader.read(scan) or FREE, reader.read(more) or FREE
    assert 0.0 <= after.ahead_m <= before.ahead_m
    assert 0.0 <= after.behind_m <= before.behind_m
    assert 0.0 <= after.around_m <= before.around_m
