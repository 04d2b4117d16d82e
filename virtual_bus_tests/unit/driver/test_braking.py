"""Whether a base loses speed as it must: the limits by hand, and the driver's own ramps against them."""

from __future__ import annotations

from itertools import product

import pytest

from canbase_config.derive import slope_window_s, speed_noise_mps
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_config.stopping import HELD_S, lag_s
from canbase_driver.motion.braking import LASTS_S, Braking
from canbase_driver.motion.kinematics import Twist2D, wheel_speeds
from canbase_driver.motion.limiter import Limiter, MotionState


def robot(**limits: float) -> Robot:
    bench = load_robot(sample("bench")).robot
    return bench.model_copy(update={"limits": bench.limits.model_copy(update=limits)})


def begun(speed_mps: float, quick: bool, **limits: float) -> Braking:
    braking = Braking(robot(**limits))
    braking.begin(speed_mps, 0.0, 100.0, quick)
    return braking


@pytest.mark.parametrize(
    ("after_s", "allowed_mps"), [(0.0, 0.6), (0.12, 0.6), (0.32, 0.5), (1.12, 0.1), (1.32, 0.0), (2.0, -0.34)]
)
def test_a_quick_stop_from_half_a_metre_per_second(after_s: float, allowed_mps: float) -> None:
    """110 % + 0.05 m/s for 0.12 s, then 0.5 m/s² less: half of deceleration_mps2."""
    assert begun(-0.5, quick=True).allowed_mps(100.0 + after_s) == pytest.approx(allowed_mps)


def test_a_quick_stop_has_half_of_the_deceleration_of_the_robot() -> None:
    braking = begun(0.5, quick=True, deceleration_mps2=2.0)
    assert braking.allowed_mps(100.0 + 0.12 + 0.3) == pytest.approx(0.6 - 0.3)


def test_what_is_just_allowed_never_fails() -> None:
    braking = begun(0.5, quick=True)
    assert not any(braking.fails(braking.allowed_mps(at_s), at_s) for at_s in (100.1, 100.3, 100.5, 100.7, 101.0))


def test_a_ramp_has_twice_its_time() -> None:
    braking = begun(0.8, quick=False, jerk_mps3=0.2)  # 4 s of ramp: 0.1 m/s² must be seen
    assert braking.allowed_mps(100.0 + 0.12 + 8.0) == pytest.approx(0.8 * 0.1 + 0.05)


def test_it_fails_in_the_third_cycle_in_a_row() -> None:
    braking = begun(0.5, quick=True)
    speeds = (0.61, 0.61, 0.59, 0.61, 0.61, -0.61)
    assert [braking.fails(speed, 100.01 + i / 100) for i, speed in enumerate(speeds)] == [False] * 5 + [True]


def test_at_20_hz_it_fails_in_the_second_cycle() -> None:
    slow = load_robot(sample("bench")).robot
    slow = slow.model_copy(update={"rates": slow.rates.model_copy(update={"control_hz": 20.0})})
    braking = Braking(slow)
    braking.begin(0.5, 0.0, 100.0, quick=True)
    assert [braking.fails(0.7, 100.0 + i / 20) for i in range(2)] == [False, True]


def test_a_new_step_counts_anew() -> None:
    braking = begun(0.5, quick=True)
    braking.fails(0.7, 100.01)
    braking.fails(0.7, 100.02)
    braking.begin(0.5, 0.0, 100.03, quick=True)
    assert not braking.fails(0.7, 100.04)


def test_below_the_end_of_the_way_every_speed_fails_even_one_that_is_not_measured() -> None:
    braking = begun(0.0, quick=True)
    assert [braking.fails(0.0, 101.0 + i / 100) for i in range(3)] == [False, False, True]


@pytest.mark.parametrize(("linear", "angular", "jerk"), product((0.05, 0.3, 0.8), (0.0, 0.5, 2.0), (0.2, 1.0, 10.0)))
def test_a_base_that_follows_the_ramp_with_the_lag_never_fails(linear: float, angular: float, jerk: float) -> None:
    bench = robot(jerk_mps3=jerk)
    limiter, motion = Limiter(bench.limits, 0.5), MotionState(Twist2D(linear, angular))
    braking, now_s = Braking(bench), 100.0
    fastest = max(abs(speed) for speed in wheel_speeds(motion.twist, 0.5))
    braking.begin(fastest, angular, now_s, quick=False)
    late = [fastest] * round(lag_s(bench) / 0.01)
    while motion.twist != Twist2D.ZERO or late:
        now_s += 0.01
        motion = limiter.step(motion, Twist2D.ZERO, 0.01)
        late.append(max(abs(speed) for speed in wheel_speeds(motion.twist, 0.5)))
        assert not braking.fails(late.pop(0), now_s)
        if motion.twist == Twist2D.ZERO and max(late) == 0.0:
            break


@pytest.mark.parametrize(("mps", "found"), [(0.05, False), (0.06, True), (0.5, True), (3.0, True)])
def test_a_wheel_that_keeps_its_speed_is_found_at_any_speed_in_the_same_time(mps: float, found: bool) -> None:
    """0.12 s of lag, 0.15 s of window, 0.08 s in which it stays so."""
    braking = begun(mps, quick=True)
    told = [braking.keeps_speed(mps, 100.0 + i / 100) for i in range(100)]
    assert any(told) == found
    if found:
        assert told.index(True) == pytest.approx(35, abs=2)


