"""Where a scanner is: by robot.yaml, and by the static transforms of tf."""

from __future__ import annotations

import math

import numpy as np
import pytest

from canbase_config.safety import Scan as ScanConfig
from canbase_velocity.placement import MAX_TILT_RAD, HeldPlacement, Placement, PlacementError, Transform, placed_by_tf

AHEAD = (np.array([1.0]), np.array([0.0]))
LEFT = (np.array([0.0]), np.array([1.0]))


def turned(parent: str, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0, x_m: float = 0.0) -> Transform:
    """A frame by roll, pitch and yaw (REP 103: fixed axes)."""
    cr, sr, cp, sp = math.cos(roll / 2), math.sin(roll / 2), math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    quaternion = (sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy)
    return Transform(parent, x_m, 0.0, 0.2, *quaternion, cr * cp * cy + sr * sp * sy)


def placed(transform: Transform) -> Placement:
    return placed_by_tf("laser", "base_link", {"laser": transform})


@pytest.mark.parametrize("upside_down", [False, True])
@pytest.mark.parametrize("yaw_rad", [0.0, 0.3, -2.0, math.pi])
def test_tf_and_robot_yaml_agree(yaw_rad: float, upside_down: bool) -> None:
    by_file = Placement.of(ScanConfig(required=True, x_m=0.3, yaw_rad=yaw_rad, upside_down=upside_down))
    by_tf = placed(turned("base_link", roll=math.pi if upside_down else 0.0, yaw=yaw_rad, x_m=0.3))
    for beam in (AHEAD, LEFT):
        assert by_tf.points(*beam) == pytest.approx(by_file.points(*beam))


def test_upside_down_left_and_right_are_swapped() -> None:
    placement = Placement.of(ScanConfig(required=True, upside_down=True))
    assert placement.points(*LEFT).tolist() == [[0.0, -1.0]]
    assert placement.points(*AHEAD).tolist() == [[1.0, 0.0]]


def test_a_chain_of_frames_is_followed() -> None:
    frames = {"laser": turned("mast", x_m=0.1), "mast": turned("base_link", yaw=math.pi / 2, x_m=0.5)}
    placement = placed_by_tf("laser", "base_link", frames)
    assert placement.points(*AHEAD)[0] == pytest.approx((0.5, 1.1))
    assert placed_by_tf("base_link", "base_link", {}).points(*AHEAD)[0] == pytest.approx((1.0, 0.0))


def test_seen_from_the_scanner_is_the_way_back() -> None:
    placement = Placement.of(ScanConfig(required=True, x_m=0.3, y_m=-0.1, yaw_rad=1.0, upside_down=True))
    ranges_m, angles_rad = placement.seen_from(placement.points(np.array([2.0]), np.array([1.0])))
    assert (ranges_m[0], angles_rad[0]) == pytest.approx((math.sqrt(5.0), math.atan2(1.0, 2.0)))


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        ({}, "does not say where laser is in base_link"),
        ({"laser": turned("mast")}, "does not say where mast is in base_link"),
        ({"laser": turned("mast"), "mast": turned("laser")}, "goes round in circles"),
        ({"laser": turned("base_link", pitch=0.5)}, "laser is tilted by 29°"),
        ({"laser": Transform("base_link", 0, 0, 0, 0, 0, 0, 0)}, "is none"),
        ({"laser": Transform("base_link", math.nan, 0, 0, 0, 0, 0, 1)}, "is none"),
    ],
)
def test_a_scanner_that_cannot_be_placed_says_why(frames: dict[str, Transform], words: str) -> None:
    with pytest.raises(PlacementError, match=words):
        placed_by_tf("laser", "base_link", frames)


def test_a_little_tilt_is_projected_to_the_floor() -> None:
    placement = placed(turned("base_link", pitch=MAX_TILT_RAD * 0.99))
    assert placement.points(*AHEAD)[0, 0] == pytest.approx(math.cos(MAX_TILT_RAD * 0.99))
    with pytest.raises(PlacementError, match="tilted"):
        placed(turned("base_link", pitch=MAX_TILT_RAD * 1.01))


def test_an_empty_frame_id_is_named() -> None:
    with pytest.raises(PlacementError, match="the empty frame"):
        placed_by_tf("", "base_link", {})


# a second robot_state_publisher, with another robot's description, says that the scanner looks backward
@pytest.mark.parametrize("other", [{"yaw": math.pi}, {"yaw": 0.01}, {"x_m": 0.35}, {"roll": math.pi}])
def test_a_scanner_that_tf_static_moves_counts_no_more_until_the_next_start(other: dict[str, float]) -> None:
    held = HeldPlacement()
    first = placed(turned("base_link", x_m=0.3))
    assert held.hold("laser", first) == first
    with pytest.raises(PlacementError, match="tf_static has moved laser"):
        held.hold("laser", placed(turned("base_link", **{"x_m": 0.3, **other})))
    with pytest.raises(PlacementError, match="tf_static has moved laser"):
        held.hold("laser", first)


def test_the_same_place_may_be_published_again_and_again() -> None:
    held = HeldPlacement()
    for step in range(5):
        held.hold("laser", placed(turned("base_link", x_m=0.3 + 1e-7 * step)))
