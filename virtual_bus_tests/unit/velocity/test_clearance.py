"""Free way around a footprint of 0.4 m ahead, 0.2 m behind, 0.3 m left and 0.25 m right of base_link."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_config.safety import Scan as ScanConfig
from canbase_velocity.clearance import FREE, Clearances, ScanReader, clearances, field_of
from canbase_velocity.placement import Placement
from canbase_velocity.scan import Scan, ScanError
from canbase_velocity.sweep import Box

BOX = Box(front_m=0.4, rear_m=0.2, left_m=0.3, right_m=0.25)
HERE = Placement.of(ScanConfig(required=True))
QUARTER_RAD = math.pi / 2
INF, NAN = math.inf, math.nan


SCANNER = ScanConfig(required=True)


def of(scan: Scan, placement: Placement = HERE, reader: ScanReader | None = None) -> Clearances | None:
    """None: the scan cannot be used."""
    try:
        view = (reader or ScanReader(SCANNER)).read(scan, placement)
    except ScanError:
        return None
    return clearances(view.points.at_m, BOX)


def read(ranges_m: list[float], **changes: Any) -> Clearances | None:
    """Clearances of beams 90° apart, the first to the rear, the second to the right, then ahead, then left."""
    geometry = {"angle_min_rad": -math.pi, "angle_increment_rad": QUARTER_RAD, "range_min_m": 0.05, "range_max_m": 10.0}
    pose = {key: changes.pop(key) for key in ("x_m", "y_m", "yaw_rad", "upside_down") if key in changes}
    placement = Placement.of(ScanConfig.model_validate({"required": True, **pose}))
    return of(Scan(ranges_m, **(geometry | changes)), placement)


def points(*places_m: tuple[float, float]) -> Clearances:
    """Clearances of places in base_link."""
    return clearances(np.array(places_m), BOX)


def approx(value: float) -> Any:
    return pytest.approx(value, abs=1e-9)


def test_ahead_and_behind_are_measured_from_the_edges_of_the_footprint() -> None:
    clearances = read([2.0, INF, 3.0, INF])
    assert clearances == Clearances(approx(2.6), approx(1.8))


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
    assert read([1.0], angle_min_rad=0.0, y_m=y_m) == Clearances(approx(0.6), INF)


def test_a_point_ahead_is_not_behind_and_the_other_way_round() -> None:
    assert points((1.0, 0.0)) == Clearances(approx(0.6), INF)
    assert points((-1.0, 0.0)) == Clearances(INF, approx(0.8))


def test_a_point_inside_the_footprint_touches_it_on_its_half() -> None:
    assert points((0.39, 0.1)) == Clearances(0.0, INF)
    assert points((-0.1, 0.1)) == Clearances(INF, 0.0)
    assert points((0.0999, 0.1)) == Clearances(INF, 0.0)
    assert points((0.1001, 0.1)) == Clearances(0.0, INF)  # the middle of the rectangle, not of the base


def test_the_pose_of_the_scanner_is_applied() -> None:
    """Mounted 0.3 m ahead and 0.1 m to the left, turned left by 90°: its beam ahead looks to the left of the base."""
    turned = {"x_m": 0.3, "y_m": 0.1, "yaw_rad": QUARTER_RAD}
    assert read([INF, 1.0, INF, INF], **turned) == Clearances(approx(0.9), INF)  # its beam to the right looks ahead
    # Upside down as well, what it calls right is left of it: that looks behind the base.
    assert read([INF, 1.0, INF, INF], **turned, upside_down=True) == Clearances(INF, approx(0.5))


@pytest.mark.parametrize("reading_m", [NAN, 0.0, 0.0499, -1.0, 10.001, INF])
def test_readings_that_are_none_or_see_nothing_do_not_block(reading_m: float) -> None:
    clearances = read([2.0, INF, reading_m, INF])
    assert clearances == Clearances(INF, approx(1.8))


@pytest.mark.parametrize("reading_m", [0.05, 10.0])
def test_readings_at_the_ends_of_the_range_count(reading_m: float) -> None:
    clearances = read([INF, INF, reading_m, INF], x_m=0.3)
    assert clearances is not None
    assert clearances.ahead_m == approx(max(0.0, reading_m - 0.1))


def test_too_close_to_be_measured_counts_as_the_shortest_range() -> None:
    """REP 117: -infinity means that something is nearer than range_min."""
    clearances = read([INF, INF, -INF, INF], range_min_m=0.5)
    assert clearances == Clearances(approx(0.1), INF)


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
    assert read([INF, INF, 2.0, INF], range_max_m=INF) == Clearances(approx(1.6), INF)


def test_a_scanner_that_changes_its_beams_is_followed() -> None:
    reader = ScanReader(SCANNER)
    ahead, behind = Scan([1.0], 0.0, 0.1, 0.0, 10.0), Scan([1.0], math.pi, 0.1, 0.0, 10.0)
    assert [of(scan, reader=reader) for scan in (ahead, ahead, behind, ahead)] == [
        Clearances(approx(0.6), INF),
        Clearances(approx(0.6), INF),
        Clearances(INF, approx(0.8)),
        Clearances(approx(0.6), INF),
    ]


anything = st.floats(width=32)


@given(ranges_m=st.lists(anything, min_size=1, max_size=40), extra_m=anything)
def test_clearances_are_never_negative_and_one_more_reading_never_frees_the_way(
    ranges_m: list[float], extra_m: float
) -> None:
    scan = Scan(np.array(ranges_m), -1.0, 0.1, 0.05, 10.0)
    more = Scan(np.array([*ranges_m, extra_m]), -1.0, 0.1, 0.05, 10.0)
    before, after = of(scan) or FREE, of(more) or FREE
    assert 0.0 <= after.ahead_m <= before.ahead_m
    assert 0.0 <= after.behind_m <= before.behind_m


@pytest.mark.parametrize(
    ("first_rad", "step_rad", "upside_down", "seen", "unseen"),
    [
        (-1.0, 0.1, False, (math.cos(0.99), math.sin(0.99)), (math.cos(1.16), math.sin(1.16))),
        (1.0, -0.1, False, (math.cos(-0.99), math.sin(-0.99)), (math.cos(-1.16), math.sin(-1.16))),
        (0.0, 0.05, False, (1.0, 0.5), (1.0, -0.5)),
        (0.0, 0.05, True, (1.0, -0.5), (1.0, 0.5)),
        (0.0, 0.1, False, (9.99, 0.0), (10.01, 0.0)),  # range_max
    ],
)
def test_a_scanner_sees_what_is_between_its_first_and_last_beam_and_within_its_ranges(
    first_rad: float, step_rad: float, upside_down: bool, seen: tuple[float, float], unseen: tuple[float, float]
) -> None:
    placement = Placement.of(ScanConfig(required=True, upside_down=upside_down))
    field = field_of(Scan([INF] * 21, first_rad, step_rad, 0.05, 10.0), placement)
    places = np.array([seen, unseen])
    assert field.claims(places).tolist() == [True, False]
    assert (field.covers(places) & ~field.lost(places)).tolist() == [True, False]


def test_a_full_circle_leaves_no_gap_between_its_last_beam_and_its_first() -> None:
    field = field_of(Scan([INF] * 360, 0.0, 2.0 * math.pi / 360, 0.0, 10.0), HERE)
    around = np.array([(math.cos(at), math.sin(at)) for at in np.arange(0.0, 2.0 * math.pi, 0.003)])
    assert field.covers(around).all()


@pytest.mark.parametrize(
    ("angle_rad", "at_m"),
    [(0.0, (0.501, 0.0)), (math.pi / 2.0, (0.2, 0.301)), (math.pi, (-0.401, 0.0)), (-math.pi / 2.0, (0.2, -0.201))],
)
def test_what_is_too_near_stands_beside_the_footprint(angle_rad: float, at_m: tuple[float, float]) -> None:
    """A scanner 0.2 m ahead of base_link in a footprint of 0.5, 0.4, 0.3 and 0.2 m; it measures from 2 m on."""
    scanner = ScanConfig(required=True, x_m=0.2)
    reader = ScanReader(scanner, Box(0.5, 0.4, 0.3, 0.2))
    points = reader.read(Scan([-INF], angle_rad, 0.01, 2.0, 10.0), Placement.of(scanner)).points
    assert points.at_m[0] == pytest.approx(at_m)


def test_a_scanner_outside_of_the_footprint_has_it_where_it_is_itself_and_none_is_farther_than_range_min() -> None:
    scanner = ScanConfig(required=True, x_m=0.8)
    reader = ScanReader(scanner, Box(0.5, 0.4, 0.3, 0.2))
    points = reader.read(Scan([-INF], 0.0, 0.01, 2.0, 10.0), Placement.of(scanner)).points
    assert points.at_m[0] == pytest.approx((0.8, 0.0))
    scanner = ScanConfig(required=True)
    reader = ScanReader(scanner, Box(0.5, 0.4, 0.3, 0.2))
    points = reader.read(Scan([-INF], 0.0, 0.01, 0.1, 10.0), Placement.of(scanner)).points
    assert points.at_m[0] == pytest.approx((0.1, 0.0))
