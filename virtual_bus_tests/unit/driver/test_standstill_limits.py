"""Standstill at its limits, with numbers that a float holds exactly: at the limit and one step beyond it."""

from __future__ import annotations

import math

import pytest

from canbase_driver.drives.standstill import STILL_S, Stillness, StillnessLimits

LIMITS = StillnessLimits(
    standstill_mps=2**-7, noise_mps=2**-4, unshown_m=2**-4, coasting_s=8.0, braking_mps2=4.0, rolling_mps2=8.0
)
FINE_M, CYCLE_S = 2**-17, 2**-6


def beyond(value: float) -> float:
    return math.nextafter(value, math.inf)


def wheel(m_per_count: float = FINE_M, *, follows: bool = False) -> Stillness:
    stillness = Stillness(LIMITS, m_per_count)
    stillness.on_power(True, 0.0, follows)
    return stillness


def stands(stillness: Stillness, *samples: tuple[float, float, float]) -> bool:
    """After these samples: time, travel and velocity."""
    for now_s, travel_m, velocity_mps in samples:
        stillness.on_sample(travel_m, velocity_mps, 0.0, now_s)
    return stillness.stands(samples[-1][0])


SLOW_STEP_M = 3 * LIMITS.standstill_mps * CYCLE_S


@pytest.mark.parametrize(
    ("m_per_count", "step_m", "slow"),
    [
        (FINE_M, SLOW_STEP_M, True),
        (FINE_M, beyond(SLOW_STEP_M), False),
        (FINE_M, -SLOW_STEP_M, True),
        (2**-10, 2 * 2**-10, True),  # an encoder at an edge counts to and fro
        (2**-10, beyond(2 * 2**-10), False),
    ],
)
def test_a_slow_wheel_steps_three_times_its_speed_or_two_counts(m_per_count: float, step_m: float, slow: bool) -> None:
    assert stands(wheel(m_per_count), (0.0, 0.0, 0.0), (CYCLE_S, step_m, 0.0)) is slow


@pytest.mark.parametrize(("velocity_mps", "slow"), [(2**-7, True), (-(2**-7), True), (beyond(2**-7), False)])
def test_a_wheel_is_slow_up_to_its_limit(velocity_mps: float, slow: bool) -> None:
    assert stands(wheel(), (0.0, 0.0, velocity_mps)) is slow
    assert stands(wheel(), (0.0, 0.0, velocity_mps), (CYCLE_S, 0.0, velocity_mps)) is slow


STAY_M = LIMITS.standstill_mps * STILL_S


@pytest.mark.parametrize(
    ("velocity_mps", "moved_m", "after_s", "still"),
    [
        (2**-4, 0.0, STILL_S, True),
        (beyond(2**-4), 0.0, STILL_S, False),
        (2**-4, 0.0, math.nextafter(STILL_S, 0.0), False),
        (2**-4, STAY_M, STILL_S, True),
        (2**-4, beyond(STAY_M), STILL_S, False),
        (2**-4, -STAY_M, STILL_S, True),
    ],
)
def test_a_little_speed_is_standstill_once_the_encoder_has_stayed_for_two_tenths(
    velocity_mps: float, moved_m: float, after_s: float, still: bool
) -> None:
    samples = (0.0, 0.0, velocity_mps), (0.1, moved_m, velocity_mps), (after_s, moved_m, velocity_mps)
    assert stands(wheel(), *samples) is still


def test_where_the_encoder_stays_does_not_matter() -> None:
    assert stands(wheel(), (0.0, 1.0, 2**-4), (0.1, 1.0, 2**-4), (STILL_S, 1.0, 2**-4))


@pytest.mark.parametrize(("seconds", "doubted"), [(2**-4, False), (beyond(2**-4), True)])
def test_evidence_ends_beyond_the_travel_that_was_ordered_and_not_shown(seconds: float, doubted: bool) -> None:
    stillness = wheel()
    stillness.on_sample(0.0, 0.0, 1.0, 0.0)
    stillness.on_sample(0.0, 0.0, 1.0, seconds)
    assert (stillness.doubt != "") is doubted


@pytest.mark.parametrize(("velocity_mps", "doubted"), [(2**-7, True), (beyond(2**-7), False)])
def test_only_a_wheel_that_is_faster_than_standstill_shows_motion(velocity_mps: float, doubted: bool) -> None:
    stillness = wheel()
    for n in range(20):
        stillness.on_sample(0.1 * n, velocity_mps, 1.0, n * CYCLE_S)
    assert (stillness.doubt != "") is doubted


