"""Encoder and velocity of one wheel: their difference adds up to a drift. Every 10 ms, 1 mm/s a bit, 0.1 mm a count."""

from __future__ import annotations

import math
from dataclasses import replace
from random import Random

import pytest

from canbase_watchdog.plausibility import Plausibility
from support.plausibility_wheel import CONFIG, Wheel


def test_a_wheel_that_rolls_as_it_says_does_not_drift() -> None:
    wheel = Wheel()
    for n in range(200):
        wheel.sample(0.005 * min(n, 100), 0.5)
    assert abs(wheel.last.drift_m) < 0.0015  # 0.5 m/s² × 10 ms / 2 s of it, and half a count a sample
    assert wheel.last.implausible_samples == 0


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_frozen_encoder_is_noticed_after_a_few_centimetres(mirrored: bool) -> None:
    wheel = Wheel(mirrored)
    wheel.samples(500, 0.5, 0.5)
    drifts = [wheel.sample(0.5, 0.5, rolls=0.0).drift_m for _ in range(12)]
    assert drifts[0] == pytest.approx(0.005, abs=2e-4)
    assert drifts[9] == pytest.approx(0.0457, abs=3e-4)  # 0.005 × (1 - 0.98^10) / 0.02
    assert drifts[11] > 0.05
    assert [wheel.sample(0.5, 0.5, rolls=0.0).implausible_samples for _ in range(3)] == [2, 3, 4]


def test_a_velocity_that_says_nothing_while_the_encoder_runs() -> None:
    wheel = Wheel()
    wheel.samples(500, 0.5, 0.5)
    drift_m = wheel.samples(12, 0.0, 0.5, rolls=0.5).drift_m
    assert drift_m == pytest.approx(-0.0518, abs=3e-4)  # 0.0025 × 0.98^11 + 0.005 × (1 - 0.98^11) / 0.02
    assert wheel.last.implausible_samples == 1


@pytest.mark.parametrize(
    ("drift_per_sample", "implausible"), [(0.0499, 0), (0.05, 0), (0.0501, 1), (-0.0499, 0), (-0.0501, 1)]
)
def test_the_tolerance_of_the_drift(drift_per_sample: float, implausible: int) -> None:
    wheel = Wheel()
    wheel.way_m += drift_per_sample
    assert wheel.sample(0.0, 0.0).implausible_samples == implausible


def test_before_the_first_sample_the_wheel_is_taken_for_standing() -> None:
    watch = Plausibility(CONFIG.drives[0], CONFIG, 0.0)
    watch.on_position(0)
    watch.on_velocity(0.0, True, True, 0.0)
    watch.on_velocity(0.4, True, True, 0.01)
    assert watch.last.drift_m == pytest.approx(0.002, abs=1e-9)


@pytest.mark.parametrize("velocity", [0.02, 0.1, 0.5])
def test_a_small_error_that_lasts_is_forgotten_over_the_way_on_which_it_comes(velocity: float) -> None:
    wheel = Wheel()
    wheel.samples(8000, velocity, velocity, rolls=0.9 * velocity)
    forgotten = velocity / 0.25 + 1.0 / 10.0  # DRIFT_M, DRIFT_S
    assert wheel.last.drift_m == pytest.approx(0.1 * velocity / forgotten, rel=0.03)
    assert wheel.last.implausible_samples == 0


@pytest.mark.parametrize("velocity", [0.01, 0.03, 0.1, 0.5])
@pytest.mark.parametrize("mirrored", [False, True])
def test_an_encoder_that_stands_still_is_found_after_a_way_at_any_speed(velocity: float, mirrored: bool) -> None:
    wheel = Wheel(mirrored)
    wheel.samples(2000, velocity, velocity)
    n = 0
    while wheel.last.implausible_samples < CONFIG.feedback_samples and n < 10_000:
        wheel.sample(velocity, velocity, rolls=0.0)
        n += 1
    forgotten = 1.0 / 0.25 + 1.0 / (10.0 * velocity)
    way_m = -math.log(1.0 - 0.05 * forgotten) / forgotten
    assert n / 100 * velocity == pytest.approx(way_m + 5 * velocity / 100, rel=0.05, abs=0.002)


def test_noise_of_a_standing_wheel_does_not_drift() -> None:
    random, wheel = Random(1), Wheel()
    worst = max(abs(wheel.sample(random.uniform(-0.02, 0.02), 0.0, rolls=0.0).drift_m) for _ in range(60_000))
    assert worst < 0.02


