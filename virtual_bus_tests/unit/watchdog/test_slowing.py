"""Whether a wheel in a quick stop loses speed: found after a time that does not depend on how fast it is.

The limits' deceleration is 0.4 m/s² where nothing else is said, the lag 0.1 s, the noise of a speed 0.005 m/s, 100
samples a second: 0.1 s of lag ── 0.2 s of window ── 0.08 s in which it stays so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from random import Random

import pytest

from canbase_config.derive import slope_window_s, watchdog_config
from canbase_config.load import load_robot, sample
from canbase_sim.plant.motor import Motor
from canbase_watchdog.slowing import HELD_S, LASTS_S, Slope, SlowingWatch
from support.watchdog_story import config

SINCE, CYCLE_S = 50.0, 0.01
SLOPE = Slope(lag_s=0.1, least_mps2=0.1, noise_mps=0.005, floor_mps=0.05)
WORST_S = 0.1 + 0.2 + 0.08 + 2 * CYCLE_S


def found_s(
    speed: Callable[[float], float], slope: Slope = SLOPE, cycle_s: float = CYCLE_S, longest_s: float = 30.0
) -> float:
    """Seconds from the order to stop until the wheel is found that has this speed by then; infinity: never."""
    watch = SlowingWatch(slope, SINCE)
    for i in range(1, round(longest_s / cycle_s)):
        watch.on_sample(speed(i * cycle_s), True, SINCE + i * cycle_s)
        if watch.fails:
            return i * cycle_s
    return float("inf")


def for_limits(deceleration_mps2: float) -> Slope:
    return Slope.of(replace(config(), deceleration_mps2=deceleration_mps2), 0.001)


NEVER = float("inf")


# A wheel that keeps its speed


@pytest.mark.parametrize("mps", [0.051, 0.1, 0.3, 0.8, 3.0, 10.0])
def test_a_wheel_that_keeps_its_speed_is_found_at_any_speed_after_the_same_time(mps: float) -> None:
    assert found_s(lambda t: mps) == pytest.approx(0.1 + 0.2 + 0.08, abs=0.021)


@pytest.mark.parametrize(
    ("deceleration_mps2", "window_s"),
    [(0.1, 0.8), (0.2, 0.4), (0.4, 0.2), (0.53, 0.151), (0.54, 0.15), (1.0, 0.15), (5.0, 0.15)],
)
def test_the_window_follows_from_noise_and_deceleration(deceleration_mps2: float, window_s: float) -> None:
    slope = for_limits(deceleration_mps2)
    assert slope.window_s == pytest.approx(window_s, abs=0.0005)
    assert found_s(lambda t: 0.8, slope) <= 0.1 + window_s + LASTS_S + 2 * CYCLE_S + 1e-9
    assert found_s(lambda t: 0.8, slope) > 0.1 + window_s + LASTS_S - CYCLE_S


@pytest.mark.parametrize("deceleration_mps2", [0.4, 0.5, 1.0, 3.0])
def test_from_04_mps2_on_it_takes_no_more_than_the_lag_and_03_s(deceleration_mps2: float) -> None:
    assert found_s(lambda t: 3.0, for_limits(deceleration_mps2)) <= 0.1 + 0.3 + 1e-9


def test_a_coarse_velocity_takes_longer() -> None:
    assert Slope.of(config(), 0.02) == Slope(0.1, 0.25, 0.02, 0.05)
    assert Slope.of(config(), -0.02).window_s == pytest.approx(0.32)
    assert Slope.of(config(), 0.001) == Slope(0.1, 0.25, 0.005, 0.05)


@pytest.mark.parametrize("seed", range(10))
def test_noise_hides_no_wheel_that_keeps_its_speed(seed: int) -> None:
    random = Random(seed)
    assert found_s(lambda t: 0.8 + random.uniform(-0.005, 0.005)) <= WORST_S + 1e-9
    assert found_s(lambda t: 0.8 + random.choice((-0.005, 0.005))) <= WORST_S + 1e-9


@pytest.mark.parametrize("share", [-2.0, -0.1, 0.0, 0.1])
def test_a_wheel_that_brakes_far_less_than_asked_or_gets_faster_is_found_too(share: float) -> None:
    assert found_s(lambda t: 0.8 - share * 0.4 * t) <= WORST_S + 1e-9


@pytest.mark.parametrize("braked_s", [0.2, 0.5, 1.0, 2.0])
def test_a_wheel_that_stops_braking_on_its_way_is_found_within_window_and_hold(braked_s: float) -> None:
    found = found_s(lambda t: 3.0 - 0.8 * min(t, braked_s))
    assert braked_s < found <= braked_s + 0.2 + HELD_S + LASTS_S + CYCLE_S + 1e-9


def test_backward_is_like_forward() -> None:
    assert found_s(lambda t: -0.8) == found_s(lambda t: 0.8)


# When it is looked at


def test_within_the_lag_and_the_window_nothing_is_found() -> None:
    watch = SlowingWatch(SLOPE, SINCE)
    for i in range(1, 32):
        watch.on_sample(0.8, True, SINCE + i / 100)
        assert watch._bad == 0 or i >= 30
    assert watch._bad > 0


@pytest.mark.parametrize(("mps", "found"), [(0.049, False), (0.05, False), (0.0501, True)])
def test_below_the_floor_it_is_the_bound_of_the_whole_stop_that_counts(mps: float, found: bool) -> None:
    assert (found_s(lambda t: mps) < NEVER) == found


def test_without_power_there_is_nothing_to_brake_with() -> None:
    watch = SlowingWatch(SLOPE, SINCE)
    for i in range(1, 300):
        watch.on_sample(0.8, i % 30 != 0, SINCE + i / 100)
        assert not watch.fails


def test_the_same_sample_is_counted_once_and_one_from_before_the_order_never() -> None:
    watch = SlowingWatch(SLOPE, SINCE)
    for _ in range(1000):
        watch.on_sample(0.8, True, SINCE)
        watch.on_sample(0.8, True, SINCE + 0.01)
    assert len(watch._past) == 1
    for i in range(31, 34):
        for _ in range(5):
            watch.on_sample(0.8, True, SINCE + i / 100)
    assert watch._bad == 3
    assert not watch.fails  # for 0.02 s


def test_answers_to_sdo_that_come_seldom_are_enough() -> None:
    """Two motors that are read by SDO: 0.12 s a turn."""
    assert found_s(lambda t: 0.8, cycle_s=0.12) <= 0.1 + 0.2 + 4 * 0.12 + 1e-9


def test_at_20_hz_three_samples_are_enough() -> None:
    assert found_s(lambda t: 0.8, cycle_s=0.05) <= 0.1 + 0.2 + 3 * 0.05 + 1e-9


# What brakes, however badly


@pytest.mark.parametrize("share", [0.26, 0.3, 0.5, 1.0, 3.0])
@pytest.mark.parametrize("mps", [0.06, 0.3, 0.8, 3.0])
def test_a_wheel_that_brakes_with_more_than_a_quarter_is_never_found(share: float, mps: float) -> None:
    assert found_s(lambda t: max(0.0, mps - share * 0.4 * max(0.0, t - 0.1))) == NEVER


@pytest.mark.parametrize("seed", range(10))
def test_noise_makes_no_braking_wheel_look_like_one_that_does_not(seed: int) -> None:
    """Half of the deceleration, which is the least that the stop as a whole allows, and 20 mm/s of noise."""
    random = Random(seed)
    assert found_s(lambda t: max(0.0, 3.0 - 0.2 * max(0.0, t - 0.1)) + random.uniform(-0.02, 0.02)) == NEVER


@pytest.mark.parametrize("grows_s", [0.1, 0.2, 0.3, 0.4])
@pytest.mark.parametrize("deceleration_mps2", [0.4, 1.0, 3.0])
def test_a_ramp_that_begins_softly_brakes(grows_s: float, deceleration_mps2: float) -> None:
    """A drive with a jerk limit: its deceleration grows for so long."""

    def speed(t: float) -> float:
        t -= 0.1
        lost = deceleration_mps2 * (t * t / (2.0 * grows_s) if 0.0 < t < grows_s else max(0.0, t - grows_s / 2.0))
        return max(0.0, 3.0 - (lost if t > 0.0 else 0.0))

    assert found_s(speed, for_limits(deceleration_mps2)) == NEVER


@pytest.mark.parametrize("begin_s", [0.05, 0.2, 0.45, 0.8])
@pytest.mark.parametrize("held_s", [0.05, 0.1, 0.2])
def test_a_wheel_that_a_threshold_held_comes_back_to_its_ramp(begin_s: float, held_s: float) -> None:
    """It stands for 0.2 s, then its drive brings it back to the ramp, and beyond it by a tenth for 0.07 s."""

    def speed(t: float) -> float:
        ramp = max(0.0, 0.8 - 0.4 * max(0.0, t - 0.1))
        after_s = t - begin_s - held_s
        if begin_s <= t and after_s < 0.0:
            return 0.0
        return ramp + 0.08 if 0.0 <= after_s < 0.07 else ramp

    assert found_s(speed) == NEVER


def stopping(motor: Motor, mass_kg: float, push_n: float, mps: float, down_mps2: float) -> Iterator[float]:
    """Speeds, 100 a second, of a wheel with this motor that stops by its drive's own ramp while something pushes."""
    motor.speed_mps = mps
    motor.power_on()
    motor.stop(down_mps2, lambda: None)
    while True:
        for _ in range(10):
            mps += (motor.step(mps) + push_n) / mass_kg * 0.001
        yield mps


