"""The braking curve, the ramp, and the whole motion in virtual time over many goals and bases."""

import math
import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_action_server.outcome import ErrorCode
from canbase_action_server.profile import Profile, ProfileLimits, braking_speed_mps, ideal_time_s
from support.action_plant import Plant, drive

LIMITS = ProfileLimits(
    speed_mps=0.5, acceleration_mps2=1.0, deceleration_mps2=1.0, jerk_mps3=10.0, crawl_mps=0.01, chain_latency_s=0.05
)
TOLERANCE_M = 0.005


def test_the_braking_curve_is_the_stopping_distance_turned_around() -> None:
    # From 0.5 m/s with 1 m/s² and 10 m/s³: 0.5²/2 + 0.5/20 = 0.125 + 0.025 = 0.15 m.
    assert braking_speed_mps(0.15, 1.0, 10.0) == pytest.approx(0.5)
    assert braking_speed_mps(0.0, 1.0, 10.0) == 0.0
    assert braking_speed_mps(-1.0, 1.0, 10.0) == 0.0


@given(st.floats(0, 10), st.floats(0, 10), st.floats(0.05, 10), st.floats(0.1, 1000))
def test_more_way_never_means_less_speed(a_m: float, b_m: float, deceleration: float, jerk: float) -> None:
    near, far = sorted((a_m, b_m))
    assert braking_speed_mps(near, deceleration, jerk) <= braking_speed_mps(far, deceleration, jerk)


def test_it_sets_off_with_limited_acceleration_and_jerk_up_to_the_speed_of_the_goal() -> None:
    profile, speeds = Profile(LIMITS), []
    for cycle in range(100):
        now_s = cycle * 0.02
        speeds.append(profile.order(100.0, now_s, now_s) or 0.0)
    accelerations = [(b - a) / 0.02 for a, b in pairwise(speeds)]
    assert max(accelerations) == pytest.approx(1.0)
    assert accelerations[0] == pytest.approx(0.2)  # 10 m/s³ × 0.02 s
    assert max(speeds) == pytest.approx(0.5, abs=0.001)


def test_what_was_ordered_but_not_seen_yet_counts_as_driven() -> None:
    # 0.1 m/s ordered since 1.0; odometry of 1.0 is used at 1.2: seen until 0.95, so 0.2 s × 0.1 m/s are on their way.
    profile = Profile(LIMITS)
    profile._orders.append((1.0, 0.1))
    assert profile.pending_m(odometry_time=1.0, now_s=1.2) == pytest.approx(0.02)
    assert profile.pending_m(odometry_time=1.2, now_s=1.2) == pytest.approx(0.005)
    assert profile.pending_m(odometry_time=1.0, now_s=1.0) == 0.0


def test_there_is_an_end_and_before_it_the_crawl() -> None:
    profile = Profile(LIMITS)
    profile._orders.append((0.0, 0.3))
    profile.stop(0.1)
    profile.stop(1.0)
    profile.order(0.0005, 2.0, 2.0)
    assert profile.order(0.0005, 3.0, 3.0) == pytest.approx(0.01)
    assert profile.order(0.0, 4.0, 4.0) is None
    assert profile.order(-0.001, 5.0, 5.0) is None


@pytest.mark.parametrize("name", ["speed_mps", "deceleration_mps2", "crawl_mps"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_limits_that_are_none_are_refused(name: str, value: float) -> None:
    values = {field: getattr(LIMITS, field) for field in ProfileLimits.__slots__} | {name: value}
    with pytest.raises(ValueError, match=name):
        ProfileLimits(**values)


def test_the_ideal_time_of_a_long_and_of_a_short_way() -> None:
    # 0.5 m/s: ramps of 0.5 s up and 0.625 s down (80 % of 1 m/s²) cover 0.28125 m; the end is given 1 s.
    assert ideal_time_s(1.28125, LIMITS) == pytest.approx(0.5 + 0.625 + 2.0 + 1.0)
    assert ideal_time_s(0.28125, LIMITS) == pytest.approx(0.5 + 0.625 + 1.0)
    assert ideal_time_s(0.28125 / 4, LIMITS) == pytest.approx((0.5 + 0.625) / 2 + 1.0)


@settings(max_examples=30, deadline=None)
@given(
    distance_m=st.floats(math.log(0.01), math.log(5.0)).map(math.exp),
    sign=st.sampled_from([1.0, -1.0]),
    speed_mps=st.floats(0.1, 0.5),
    dead_time_s=st.floats(0.010, 0.040),
    lag_s=st.floats(0.020, 0.050),
    odometry_hz=st.floats(20.0, 50.0),
    slip=st.floats(-0.1, 0.1),
    seed=st.integers(0, 1000),
)
def test_every_goal_ends_at_its_distance_whatever_the_base(
    distance_m: float,
    sign: float,
    speed_mps: float,
    dead_time_s: float,
    lag_s: float,
    odometry_hz: float,
    slip: float,
    seed: int,
) -> None:
    plant = Plant(dead_time_s=dead_time_s, lag_s=lag_s, slip=slip)
    story = drive(plant, sign * distance_m, speed_mps, odometry_hz=odometry_hz, jitter=random.Random(seed))
    end = story.run()
    assert end.code is ErrorCode.OK
    assert end.traveled_m == pytest.approx(sign * distance_m, abs=TOLERANCE_M)
    assert end.overshoot_m <= TOLERANCE_M
    assert story.fastest_mps <= speed_mps * 1.01
    assert story.coast() < 0.0002


@pytest.mark.parametrize("distance_m", [3.0, -3.0])
def test_a_base_that_pulls_to_one_side_is_led_back_to_the_line(distance_m: float) -> None:
    # Uncorrected, 0.1 rad/m over 3 m ends 0.1 × 3²/2 = 0.45 m beside the line.
    story = drive(Plant(slip=0.1), distance_m, 0.4)
    assert "beside the line" in story.run().message
    plant = story.plant
    beside_m = math.cos(0.3) * plant.y_m - math.sin(0.3) * plant.x_m
    assert abs(beside_m) < 0.05