def test_the_counter_goes_round_at_32_bits() -> None:
    wheel = Wheel()
    drive = wheel.watch
    for counts, now_s in ((2**31 - 50, 1.0), (-(2**31) + 50, 1.01), (2**31 - 50, 1.02)):
        drive.on_position(counts)
        drive.on_velocity(0.0, True, True, now_s)
    forgotten = 0.01 / 0.25 + 0.01 / 10.0
    assert drive.last.drift_m == pytest.approx(0.01 * forgotten, abs=1e-6)  # -0.01 m, a little forgotten, then +0.01 m


def test_one_jump_of_the_encoder_is_one_bad_sample_and_no_drift() -> None:
    wheel = Wheel()
    wheel.samples(500, 0.5, 0.5)
    wheel.way_m += 7.0
    last = wheel.sample(0.5, 0.5)
    assert (last.implausible_samples, abs(last.drift_m) < 0.001) == (1, True)
    assert wheel.sample(0.5, 0.5).implausible_samples == 0


def test_a_jump_forgets_nothing_of_the_drift_before_it() -> None:
    wheel = Wheel()
    wheel.way_m += 0.04
    wheel.sample(0.0, 0.0)
    wheel.way_m += 7.0
    assert wheel.sample(0.0, 0.0).drift_m == pytest.approx(-0.04 * 0.999)


def test_what_the_encoder_did_is_evidence_but_a_jump_is_none() -> None:
    wheel = Wheel()
    evidence = wheel.watch.evidence
    evidence.on_setpoint(0.3, wheel.n / 1000)
    wheel.samples(5, 0.3, 0.3, rolls=0.0)
    assert evidence.last.unseen_m == pytest.approx(5 * 0.003)
    wheel.way_m += 7.0
    wheel.sample(0.3, 0.3)
    assert evidence.last.unseen_m == pytest.approx(5 * 0.003)
    wheel.sample(0.3, 0.3)
    assert evidence.last.unseen_m == 0.0


@pytest.mark.parametrize(("step_m", "jump"), [(0.0599, False), (0.0601, True), (-0.0599, False), (-0.0601, True)])
def test_what_three_times_the_fastest_wheel_cannot_do_in_two_cycles_is_a_jump(step_m: float, jump: bool) -> None:
    wheel = Wheel()
    wheel.way_m += step_m
    assert (abs(wheel.sample(0.0, 0.0).drift_m) < 0.001) is jump


def test_a_step_as_long_as_it_may_be_is_no_jump() -> None:
    """3 × 1 m/s × 2/64 s = 1536/2^14 m."""
    watch = Plausibility(replace(CONFIG.drives[0], m_per_count=2.0**-14), replace(CONFIG, control_hz=64.0), 0.0)
    for counts, now_s in ((0, 1.0), (1536, 1.01)):
        watch.on_position(counts)
        watch.on_velocity(0.0, True, True, now_s)
    assert watch.last.drift_m == -0.09375


@pytest.mark.parametrize(("step_m", "jump"), [(0.0299, False), (0.0301, True)])
def test_of_a_slower_base_a_shorter_step_is_a_jump(step_m: float, jump: bool) -> None:
    wheel = Wheel(max_wheel_mps=0.5)
    wheel.way_m += step_m
    assert (abs(wheel.sample(0.0, 0.0).drift_m) < 0.001) is jump


@pytest.mark.parametrize(("increments", "jump"), [(1, False), (2, False), (3, True), (-2, False), (-3, True)])
def test_one_or_two_increments_are_no_jump_however_coarse_they_are(increments: int, jump: bool) -> None:
    """25 mm each, on a base of 0.3 m/s: three times its fastest wheel goes 18 mm in two cycles."""
    watch = Plausibility(replace(CONFIG.drives[0], m_per_count=0.025), replace(CONFIG, max_wheel_mps=0.3), 0.0)
    for counts, now_s in ((0, 1.0), (increments, 1.01)):
        watch.on_position(counts)
        watch.on_velocity(0.0, True, True, now_s)
    assert (watch.last.drift_m == 0.0) is jump


def test_the_farthest_jump_is_one() -> None:
    wheel = Wheel()
    wheel.watch.on_position(-(2**31))
    wheel.watch.on_velocity(0.0, True, True, 0.02)
    assert wheel.last.implausible_samples == 1


def test_after_a_longer_time_the_step_may_be_longer() -> None:
    wheel = Wheel()
    wheel.way_m += 0.26
    assert wheel.sample(0.0, 0.0, after_s=0.09).drift_m == pytest.approx(-0.26)
    wheel.way_m += 0.28
    assert wheel.sample(0.0, 0.0, after_s=0.09).implausible_samples == 2  # a jump after a drift


