"""Samples of one wheel against its setpoints and its encoder, every 10 ms. 1 mm/s per bit, 0.1 mm per count.

setpoint  ████████▁▁▁▁▁▁▁▁
allowed   ██████████▆▅▄▃▁▁    held for drive_lag_s (0.1 s), then falling with 1 m/s²; tolerance 0.05 m/s + 10 %
"""

from __future__ import annotations

import math
from dataclasses import replace
from random import Random
from typing import Any

import pytest

from canbase_watchdog.plausibility import Feedback, Plausibility
from support.watchdog_story import config

CONFIG = replace(config(), motion_tolerance_mps=0.05 - 0.001)
"""With one bit the tolerance is 0.05 m/s."""


class Wheel:
    """A wheel on the table. `way_m`: what its encoder shows."""

    def __init__(self, mirrored: bool = False, **changes: Any) -> None:
        self.sign = -1 if mirrored else 1
        drive = replace(CONFIG.drives[0], mps_per_bit=self.sign * 0.001, m_per_count=self.sign * 0.0001)
        self.watch = Plausibility(drive, replace(CONFIG, **changes), -10.0)
        self.n = 0
        self.way_m = 0.0
        self.sample(0.0, 0.0)

    @property
    def last(self) -> Feedback:
        return self.watch.last

    def sample(
        self, velocity: float, target: float, *, rolls: float | None = None, powered: bool = True, after_s: float = 0.01
    ) -> Feedback:
        """One cycle: setpoint, then feedback. The encoder rolls like the velocity unless it is told otherwise."""
        self.n += round(after_s * 1000)
        now_s = self.n / 1000
        self.way_m += (velocity if rolls is None else rolls) * after_s
        self.watch.on_target(target, now_s)
        self.watch.on_position(self.sign * round(self.way_m * 10_000))
        self.watch.on_velocity(velocity, powered, powered, now_s)
        return self.watch.last

    def samples(self, count: int, velocity: float, target: float, rolls: float | None = None) -> Feedback:
        for _ in range(count):
            self.sample(velocity, target, rolls=rolls)
        return self.last


# --- outside


@pytest.mark.parametrize(
    ("velocity", "outside"),
    [(0.4, 0), (0.0, 0), (0.4899, 0), (0.4901, 1), (-0.0899, 0), (-0.0901, 1)],  # 0.05 + 10 % of 0.4
)
def test_a_sample_may_leave_the_range_by_its_tolerance(velocity: float, outside: int) -> None:
    assert Wheel().sample(velocity, 0.4).outside == outside


@pytest.mark.parametrize(
    ("velocity", "outside"), [(-0.4, 0), (0.0, 0), (-0.4899, 0), (-0.4901, 1), (0.0899, 0), (0.0901, 1)]
)
def test_backward_it_is_the_same(velocity: float, outside: int) -> None:
    assert Wheel(mirrored=True).sample(velocity, -0.4).outside == outside


def test_bad_samples_are_counted_while_they_follow_each_other() -> None:
    wheel = Wheel()
    assert [wheel.sample(0.6, 0.4).outside for _ in range(3)] == [1, 2, 3]
    assert wheel.sample(0.4, 0.4).outside == 0
    assert wheel.sample(0.6, 0.4).outside == 1


def test_after_a_lower_setpoint_the_range_is_held_and_falls() -> None:
    wheel = Wheel()
    wheel.samples(10, 0.4, 0.4)
    highs = [wheel.sample(0.0, 0.0).high_mps for _ in range(60)]
    assert highs[:10] == pytest.approx([0.4] * 10)
    assert highs[10:51] == pytest.approx([0.4 - 0.01 * n for n in range(41)], abs=0.011)
    assert highs[51:] == [0.0] * 9
    assert wheel.last.low_mps == 0.0


def test_it_falls_with_the_configured_deceleration() -> None:
    wheel = Wheel(deceleration_mps2=2.0)
    wheel.samples(10, 0.4, 0.4)
    assert wheel.samples(20, 0.0, 0.0).high_mps == pytest.approx(0.4 - 0.1 * 2.0, abs=0.021)


def test_at_the_very_tolerance_it_is_inside() -> None:
    wheel = Wheel(motion_tolerance_mps=0.124, motion_tolerance_share=0.0)  # with one bit 0.125
    assert [wheel.sample(velocity, 0.5).outside for velocity in (0.625, -0.125)] == [0, 0]