def test_after_its_time_without_power_a_doubted_sensor_gets_one_new_trial() -> None:
    """0.0 s: it lies ── 1.0 s: power off ── 9.0 s: power on ── as much that is not shown takes the evidence again"""
    stillness = wheel()
    stillness.on_sample(0.0, 0.0, 1.0, 0.0)
    stillness.on_sample(0.0, 0.0, 1.0, 0.1)
    stillness.on_power(False, 1.0)
    assert not stillness.rolled_out(math.nextafter(9.0, 0.0))
    assert stillness.rolled_out(9.0)
    stillness.on_power(True, 9.0)
    assert stillness.doubt == ""
    stillness.on_sample(0.0, 0.0, 0.0, 9.0)
    stillness.on_sample(0.0, 0.0, 1.0, 9.0 + 2**-4)
    stillness.on_sample(0.0, 0.0, 1.0, 9.0 + 2**-4 + 2**-8)
    assert stillness.doubt == "showed no motion for 0.066 m of ordered travel"


def test_while_there_is_power_all_of_the_time_without_it_is_left() -> None:
    stillness = wheel()
    stillness.distrust("lies")
    assert stillness.unproven(5.0).endswith("(up to 16 s)")  # the watchdog may wait as long before
    stillness.on_power(False, 6.0)
    assert stillness.unproven(6.5).endswith("(8 s left)")
    assert stillness.unproven(7.0).endswith("(7 s left)")


def sudden(stillness: Stillness) -> Stillness:
    """0.5 m/s until 1/64 s, and nothing from 2/64 s on."""
    stands(stillness, (0.0, 0.0, 0.5), (CYCLE_S, 2**-7, 0.5), (2 * CYCLE_S, 2**-7, 0.0))
    return stillness


def test_a_sudden_stop_is_left_to_the_watchdog_while_it_follows_and_is_doubted_after_a_restart() -> None:
    stillness = sudden(wheel(follows=True))
    assert stillness.doubt == ""
    stillness.forget()
    assert stillness.doubt.startswith("shows standstill and nothing of how it braked from 0.50 m/s")


def test_a_sudden_stop_is_proven_once_it_must_have_rolled_out() -> None:
    stillness, since = sudden(wheel(follows=True)), 2 * CYCLE_S
    assert stillness.stands(since)
    assert not stillness.is_proven(math.nextafter(since + 8.0, 0.0))
    assert stillness.is_proven(since + 8.0)


# from 0.5 m/s: with 4 m/s² at least 0.031 m, with the 8 m/s² of a wheel without power 0.016 m
@pytest.mark.parametrize(("power_lost", "doubted"), [(False, True), (True, False)])
def test_between_two_samples_with_power_and_one_without_it_may_have_braked_as_hard_as_without(
    power_lost: bool, doubted: bool
) -> None:
    stillness = wheel()
    stands(stillness, (0.0, 0.0, 0.5), (CYCLE_S, 2**-7, 0.5))
    if power_lost:
        stillness.on_power(False, 1.5 * CYCLE_S)
    stands(stillness, (2 * CYCLE_S, 2**-7 + 0.02, 0.0))
    stillness.on_power(True, 2.5 * CYCLE_S)
    stands(stillness, (3 * CYCLE_S, 2**-7 + 0.02, 0.0))
    assert (stillness.doubt != "") is doubted


def test_two_samples_at_once_show_no_speed_that_one_cycle_would_not() -> None:
    """2 mm in 1 ms may be 2 mm in a cycle of 5 ms: 0.4 m/s, which is over after 0.02 m."""
    stillness = wheel()
    stands(stillness, (0.0, 0.0, 2.0), (0.001, 0.002, 2.0))
    stands(stillness, (0.05, 0.032, 0.0), (0.06, 0.032, 0.0))
    assert stillness.stands(0.06)
    assert stillness.doubt == ""


@pytest.mark.parametrize(("lost_mps", "is_sudden"), [(2.0625, False), (beyond(2.0625), True), (-3.0, False)])
def test_nothing_brakes_a_wheel_harder_than_the_floor_does(lost_mps: float, is_sudden: bool) -> None:
    """8 m/s² for 0.25 s, and noise."""
    assert wheel().is_sudden(lost_mps, 0.25) is is_sudden