@pytest.mark.parametrize("bandwidth_radps", [30.0, 60.0, 200.0])
@pytest.mark.parametrize(("load", "slope"), [(1.0, 0.0), (2.0, 0.0), (1.0, 0.15), (2.0, 0.1)])
def test_a_loaded_base_on_a_way_down_brakes_as_long_as_its_motors_can(
    bandwidth_radps: float, load: float, slope: float
) -> None:
    """60 kg and 0.8 m/s; the velocity loop follows its ramp of 0.4 m/s² under the load, up to 120 N."""
    motor = Motor(60.0, bandwidth_radps, 200.0 * load, 0.001)
    speeds = stopping(motor, 60.0 * load, 60.0 * load * 9.81 * slope, 0.8, 0.4)
    assert found_s(lambda t: next(speeds), longest_s=4.0) == NEVER


@pytest.mark.parametrize(("left_share", "found"), [(0.1, True), (0.3, False), (0.6, False)])
def test_at_the_torque_limit_it_is_what_is_left_for_braking_that_counts(left_share: float, found: bool) -> None:
    """10 % down takes 59 N; of 0.4 m/s² the motor can do a share beside that."""
    push_n = 60.0 * 9.81 * 0.1
    motor = Motor(60.0, 100.0, push_n + left_share * 0.4 * 60.0, 0.001)
    speeds = stopping(motor, 60.0, push_n, 0.8, 0.4)
    assert (found_s(lambda t: next(speeds), longest_s=4.0) < NEVER) == found