def test_a_wheel_that_brakes_with_half_of_it_never_keeps_its_speed() -> None:
    braking = begun(3.0, quick=True)
    speeds = [3.0 - 0.5 * max(0.0, i / 100 - 0.12) for i in range(600)]
    assert not any(braking.keeps_speed(speed, 100.0 + i / 100) for i, speed in enumerate(speeds))


def test_a_wheel_that_a_threshold_held_comes_back_to_its_ramp() -> None:
    braking = begun(0.8, quick=True)
    speeds = [0.1 if 30 <= i < 50 else 0.8 - max(0.0, i / 100 - 0.12) for i in range(80)]
    assert not any(braking.keeps_speed(speed, 100.0 + i / 100) for i, speed in enumerate(speeds))


def test_one_bad_sample_after_a_late_cycle_is_not_enough() -> None:
    braking = begun(0.8, quick=True)
    for i in range(40):
        assert not braking.keeps_speed(max(0.3, 0.8 - max(0.0, i / 100 - 0.12)), 100.0 + i / 100)
    assert not braking.keeps_speed(0.8, 100.6)
    assert braking.keeps_speed(0.8, 100.61)


@pytest.mark.parametrize("deceleration_mps2", [1.0, 2.0])
def test_a_quarter_of_the_deceleration_is_enough_and_a_sample_may_be_off(deceleration_mps2: float) -> None:
    """Over the window the wheel must lose a quarter of what it should; the noise of a sample is forgiven."""
    bench = robot(deceleration_mps2=deceleration_mps2)
    least_mps2 = deceleration_mps2 / 4.0 - speed_noise_mps(bench) / slope_window_s(bench)
    for share, keeps in ((0.95, True), (1.05, False)):
        braking = begun(1.0, quick=True, deceleration_mps2=deceleration_mps2)
        speeds = [1.0 - share * least_mps2 * i / 100 for i in range(100)]
        assert any(braking.keeps_speed(speed, 100.0 + i / 100) for i, speed in enumerate(speeds)) == keeps


def test_what_it_did_long_ago_is_forgotten() -> None:
    """It brakes at 1 m/s² until 0.52 s and keeps 0.4 m/s: 0.4 s later its fast past is out of sight."""
    braking = begun(0.8, quick=True)
    speeds = [max(0.4, 0.8 - max(0.0, i / 100 - 0.12)) for i in range(200)]
    told = [braking.keeps_speed(speed, 100.0 + i / 100) for i, speed in enumerate(speeds)]
    assert 0.52 + slope_window_s(robot()) < told.index(True) / 100 < 0.52 + slope_window_s(robot()) + HELD_S + LASTS_S


LAG_S, WINDOW_S, NOISE_MPS = lag_s(robot()), slope_window_s(robot()), speed_noise_mps(robot())
JUDGED_S = LAG_S + WINDOW_S
"""From then on a speed is compared with one that is a window old."""
HELD = ((0.31, 0.3), (0.5, 0.3), (0.6, 0.3), (0.7, 0.3))


@pytest.mark.parametrize(
    ("samples", "keeps"),
    [
        pytest.param([(JUDGED_S - WINDOW_S, 0.5), (JUDGED_S, 0.5), (0.4, 0.5)], True, id="exactly one window later"),
        pytest.param([(0.7 - WINDOW_S - HELD_S, 0.6), *HELD, (0.72, 0.3)], False, id="faster, just not too long ago"),
        pytest.param([(0.69 - WINDOW_S - HELD_S, 0.6), *HELD, (0.72, 0.3)], True, id="faster, too long ago"),
        pytest.param(
            [(0.25, 0.5), (0.5, 0.5 + 0.0625 + NOISE_MPS - 0.125), (0.6, 0.5625 + NOISE_MPS - 0.15)],
            False,
            id="slower by just enough",
        ),
        pytest.param([(0.25, 0.5), (0.5, 0.4426), (0.6, 0.4176)], True, id="slower by a little less"),
    ],
)
def test_a_speed_is_compared_with_those_between_a_window_and_what_a_threshold_may_hold(
    samples: list[tuple[float, float]], keeps: bool
) -> None:
    """The stop begins at 0 s; a wheel must lose 0.25 m/s each second."""
    braking = Braking(robot())
    braking.begin(0.8, 0.0, 0.0, quick=True)
    assert [braking.keeps_speed(speed_mps, at_s) for at_s, speed_mps in samples][-1] is keeps


@pytest.mark.parametrize(("at_s", "keeps"), [(LASTS_S - 1e-9, False), (LASTS_S, True)])
def test_it_must_keep_its_speed_for_so_long(at_s: float, keeps: bool) -> None:
    """The stop begins at -0.2 s; 0.07 s is the first moment that is judged, 0.0 s the last sample before it."""
    braking = Braking(robot())
    braking.begin(0.8, 0.0, -0.2, quick=True)
    assert [braking.keeps_speed(0.5, sample_s) for sample_s in (-0.1, 0.0, 0.075, at_s)] == [False, False, False, keeps]
