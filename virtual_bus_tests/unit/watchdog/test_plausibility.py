"""Samples of one wheel against its setpoints and its encoder, every 10 ms. 1 mm/s per bit, 0.1 mm per count.

setpoint  ████████▁▁▁▁▁▁▁▁
allowed   ██████████▆▅▄▃▁▁    held for drive_lag_s (0.1 s), then falling with 1 m/s²; tolerance 0.05 m/s + 10 %
"""

from __future__ import annotations

import pytest

from canbase_watchdog.plausibility import Plausibility
from support.plausibility_wheel import CONFIG, Wheel

# --- outside


@pytest.mark.parametrize(
    ("velocity", "outside"),
    [(0.4, 0), (0.0, 0), (0.4899, 0), (0.4901, 1), (-0.0899, 0), (-0.0901, 1)],  # 0.05 + 10 % of 0.4
)
def test_a_sample_may_leave_the_range_by_its_tolerance(velocity: float, outside: int) -> None:
    assert Wheel().sample(velocity, 0.4).outside_samples == outside


@pytest.mark.parametrize(
    ("velocity", "outside"), [(-0.4, 0), (0.0, 0), (-0.4899, 0), (-0.4901, 1), (0.0899, 0), (0.0901, 1)]
)
def test_backward_it_is_the_same(velocity: float, outside: int) -> None:
    assert Wheel(mirrored=True).sample(velocity, -0.4).outside_samples == outside


def test_bad_samples_are_counted_while_they_follow_each_other() -> None:
    wheel = Wheel()
    assert [wheel.sample(0.6, 0.4).outside_samples for _ in range(3)] == [1, 2, 3]
    assert wheel.sample(0.4, 0.4).outside_samples == 0
    assert wheel.sample(0.6, 0.4).outside_samples == 1


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
    assert [wheel.sample(velocity, 0.5).outside_samples for velocity in (0.625, -0.125)] == [0, 0]


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
    assert held(target=sign * 0.4, mirrored=mirrored).sample(sign * velocity, sign * 0.4).outside_samples == outside


@pytest.mark.parametrize(("ahead_mps", "samples"), [(1.0, 4), (0.5, 8), (0.41, 10), (0.25, 16)])
def test_what_it_catches_up_is_the_way_that_it_lost_and_no_more(ahead_mps: float, samples: int) -> None:
    """10 cycles at 0.4 m/s are 0.04 m. The sample that goes beyond it may."""
    wheel = held()
    counts = [wheel.sample(0.4 + ahead_mps, 0.4).outside_samples for _ in range(samples + 3)]
    assert counts[:samples] == [0] * samples
    assert counts[samples + 1 :] in ([1, 2], [2, 3])


def test_it_loses_what_it_lacks_in_three_tenths_of_a_second_at_most() -> None:
    """0.12 m; 0.9 m/s ahead are 9 mm a cycle, 14 of them 0.126 m."""
    for cycles in (31, 100):
        wheel = held(cycles)
        assert [wheel.sample(1.3, 0.4).outside_samples for _ in range(17)][12:] == [0, 0, 1, 2, 3]


def test_it_may_for_two_tenths_of_a_second_after_the_last_sample_that_lacked() -> None:
    wheel = held(30)
    counts = [wheel.sample(0.6, 0.4).outside_samples for _ in range(24)]
    assert counts[:19] == [0] * 19
    assert counts[20:] in ([1, 2, 3, 4], [2, 3, 4, 5])


@pytest.mark.parametrize(("held_mps", "outside"), [(0.3701, 1), (0.3699, 0)])
def test_what_lacked_no_more_than_a_third_of_the_tolerance_was_not_held(held_mps: float, outside: int) -> None:
    """Three times that it may be faster anyway: a wheel that lost 0.07 m/s to a bump comes free as much too fast."""
    assert held(at_mps=held_mps).sample(0.5, 0.4).outside_samples == outside


@pytest.mark.parametrize(("held_mps", "outside"), [(0.0151, 1), (0.0149, 0)])
def test_below_two_thirds_of_the_tolerance_half_of_the_setpoint_is_what_tells(held_mps: float, outside: int) -> None:
    """A threshold holds a wheel at 0.03 m/s; its drive has a tenth of a second to wind up."""
    assert held(at_mps=held_mps, target=0.03).sample(0.0831 + 0.01, 0.03).outside_samples == outside