def test_the_numbers_of_the_sample_robot() -> None:
    robot = load_robot(sample("bench")).robot
    slope = Slope.of(watchdog_config(robot), 0.0001)
    assert slope == Slope(0.1, 0.25 * robot.limits.deceleration_mps2, 0.005, 0.05)
    assert slope.window_s == slope_window_s(robot) == 0.15


# Exactly at its limits. A window of 0.5 s, a lag of 0.125 s, and times that a float holds exactly

EIGHTHS = Slope(lag_s=0.125, least_mps2=0.25, noise_mps=0.03125, floor_mps=0.0)


def fails_at(samples: list[tuple[float, float]], since: float = 0.0) -> list[float]:
    """At which of these times [s], each with a speed, it fails."""
    watch, found = SlowingWatch(EIGHTHS, since), []
    for at, mps in samples:
        watch.on_sample(mps, True, at)
        if watch.fails:
            found.append(at)
    return found


def test_a_sample_exactly_a_window_ago_is_compared_with() -> None:
    """0.125 s is the only one for 0.625, 0.75 and 0.875 s: the third of them shows it."""
    assert fails_at([(0.125, 0.5), (0.625, 0.5), (0.75, 0.5), (0.875, 0.5)]) == [0.875]


def test_two_samples_are_not_enough_however_far_apart_they_are() -> None:
    assert fails_at([(0.125, 0.5), (0.625, 0.5), (0.8125, 0.5), (0.875, 0.5)]) == [0.875]


def test_a_wheel_exactly_as_far_above_the_line_as_one_bit_is_left_alone() -> None:
    """It loses 0.1875 m/s²: in a window 0.09375 m/s, where it has to lose 0.125 m/s, less a noise of 0.03125 m/s."""
    assert fails_at([(0.125 * n, 1.0 - 0.1875 * 0.125 * n) for n in range(1, 40)]) == []
    assert fails_at([(0.125 * n, 1.0 - 0.1860 * 0.125 * n) for n in range(1, 40)])[0] == 0.875


def test_a_sample_exactly_a_window_and_the_time_of_a_threshold_ago_is_compared_with() -> None:
    """2 m/s at 0.125 s, and 0.5 m/s from then on: no wheel that keeps its speed, until 0.125 s is 0.75 s ago."""
    steps = [(0.125, 2.0), *((0.125 * n, 0.5) for n in range(2, 12))]
    assert fails_at(steps)[0] == 0.125 + 0.75 + 3 * 0.125


def test_it_fails_when_it_has_lasted_exactly_80_ms() -> None:
    before = [(-0.875 + 0.125 * n, 1.0 - 0.05 * n) for n in range(3)]
    assert fails_at([*before, (0.0, 1.0), (0.04, 1.0), (0.08, 1.0)], since=-1.0) == [0.08]
    assert fails_at([*before, (0.0, 1.0), (0.04, 1.0), (0.0799, 1.0)], since=-1.0) == []


# 2 m/s brakes with 1 m/s² for 0.6 s ── keeps 1.4 m/s: compared with what it was up to 0.45 s before, not 1.45 s
def test_a_wheel_that_stops_braking_on_its_way_is_found_as_soon_as_the_past_is_a_threshold_old() -> None:
    assert found_s(lambda t: max(1.4, 2.0 - t)) == pytest.approx(0.6 + 0.2 + LASTS_S, abs=HELD_S)


def test_no_sample_without_power_fails() -> None:
    watch = SlowingWatch(EIGHTHS, 0.0)
    for n in range(1, 20):
        watch.on_sample(0.5, True, 0.125 * n)
    assert watch.fails
    watch.on_sample(0.5, False, 2.5)
    assert not watch.fails
