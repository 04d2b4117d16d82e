"""Where a scanner is, from two scans of one room: exact to a few millimetres, or refused with the reason."""

from __future__ import annotations

import math

import numpy as np
import pytest

from canbase_commissioning.umbmark.planar import Array, between, compose, pose
from canbase_commissioning.umbmark.room_scan import Beams, RoomError, room_points
from canbase_commissioning.umbmark.scan_match import match
from support.room import CORRIDOR, FURNISHED, box, scans

HERE = pose(0.2, -0.1, 0.4)
AHEAD = pose(1.5, 0.05, 0.02)
TURNED = pose(-0.1, 0.1, math.pi / 2.0 - 0.03)
GUESS_OFF = pose(0.05, -0.04, 0.05)
"""As far as an odometry with 3 % of error is off after 1.5 m."""


def seen(walls: Array, at: Array, seed: int = 0, view_rad: float = math.tau) -> Array:
    return room_points(scans(walls, at, np.random.default_rng(seed), view_rad=view_rad))


@pytest.mark.parametrize("motion", [AHEAD, TURNED], ids=["1.5 m ahead", "a quarter to the left"])
@pytest.mark.parametrize("view_deg", [360, 270])
def test_the_pose_is_found_within_its_own_certainty(motion: Array, view_deg: float) -> None:
    view_rad = math.radians(view_deg)
    first, second = seen(FURNISHED, HERE, 1, view_rad), seen(FURNISHED, compose(HERE, motion), 2, view_rad)
    found = match(first, second, motion + GUESS_OFF)
    error = between(motion, found.pose)
    assert (np.abs(error) < 3.0 * np.sqrt(np.diag(found.covariance))).all()
    assert math.hypot(error[0], error[1]) < 0.004
    assert abs(error[2]) < 0.002


def test_ten_scans_are_less_noisy_than_one() -> None:
    rng = np.random.default_rng(3)
    spread_m = []
    for count in (1, 10):
        points = room_points(scans(FURNISHED, HERE, rng, count))
        exact = room_points(scans(FURNISHED, HERE, rng, 1, noise_m=0.0))
        spread_m.append(float(np.std(np.hypot(*points.T) - np.hypot(*exact.T))))
    assert spread_m[1] < 0.5 * spread_m[0]


def test_along_a_corridor_nothing_is_found() -> None:
    first, second = seen(CORRIDOR, HERE), seen(CORRIDOR, compose(HERE, AHEAD), 1)
    with pytest.raises(RoomError, match=r"the room does not fix the pose along .*corridor"):
        match(first, second, AHEAD)


def test_in_another_room_nothing_is_found() -> None:
    other = np.array(box(-1.2, -4.0, 3.0, 9.0, 0.5))
    with pytest.raises(RoomError, match=r"of the scan fits the one before|nothing in common"):
        match(seen(FURNISHED, HERE), seen(other, HERE, 1), AHEAD)


def test_where_half_of_the_room_has_changed_nothing_is_found() -> None:
    first, second = seen(FURNISHED, HERE), seen(FURNISHED, HERE, 1)
    people = second[: len(second) * 6 // 10] * np.random.default_rng(5).uniform(0.2, 0.9, (len(second) * 6 // 10, 1))
    with pytest.raises(RoomError, match=r"only .* of the scan fits the one before"):
        match(first, np.concatenate([people, second[len(people) :]]), pose(0.0, 0.0, 0.0))


def test_without_walls_nothing_is_found() -> None:
    rng = np.random.default_rng(4)
    crowd = rng.uniform(-4.0, 4.0, (300, 2))
    with pytest.raises(RoomError, match=r"nothing in it is straight|fits the one before|nothing in common"):
        match(crowd, rng.uniform(-4.0, 4.0, (300, 2)), pose(0.0, 0.0, 0.0))


def beams(*ranges_m: float, step_rad: float = math.tau / 100) -> Beams:
    return Beams([*ranges_m, *[2.0] * (100 - len(ranges_m))], -math.pi, step_rad, 0.1, 10.0)


def test_beams_without_a_reading_or_with_something_that_moves_do_not_count() -> None:
    scans_of_ten = [beams(math.nan, math.inf, 0.05, 1.0 + 0.1 * k) for k in range(10)]
    assert len(room_points(scans_of_ten)) == 96


def test_an_upside_down_scanner_turns_the_other_way() -> None:
    upright, flipped = room_points([beams(1.0)] * 3), room_points([beams(1.0)] * 3, upside_down=True)
    assert flipped[:, 0] == pytest.approx(upright[:, 0])
    assert flipped[:, 1] == pytest.approx(-upright[:, 1])


def test_scans_of_another_form_or_of_nothing_are_refused() -> None:
    with pytest.raises(RoomError, match="2 different forms"):
        room_points([beams(), beams(step_rad=0.05)])
    with pytest.raises(RoomError, match="0 of 100 beams see a wall"):
        room_points([beams(*[math.nan] * 100)] * 3)
