"""What is seen once and alone does not stop the base; what is seen twice does, one scan later at most."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_velocity.clearance import Points
from canbase_velocity.glitch import NEIGHBOUR_M, GlitchFilter

BEAMS = 360


def points(*hits: tuple[int, float, float]) -> Points:
    """(beam, x, y) of each hit."""
    return Points(np.array([hit[1:] for hit in hits]).reshape(-1, 2), np.array([hit[0] for hit in hits]), BEAMS)


def counting(glitches: GlitchFilter, *hits: tuple[int, float, float], moved_m: float = 0.0, turned: float = 0.0) -> int:
    return len(glitches.genuine(points(*hits), moved_m, turned))


def primed(min_points: int) -> GlitchFilter:
    """After a scan that saw nothing."""
    glitches = GlitchFilter(min_points)
    assert counting(glitches) == 0
    return glitches


LEG = (10, 1.0, 0.0)
WALL = ((20, 2.0, 0.00), (21, 2.0, 0.05), (22, 2.0, 0.10))


def test_the_first_scan_counts_whole() -> None:
    assert counting(GlitchFilter(3), LEG) == 1


def test_a_single_point_counts_when_it_is_seen_again() -> None:
    glitches = primed(2)
    assert counting(glitches, LEG) == 0
    assert counting(glitches, LEG) == 1
    assert counting(glitches, LEG) == 1


def test_dust_that_is_elsewhere_in_each_scan_never_counts() -> None:
    glitches = primed(2)
    assert [counting(glitches, (at, 1.0 + 0.2 * at, 0.0)) for at in range(5)] == [0, 0, 0, 0, 0]


def test_a_group_counts_at_once() -> None:
    assert counting(primed(3), *WALL, LEG) == 3
    assert counting(primed(4), *WALL, LEG) == 0
    assert counting(primed(1), LEG) == 1


@pytest.mark.parametrize(
    "hits",
    [
        ((10, 1.0, 0.0), (12, 1.0, 0.01)),  # a beam between them sees nothing
        ((10, 1.0, 0.0), (11, 1.0 + NEIGHBOUR_M * 1.01, 0.0)),  # one behind the other
    ],
)
def test_what_is_no_neighbour_makes_no_group(hits: tuple[tuple[int, float, float], ...]) -> None:
    assert counting(primed(2), *hits) == 0


def test_the_last_beam_of_a_circle_is_next_to_the_first() -> None:
    assert counting(primed(2), (0, 1.0, 0.0), (100, 5.0, 0.0), (BEAMS - 1, 1.0, -0.02)) == 2


def test_all_around_in_one_group() -> None:
    ring = [(at, np.cos(np.radians(at)), np.sin(np.radians(at))) for at in range(BEAMS)]
    assert counting(primed(10), *ring) == BEAMS


@pytest.mark.parametrize(("moved_m", "turned", "counts"), [(0.0, 0.0, 0), (0.11, 0.0, 1), (0.0, 0.11, 1)])
def test_a_point_may_have_gone_as_far_as_the_base_moved(moved_m: float, turned: float, counts: int) -> None:
    glitches = primed(2)
    counting(glitches, (10, 1.2, 0.0))
    assert counting(glitches, LEG, moved_m=moved_m, turned=turned) == counts


hit = st.tuples(st.integers(0, BEAMS - 1), st.floats(-3, 3), st.floats(-3, 3))
hits = st.lists(hit, max_size=30, unique_by=lambda each: each[0])


@given(scan=hits.map(sorted), before=hits.map(sorted), min_points=st.integers(1, 10))
def test_whatever_stands_still_counts_from_the_second_scan_on(
    scan: list[tuple[int, float, float]], before: list[tuple[int, float, float]], min_points: int
) -> None:
    glitches = GlitchFilter(min_points)
    counting(glitches, *before)
    assert counting(glitches, *scan) <= len(scan)
    assert counting(glitches, *scan) == len(scan)