def test_the_lower_end_falls_too() -> None:
    wheel = Wheel()
    wheel.samples(10, -0.4, -0.4)
    lows = [wheel.sample(0.0, 0.0).low_mps for _ in range(60)]
    assert lows[:10] == pytest.approx([-0.4] * 10)
    assert lows[30] == pytest.approx(-0.2, abs=0.011)
    assert (lows[51], wheel.last.high_mps) == (0.0, 0.0)


# --- a wheel that comes free overshoots


def held(count: int = 10, at_mps: float = 0.0, target: float = 0.4, mirrored: bool = False) -> Wheel:
    """A wheel that something has held at this speed for so many cycles."""
    wheel = Wheel(mirrored=mirrored)
    wheel.samples(50, target, target)
    wheel.samples(count, at_mps, target)
    return wheel


@pytest.mark.parametrize(("velocity", "outside"), [(1.6899, 0), (1.6901, 1)])  # 0.4 + 3 x 0.4 that it lacked + 0.09
@pytest.mark.parametrize(("sign", "mirrored"), [(1.0, False), (-1.0, False), (1.0, True)])
def test_held_at_zero_it_may_come_back_three_times_as_fast_as_it_lacked(
    velocity: float, outside: int, sign: float, mirrored: bool
) -> None:
    assert held(target=sign * 0.4, mirrored=mirrored).sample(sign * velocity, sign * 0.4).outside == outside


@pytest.mark.parametrize(("ahead_mps", "samples"), [(1.0, 4), (0.5, 8), (0.41, 10), (0.25, 16)])
def test_what_it_catches_up_is_the_way_that_it_lost_and_no_more(ahead_mps: float, samples: int) -> None:
    """10 cycles at 0.4 m/s are 0.04 m. The sample that goes beyond it may."""
    wheel = held()
    counts = [wheel.sample(0.4 + ahead_mps, 0.4).outside for _ in range(samples + 3)]
    assert counts[:samples] == [0] * samples
    assert counts[samples + 1 :] in ([1, 2], [2, 3])


def test_it_loses_what_it_lacks_in_three_tenths_of_a_second_at_most() -> None:
    """0.12 m; 0.9 m/s ahead are 9 mm a cycle, 14 of them 0.126 m."""
    for cycles in (31, 100):
        wheel = held(cycles)
        assert [wheel.sample(1.3, 0.4).outside for _ in range(17)][12:] == [0, 0, 1, 2, 3]


def test_it_may_for_two_tenths_of_a_second_after_the_last_sample_that_lacked() -> None:
    wheel = held(30)
    counts = [wheel.sample(0.6, 0.4).outside for _ in range(24)]
    assert counts[:19] == [0] * 19
    assert counts[20:] in ([1, 2, 3, 4], [2, 3, 4, 5])


@pytest.mark.parametrize(("held_mps", "outside"), [(0.3701, 1), (0.3699, 0)])
def test_what_lacked_no_more_than_a_third_of_the_tolerance_was_not_held(held_mps: float, outside: int) -> None:
    """Three times that it may be faster anyway: a wheel that lost 0.07 m/s to a bump comes free as much too fast."""
    assert held(at_mps=held_mps).sample(0.5, 0.4).outside == outside


@pytest.mark.parametrize(("held_mps", "outside"), [(0.0151, 1), (0.0149, 0)])
def test_below_two_thirds_of_the_tolerance_half_of_the_setpoint_is_what_tells(held_mps: float, outside: int) -> None:
    """A threshold holds a wheel at 0.03 m/s; its drive has a tenth of a second to wind up."""
    assert held(at_mps=held_mps, target=0.03).sample(0.0831 + 0.01, 0.03).outside == outside


def test_it_overshoots_by_what_it_lacked_and_the_other_way_not_at_all() -> None:
    assert [held(at_mps=0.2).sample(velocity, 0.4).outside for velocity in (1.0899, 1.0901)] == [0, 1]
    assert held(at_mps=0.0).sample(-0.0901, 0.4).outside == 1


def test_a_wheel_that_turned_the_wrong_way_lacked_its_setpoint_and_no_more() -> None:
    assert held(at_mps=-0.3).sample(1.6899, 0.4).outside == 0
    assert held(at_mps=-0.3).sample(1.6901, 0.4).outside > 0


def test_a_setpoint_that_went_to_zero_meanwhile_takes_nothing_of_what_it_lost() -> None:
    wheel = held()
    counts = [wheel.sample(0.8, 0.0).outside for _ in range(9)]  # 8 mm a cycle, of 0.04 m
    assert counts[:5] == [0] * 5
    assert counts[6:] == [1, 2, 3] or counts[6:] == [2, 3, 4]


