"""What the footprint sweeps: by hand where that is easy, and against a base that is driven in small steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from canbase_config.safety import Footprint
from canbase_velocity.motion import Pose
from canbase_velocity.sweep import NO_TOUCH, STRAIGHT_M, Box, fastest_mps, first_touch
from canbase_velocity.twist import Twist

INF = math.inf
BOX = Box(front_m=0.4, rear_m=0.2, left_m=0.3, right_m=0.25)
FORWARD, BACKWARD = Twist(0.5, 0.0), Twist(-0.5, 0.0)
LEFT, RIGHT = Twist(0.0, 1.0), Twist(0.0, -1.0)


def way_m(x_m: float, y_m: float, twist: Twist) -> float:
    """How far the point moves, seen from the base, until it touches."""
    return first_touch(np.array([(x_m, y_m)]), BOX, twist, 0.0).way_m


def test_the_padding_is_added_on_all_sides() -> None:
    footprint = Footprint(front_m=0.4, rear_m=0.2, left_m=0.3, right_m=0.25)
    assert Box.of(footprint, 0.0) == BOX
    padded = Box.of(footprint, 0.1)
    sides = (padded.front_m, padded.rear_m, padded.left_m, padded.right_m)
    assert sides == pytest.approx((0.5, 0.3, 0.4, 0.35))


def test_without_points_nothing_is_touched() -> None:
    assert first_touch(np.empty((0, 2)), BOX, FORWARD, 0.1) == NO_TOUCH


@pytest.mark.parametrize(
    ("point", "twist", "expected_m"),
    [
        ((1.0, 0.0), FORWARD, 0.6),
        ((1.0, 0.0), BACKWARD, INF),
        ((-1.0, 0.0), BACKWARD, 0.8),
        ((-1.0, 0.0), FORWARD, INF),
        ((1.0, 0.3), FORWARD, 0.6),  # on the edge of the corridor
        ((1.0, 0.3001), FORWARD, INF),
        ((1.0, -0.25), FORWARD, 0.6),
        ((1.0, -0.2501), FORWARD, INF),
        ((0.0, 0.35), FORWARD, INF),  # beside
        ((0.3, 0.0), FORWARD, 0.0),  # inside, on the front half
        ((0.3, 0.0), BACKWARD, INF),
        ((-0.1, 0.0), FORWARD, INF),  # inside, on the rear half
        ((-0.1, 0.0), BACKWARD, 0.0),
        ((0.1, 0.0), FORWARD, 0.0),  # in the very middle: both ways
        ((0.1, 0.0), BACKWARD, 0.0),
        ((0.4, 0.0), FORWARD, 0.0),  # touched by the front edge
        ((0.4, 0.0), BACKWARD, INF),
    ],
)
def test_straight_on_only_the_corridor_counts(point: tuple[float, float], twist: Twist, expected_m: float) -> None:
    assert way_m(*point, twist) == pytest.approx(expected_m)


def test_a_point_beside_the_base_is_in_the_way_of_a_turn() -> None:
    """At 0.45 m to the left: the front left corner (radius 0.5 m) comes round, and the shorter rear one does not."""
    corner_rad, meets_rad = math.atan2(0.3, 0.4), math.asin(0.45 / 0.5)
    at_x_m = 0.5 * math.cos(meets_rad)
    assert way_m(at_x_m, 0.45, LEFT) == pytest.approx(0.5 * (meets_rad - corner_rad), abs=1e-6)
    assert way_m(0.0, 0.45, FORWARD) == INF
    assert way_m(0.0, 0.501, LEFT) == INF  # beyond the swept circle


def test_turning_right_mirrors_turning_left() -> None:
    mirrored = Box(front_m=0.4, rear_m=0.2, left_m=0.25, right_m=0.3)
    left = first_touch(np.array([(0.1, 0.42)]), BOX, LEFT, 0.0)
    right = first_touch(np.array([(0.1, -0.42)]), mirrored, RIGHT, 0.0)
    assert left.way_m == pytest.approx(right.way_m)
    assert 0.0 < left.way_m < INF


def test_a_turn_swings_the_rear_to_the_outside() -> None:
    """On an arc to the left, about a centre 0.5 m to the left, the rear right corner swings out to the right."""
    arc = Twist(0.5, 1.0)
    rear_right_m = math.hypot(0.2, 0.25 + 0.5)
    bottom_m = (0.0, 0.5 - rear_right_m + 1e-4)  # right below the centre, just inside the circle of that corner
    assert way_m(*bottom_m, arc) < INF
    assert way_m(0.0, 0.5 - rear_right_m - 1e-3, arc) == pytest.approx(way_m(0.0, 0.5 - rear_right_m - 1e-3, arc))
    assert way_m(*bottom_m, FORWARD) == INF


def test_slack_is_the_time_until_the_stop_distance() -> None:
    wall = np.array([(1.0, 0.0), (2.0, 0.1)])
    touch = first_touch(wall, BOX, FORWARD, 0.1)
    assert touch.slack_s == pytest.approx(1.0)
    assert touch.way_m == pytest.approx(0.6)
    assert first_touch(wall, BOX, FORWARD, 0.7).slack_s == pytest.approx(-0.2)


def test_a_point_inside_may_be_left_by_the_shorter_way() -> None:
    """5 mm inside the left edge near the front: turning right takes the edge away from it, turning left does not."""
    inside = (0.35, 0.295)
    assert way_m(*inside, LEFT) == 0.0
    assert way_m(*inside, RIGHT) > 0.3
    assert way_m(*inside, FORWARD) == 0.0
    assert way_m(*inside, BACKWARD) == INF


def test_a_point_that_never_leaves_the_footprint_is_touched_by_every_turn() -> None:
    assert way_m(0.05, 0.05, LEFT) == way_m(0.05, 0.05, RIGHT) == 0.0


@pytest.mark.parametrize("twist", [LEFT, RIGHT, Twist(0.3, 0.5), Twist(-0.3, 0.5)])
@pytest.mark.parametrize("point", [(0.4, 0.0), (-0.2, 0.1), (0.1, 0.3), (0.2, -0.25), (0.4, 0.3), (-0.2, -0.25)])
def test_a_point_on_an_edge_is_touched_by_one_way_at_least(point: tuple[float, float], twist: Twist) -> None:
    other_way = Twist(-twist.linear_mps, -twist.angular_radps)
    assert min(way_m(*point, twist), way_m(*point, other_way)) == pytest.approx(0.0, abs=1e-6)


def test_an_arc_next_to_a_straight_line_agrees_with_it() -> None:
    point = (2.0, 0.1)
    for radius_m in (STRAIGHT_M * 1.001, STRAIGHT_M * 0.999, 1000.0):
        assert way_m(*point, Twist(0.5, 0.5 / radius_m)) == pytest.approx(1.6, abs=1e-3)


@pytest.mark.parametrize(
    ("twist", "expected_mps"),
    [(FORWARD, 0.5), (BACKWARD, 0.5), (LEFT, 0.5), (RIGHT, 0.5), (Twist(0.5, 1.0), math.hypot(0.75, 0.4))],
)
def test_the_fastest_point_is_a_corner(twist: Twist, expected_mps: float) -> None:
    assert fastest_mps(BOX, twist) == pytest.approx(expected_mps)


def test_the_edge_is_made_of_points_on_all_four_sides() -> None:
    edge = BOX.edge(8)
    assert edge.shape == (32, 2)
    assert BOX.contains(edge, -1e-9).all()
    assert not BOX.contains(edge, 1e-9).any()
    corners = {(0.4, 0.3), (0.4, -0.25), (-0.2, -0.25), (-0.2, 0.3)}
    assert corners <= {(round(x_m, 9), round(y_m, 9)) for x_m, y_m in edge.tolist()}


places_m = st.floats(-1.5, 1.5)
speeds = st.floats(-1.0, 1.0) | st.sampled_from([0.0, 0.5, -0.5])
STEP_S = 0.004


@settings(deadline=None)
@given(x_m=places_m, y_m=places_m, linear_mps=speeds, angular_radps=st.floats(-2.0, 2.0))
@example(x_m=0.0, y_m=0.45, linear_mps=0.0, angular_radps=1.0)
@example(x_m=-0.21, y_m=0.0, linear_mps=-0.2, angular_radps=2.0)
def test_a_base_that_is_driven_in_small_steps_touches_where_geometry_says(
    x_m: float, y_m: float, linear_mps: float, angular_radps: float
) -> None:
    twist, point = Twist(linear_mps, angular_radps), np.array([(x_m, y_m)])
    assume(fastest_mps(BOX, twist) > 0.05)
    assume(not BOX.contains(point, -0.005)[0])
    found = first_touch(point, BOX, twist, 0.0)
    times_s = np.arange(0.0, min(3.0, 6.2 / max(abs(angular_radps), 1e-9)), STEP_S)
    seen = np.vstack([Pose().moved(twist, float(at_s)).from_here(point, Pose()) for at_s in times_s])
    well_inside, near = BOX.contains(seen, 0.003), BOX.contains(seen, -0.003)
    if well_inside.any():
        assert found.slack_s <= times_s[well_inside.argmax()]
    if found.slack_s < times_s[-1]:
        assert near[max(0, int(found.slack_s / STEP_S) - 1) : int(found.slack_s / STEP_S) + 3].any()