def test_an_encoder_that_jumps_again_and_again_is_bad_each_time() -> None:
    wheel = Wheel()
    counts = []
    for n in range(6):
        wheel.way_m = 5.0 * (n % 2)
        counts.append(wheel.sample(0.0, 0.0, rolls=0.0).implausible_samples)
    assert counts == [0, 1, 2, 3, 4, 5]


@pytest.mark.parametrize(("gap_s", "kept"), [(0.099, True), (0.1, False), (5.0, False)])
def test_what_was_rolled_in_a_gap_is_not_known(gap_s: float, kept: bool) -> None:
    wheel = Wheel()
    wheel.samples(8, 0.5, 0.5, rolls=0.0)
    assert (wheel.sample(0.5, 0.5, after_s=gap_s).drift_m > 0.0) is kept


@pytest.mark.parametrize(("after_s", "left"), [(1.0, 0.9), (9.0, 0.1), (10.0, 0.0), (11.0, 0.0)])
def test_a_drift_before_is_forgotten_with_time_too(after_s: float, left: float) -> None:
    wheel = Wheel(feedback_timeout_s=20.0)
    wheel.way_m += 0.04
    assert wheel.sample(0.0, 0.0).drift_m == pytest.approx(-0.04)
    assert wheel.sample(0.0, 0.0, after_s=after_s).drift_m == pytest.approx(-0.04 * left)


def test_a_longer_way_forgets_all_that_was_before_it() -> None:
    wheel = Wheel(feedback_timeout_s=20.0)
    wheel.way_m += 0.04
    wheel.sample(0.0, 0.0)
    assert wheel.sample(1.0, 1.0, after_s=0.5, rolls=0.5).drift_m == pytest.approx(0.0, abs=1e-9)


def test_without_a_position_there_is_no_drift() -> None:
    watch = Plausibility(CONFIG.drives[0], CONFIG, 0.0)
    for n in range(20):
        watch.on_target(0.5, n / 100)
        watch.on_velocity(0.5, True, True, n / 100)
    watch.on_position(123_456)
    watch.on_velocity(0.5, True, True, 0.2)
    assert (watch.last.drift_m, watch.last.implausible_samples) == (0.0, 0)


def test_a_drift_outlives_the_power_and_is_forgotten_with_time() -> None:
    """A wheel that turns faster than its broken encoder tells does so while its drive lets go, too."""
    wheel = Wheel()
    wheel.way_m += 0.04
    wheel.sample(0.0, 0.0)
    assert wheel.sample(0.0, 0.0, powered=False).drift_m == pytest.approx(-0.04 * 0.999)
    assert wheel.last.implausible_samples == 0
    wheel.way_m += 0.012
    wheel.sample(0.0, 0.0)
    assert wheel.last.implausible_samples == 1
    assert wheel.sample(0.0, 0.0, powered=False, after_s=10.0).drift_m == 0.0
    assert wheel.sample(0.0, 0.0, powered=False, after_s=11.0).drift_m == 0.0


def test_a_reset_forgets_the_drift() -> None:
    wheel = Wheel()
    wheel.way_m += 0.055
    assert wheel.sample(0.0, 0.0).implausible_samples == 1
    wheel.sample(0.0, 0.0, powered=False)
    wheel.watch.trust()
    assert (wheel.last.drift_m, wheel.sample(0.0, 0.0).implausible_samples) == (0.0, 0)


# 1.8 m/s ── this process waits 0.06 s ── six samples at once: the first one has all the time, the others none
@pytest.mark.parametrize("wait_ms", [60, 110])
@pytest.mark.parametrize("dead", [False, True])
def test_samples_that_come_at_once_are_no_drift_until_one_comes_in_its_time(dead: bool, wait_ms: int) -> None:
    """After 0.1 s, feedback_s, their travel counts as little as the time."""
    wheel = Wheel()
    wheel.samples(100, 1.8, 1.8)
    for n in range(wait_ms // 10):
        wheel.n += wait_ms if n == 0 else 0
        wheel.way_m += 0.0 if dead else 0.018
        wheel.watch.on_position(round(wheel.way_m * 10_000))
        wheel.watch.on_velocity(1.8, True, True, wheel.n / 1000)
        assert wheel.last.implausible_samples <= 1
    assert (wheel.samples(5, 1.8, 1.8, rolls=0.0 if dead else None).implausible_samples >= 3) == dead