def test_what_it_lacked_with_power_before_is_forgotten_without() -> None:
    wheel = held()
    for _ in range(21):
        wheel.sample(0.0, 0.4, powered=False)
    assert wheel.sample(0.6, 0.4).outside == 1


def test_a_setpoint_of_zero_lacks_nothing() -> None:
    wheel = Wheel()
    wheel.samples(100, 0.0, 0.0)
    assert wheel.sample(0.0511, 0.0).outside == 1


def test_in_a_reversal_the_wheel_may_still_turn_the_old_way() -> None:
    wheel = Wheel()
    wheel.samples(10, 0.4, 0.4)
    last = wheel.sample(0.4, -0.4)
    assert (last.low_mps, last.high_mps, last.outside) == (-0.4, 0.4, 0)
    assert wheel.samples(51, 0.0, -0.4).high_mps == 0.0


def test_a_wheel_without_power_may_be_pushed_and_nothing_of_it_counts() -> None:
    wheel = Wheel()
    wheel.samples(4, 2.0, 0.0)
    assert wheel.last.outside == 4
    before_m = wheel.last.drift_m
    last = wheel.sample(2.0, 0.0, powered=False, rolls=0.0)
    assert (last.outside, last.overspeed, last.implausible) == (0, 0, 0)
    assert last.drift_m == pytest.approx(before_m * 0.999)
    assert wheel.sample(2.0, 0.0).outside == 1


def test_a_drift_outlives_the_power_and_is_forgotten_with_time() -> None:
    """A wheel that turns faster than its broken encoder tells does so while its drive lets go, too."""
    wheel = Wheel()
    wheel.way_m += 0.04
    wheel.sample(0.0, 0.0)
    assert wheel.sample(0.0, 0.0, powered=False).drift_m == pytest.approx(-0.04 * 0.999)
    assert wheel.last.implausible == 0
    wheel.way_m += 0.012
    wheel.sample(0.0, 0.0)
    assert wheel.last.implausible == 1
    assert wheel.sample(0.0, 0.0, powered=False, after_s=10.0).drift_m == 0.0
    assert wheel.sample(0.0, 0.0, powered=False, after_s=11.0).drift_m == 0.0


def test_a_reset_forgets_the_drift() -> None:
    wheel = Wheel()
    wheel.way_m += 0.055
    assert wheel.sample(0.0, 0.0).implausible == 1
    wheel.sample(0.0, 0.0, powered=False)
    wheel.watch.trust()
    assert (wheel.last.drift_m, wheel.sample(0.0, 0.0).implausible) == (0.0, 0)


def test_before_the_start_the_wheel_may_have_had_any_setpoint() -> None:
    watch = Plausibility(CONFIG.drives[0], CONFIG, 0.0)
    watch.on_target(0.0, 0.05)
    watch.on_velocity(-1.0, True, True, 0.1)
    assert (watch.last.low_mps, watch.last.high_mps, watch.last.outside) == (-1.0, 1.0, 0)
    watch.on_velocity(-1.0, True, True, 0.3)
    assert watch.last.low_mps == pytest.approx(-0.8)


def test_before_the_first_sample_nothing_is_allowed_and_nothing_is_wrong() -> None:
    last = Plausibility(CONFIG.drives[0], CONFIG, 0.0).last
    assert (last.low_mps, last.high_mps, last.outside, last.overspeed, last.implausible) == (0.0, 0.0, 0, 0, 0)


def test_zero_is_always_allowed() -> None:
    wheel = Wheel()
    assert wheel.samples(200, 0.4, 0.4).low_mps == 0.0
    assert wheel.samples(200, -0.4, -0.4).high_mps == 0.0


def test_the_range_is_told_of_a_wheel_without_power_too() -> None:
    wheel = Wheel()
    wheel.samples(200, -0.4, -0.4)
    last = wheel.sample(-0.4, -0.4, powered=False)
    assert (last.low_mps, last.high_mps) == (-0.4, 0.0)


# --- overspeed: 1.2 × 1.0 m/s


@pytest.mark.parametrize("sign", [1, -1])
def test_faster_than_any_wheel(sign: int) -> None:
    wheel = Wheel()
    assert [wheel.sample(sign * v, sign * 9.0).overspeed for v in (1.2, 1.2001, 1.3, 1.2, 1.21)] == [0, 1, 2, 0, 1]


def test_faster_than_the_configured_limit() -> None:
    wheel = Wheel(max_wheel_mps=0.5)
    assert [wheel.sample(velocity, 9.0).overspeed for velocity in (0.6, 0.601)] == [0, 1]