def test_it_overshoots_by_what_it_lacked_and_the_other_way_not_at_all() -> None:
    assert [held(at_mps=0.2).sample(velocity, 0.4).outside_samples for velocity in (1.0899, 1.0901)] == [0, 1]
    assert held(at_mps=0.0).sample(-0.0901, 0.4).outside_samples == 1


def test_a_wheel_that_turned_the_wrong_way_lacked_its_setpoint_and_no_more() -> None:
    assert held(at_mps=-0.3).sample(1.6899, 0.4).outside_samples == 0
    assert held(at_mps=-0.3).sample(1.6901, 0.4).outside_samples > 0


def test_a_setpoint_that_went_to_zero_meanwhile_takes_nothing_of_what_it_lost() -> None:
    wheel = held()
    counts = [wheel.sample(0.8, 0.0).outside_samples for _ in range(9)]  # 8 mm a cycle, of 0.04 m
    assert counts[:5] == [0] * 5
    assert counts[6:] == [1, 2, 3] or counts[6:] == [2, 3, 4]


def test_what_it_lacked_with_power_before_is_forgotten_without() -> None:
    wheel = held()
    for _ in range(21):
        wheel.sample(0.0, 0.4, powered=False)
    assert wheel.sample(0.6, 0.4).outside_samples == 1


def test_a_setpoint_of_zero_lacks_nothing() -> None:
    wheel = Wheel()
    wheel.samples(100, 0.0, 0.0)
    assert wheel.sample(0.0511, 0.0).outside_samples == 1


def test_in_a_reversal_the_wheel_may_still_turn_the_old_way() -> None:
    wheel = Wheel()
    wheel.samples(10, 0.4, 0.4)
    last = wheel.sample(0.4, -0.4)
    assert (last.low_mps, last.high_mps, last.outside_samples) == (-0.4, 0.4, 0)
    assert wheel.samples(51, 0.0, -0.4).high_mps == 0.0


def test_a_wheel_without_power_may_be_pushed_and_nothing_of_it_counts() -> None:
    wheel = Wheel()
    wheel.samples(4, 2.0, 0.0)
    assert wheel.last.outside_samples == 4
    before_m = wheel.last.drift_m
    last = wheel.sample(2.0, 0.0, powered=False, rolls=0.0)
    assert (last.outside_samples, last.overspeed_samples, last.implausible_samples) == (0, 0, 0)
    assert last.drift_m == pytest.approx(before_m * 0.999)
    assert wheel.sample(2.0, 0.0).outside_samples == 1


def test_before_the_start_the_wheel_may_have_had_any_setpoint() -> None:
    watch = Plausibility(CONFIG.drives[0], CONFIG, 0.0)
    watch.on_target(0.0, 0.05)
    watch.on_velocity(-1.0, True, True, 0.1)
    assert (watch.last.low_mps, watch.last.high_mps, watch.last.outside_samples) == (-1.0, 1.0, 0)
    watch.on_velocity(-1.0, True, True, 0.3)
    assert watch.last.low_mps == pytest.approx(-0.8)


def test_before_the_first_sample_nothing_is_allowed_and_nothing_is_wrong() -> None:
    last = Plausibility(CONFIG.drives[0], CONFIG, 0.0).last
    assert (last.low_mps, last.high_mps, last.outside_samples, last.overspeed_samples, last.implausible_samples) == (
        0.0,
        0.0,
        0,
        0,
        0,
    )


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
    assert [wheel.sample(sign * v, sign * 9.0).overspeed_samples for v in (1.2, 1.2001, 1.3, 1.2, 1.21)] == [
        0,
        1,
        2,
        0,
        1,
    ]


def test_faster_than_the_configured_limit() -> None:
    wheel = Wheel(max_wheel_mps=0.5)
    assert [wheel.sample(velocity, 9.0).overspeed_samples for velocity in (0.6, 0.601)] == [0, 1]


# setpoints of 1 m/s until 0.0 ── zero ── 0.3 s for what swings back by 8 % of it
@pytest.mark.parametrize(("after", "velocity", "outside"), [(25, -0.125, 0), (25, -0.135, 1), (35, -0.125, 1)])
def test_after_a_fast_setpoint_a_wheel_may_swing_back(after: int, velocity: float, outside: int) -> None:
    wheel = Wheel(deceleration_mps2=10.0)
    wheel.samples(100, 1.0, 1.0)
    for n in range(after - 1):
        wheel.sample(max(0.0, 1.0 - n * 0.05), 0.0)
    assert wheel.sample(velocity, 0.0).outside_samples == outside