# --- encoder and velocity


def test_a_wheel_that_rolls_as_it_says_does_not_drift() -> None:
    wheel = Wheel()
    for n in range(200):
        wheel.sample(0.005 * min(n, 100), 0.5)
    assert abs(wheel.last.drift_m) < 0.0015  # 0.5 m/s² × 10 ms / 2 s of it, and half a count a sample
    assert wheel.last.implausible == 0


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_frozen_encoder_is_noticed_after_a_few_centimetres(mirrored: bool) -> None:
    wheel = Wheel(mirrored)
    wheel.samples(500, 0.5, 0.5)
    drifts = [wheel.sample(0.5, 0.5, rolls=0.0).drift_m for _ in range(12)]
    assert drifts[0] == pytest.approx(0.005, abs=2e-4)
    assert drifts[9] == pytest.approx(0.0457, abs=3e-4)  # 0.005 × (1 - 0.98^10) / 0.02
    assert drifts[11] > 0.05
    assert [wheel.sample(0.5, 0.5, rolls=0.0).implausible for _ in range(3)] == [2, 3, 4]


def test_a_velocity_that_says_nothing_while_the_encoder_runs() -> None:
    wheel = Wheel()
    wheel.samples(500, 0.5, 0.5)
    drift_m = wheel.samples(12, 0.0, 0.5, rolls=0.5).drift_m
    assert drift_m == pytest.approx(-0.0518, abs=3e-4)  # 0.0025 × 0.98^11 + 0.005 × (1 - 0.98^11) / 0.02
    assert wheel.last.implausible == 1


@pytest.mark.parametrize(
    ("drift_per_sample", "implausible"), [(0.0499, 0), (0.05, 0), (0.0501, 1), (-0.0499, 0), (-0.0501, 1)]
)
def test_the_tolerance_of_the_drift(drift_per_sample: float, implausible: int) -> None:
    wheel = Wheel()
    wheel.way_m += drift_per_sample
    assert wheel.sample(0.0, 0.0).implausible == implausible


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
    assert wheel.last.implausible == 0


@pytest.mark.parametrize("velocity", [0.01, 0.03, 0.1, 0.5])
@pytest.mark.parametrize("mirrored", [False, True])
def test_an_encoder_that_stands_still_is_found_after_a_way_at_any_speed(velocity: float, mirrored: bool) -> None:
    wheel = Wheel(mirrored)
    wheel.samples(2000, velocity, velocity)
    n = 0
    while wheel.last.implausible < CONFIG.feedback_samples and n < 10_000:
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
    assert (last.implausible, abs(last.drift_m) < 0.001) == (1, True)
    assert wheel.sample(0.5, 0.5).implausible == 0


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


def test_the_farthest_jump_is_one() -> None:
    wheel = Wheel()
    wheel.watch.on_position(-(2**31))
    wheel.watch.on_velocity(0.0, True, True, 0.02)
    assert wheel.last.implausible == 1


def test_after_a_longer_time_the_step_may_be_longer() -> None:
    wheel = Wheel()
    wheel.way_m += 0.26
    assert wheel.sample(0.0, 0.0, after_s=0.09).drift_m == pytest.approx(-0.26)
    wheel.way_m += 0.28
    assert wheel.sample(0.0, 0.0, after_s=0.09).implausible == 2  # a jump after a drift


def test_an_encoder_that_jumps_again_and_again_is_bad_each_time() -> None:
    wheel = Wheel()
    counts = []
    for n in range(6):
        wheel.way_m = 5.0 * (n % 2)
        counts.append(wheel.sample(0.0, 0.0, rolls=0.0).implausible)
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
    assert (watch.last.drift_m, watch.last.implausible) == (0.0, 0)


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
        assert wheel.last.implausible <= 1
    assert (wheel.samples(5, 1.8, 1.8, rolls=0.0 if dead else None).implausible >= 3) == dead


# setpoints of 1 m/s until 0.0 ── zero ── 0.3 s for what swings back by 8 % of it
@pytest.mark.parametrize(("after", "velocity", "outside"), [(25, -0.125, 0), (25, -0.135, 1), (35, -0.125, 1)])
def test_after_a_fast_setpoint_a_wheel_may_swing_back(after: int, velocity: float, outside: int) -> None:
    wheel = Wheel(deceleration_mps2=10.0)
    wheel.samples(100, 1.0, 1.0)
    for n in range(after - 1):
        wheel.sample(max(0.0, 1.0 - n * 0.05), 0.0)
    assert wheel.sample(velocity, 0.0).outside == outside
