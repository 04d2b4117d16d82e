"""What leases allow, and for how long: the arithmetic by hand.

order   ████████▁▁▁▁▁▁▁▁▁▁▁▁
bound   ████████████▆▅▄▃▂▁▁▁    held for order_hold_s (0.35 s), then falling with the deceleration (1 m/s²)
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from canbase_watchdog.envelope import Bounds, Envelope, Peak
from support.watchdog_story import config

CONFIG = config()
LONG_AGO = 10.0


class Timeline:
    """An envelope that has forgotten its start; leases come every 20 ms and on a change. `t`: seconds since then."""

    def __init__(self, **changes: Any) -> None:
        self.envelope = Envelope(replace(CONFIG, **changes), 0.0)
        self.envelope.advance(LONG_AGO)
        self.envelope.advance(LONG_AGO + 0.001)
        self.ms = 0
        self.ordered = (0.0, 0.0)
        self.bounds = Bounds(0.0, 0.0, 0.0, 0.0)

    @property
    def t(self) -> float:
        return self.ms / 1000

    def order(self, linear: float, angular: float, seconds: float) -> Bounds:
        """Ordered for so long, in steps of 5 ms; the bounds at its end."""
        for _ in range(round(seconds / 0.005)):
            if self.ms % 20 == 0 or self.ordered != (linear, angular):
                self.ordered = (linear, angular)
                self.envelope.order(linear, angular, LONG_AGO + 0.001 + self.t)
            self.ms += 5
            self.bounds = self.envelope.advance(LONG_AGO + 0.001 + self.t)
        return self.bounds

    def silence(self, seconds: float) -> Bounds:
        for _ in range(round(seconds / 0.005)):
            self.ms += 5
            self.bounds = self.envelope.advance(LONG_AGO + 0.001 + self.t)
        return self.bounds


def numbers(bounds: Bounds) -> tuple[float, float, float, float]:
    return bounds.linear_low, bounds.linear_high, bounds.angular_low, bounds.angular_high


NOTHING = pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-9)


# --- peaks


def test_a_peak_remembers_a_value_for_its_hold_after_its_end() -> None:
    peak = Peak(0.5)
    peak.set(3.0, 1.0, until=9.0)
    peak.set(1.0, 2.0, until=9.0)
    assert peak.greatest(2.0) == 3.0
    assert peak.greatest(2.5) == 3.0  # its end, 2.0, is just not past
    assert peak.greatest(2.51) == 1.0


def test_a_peak_in_force_ends_by_itself() -> None:
    peak = Peak(0.5)
    peak.set(3.0, 1.0, until=2.0)
    assert [peak.greatest(t) for t in (1.0, 2.0, 2.5, 2.51)] == [3.0, 3.0, 3.0, 0.0]


def test_what_ended_long_before_the_next_one_is_not_revived_by_it() -> None:
    peak = Peak(0.5)
    peak.set(3.0, 1.0, until=2.0)
    peak.set(1.0, 3.0, until=9.0)
    assert peak.greatest(3.0) == 1.0


def test_between_two_values_nothing_was_in_force() -> None:
    peak = Peak(0.5)
    peak.set(-3.0, 1.0, until=2.0)
    assert peak.greatest(1.9) == -3.0
    assert peak.greatest(2.1) == 0.0
    peak.set(-2.0, 2.2, until=9.0)
    assert peak.greatest(2.7) == 0.0  # the pause ended at 2.2
    assert peak.greatest(2.71) == -2.0


def test_values_that_follow_each_other_without_a_pause() -> None:
    peak = Peak(0.5)
    peak.set(-3.0, 1.0, until=2.0)
    peak.set(-2.0, 2.0, until=9.0)
    assert peak.greatest(2.0) == -2.0


def test_without_any_value_nothing_is_in_force() -> None:
    assert Peak(0.5).greatest(1.0) == 0.0


def test_a_greater_value_takes_the_place_of_all_smaller_ones() -> None:
    peak = Peak(1.0)
    for n, value in enumerate((1.0, 2.0, 2.0, 5.0, 4.0, 3.0)):
        peak.set(value, n / 10, until=99.0)
    assert [peak.greatest(t) for t in (0.5, 1.4, 1.41, 1.5, 1.51)] == [5.0, 5.0, 4.0, 4.0, 3.0]


def test_after_the_greatest_the_greatest_of_the_others_counts() -> None:
    peak = Peak(1.0)
    for n, value in enumerate((5.0, 2.0, 3.0, 1.0)):
        peak.set(value, n / 10, until=99.0)
    assert [peak.greatest(t) for t in (1.09, 1.11, 1.29, 1.31)] == [5.0, 3.0, 3.0, 1.0]


def test_at_its_very_end_a_value_is_still_in_force() -> None:
    peak = Peak(0.5)
    peak.set(-3.0, 1.0, until=2.0)
    assert [peak.greatest(t) for t in (2.0, 2.0625)] == [-3.0, 0.0]


# --- one way


def test_an_order_allows_itself_and_everything_down_to_zero_at_once() -> None:
    assert numbers(Timeline().order(0.5, 0.0, 0.005)) == pytest.approx((0.0, 0.5, 0.0, 0.0))
    assert numbers(Timeline().order(-0.5, 0.0, 0.005)) == pytest.approx((-0.5, 0.0, 0.0, 0.0))
    assert numbers(Timeline().order(0.0, 2.0, 0.005)) == pytest.approx((0.0, 0.0, 0.0, 2.0))
    assert numbers(Timeline().order(0.0, -2.0, 0.005)) == pytest.approx((0.0, 0.0, -2.0, 0.0))


def test_after_a_stop_the_bound_is_held_and_then_falls_with_the_deceleration() -> None:
    line = Timeline()
    line.order(0.5, 0.0, 1.0)
    assert line.order(0.0, 0.0, 0.345).linear_high == pytest.approx(0.5)
    assert line.order(0.0, 0.0, 0.105).linear_high == pytest.approx(0.4, abs=0.006)  # 0.1 s later
    assert line.order(0.0, 0.0, 0.3).linear_high == pytest.approx(0.1, abs=0.006)
    assert numbers(line.order(0.0, 0.0, 0.11)) == NOTHING


def test_it_falls_with_the_configured_deceleration() -> None:
    line = Timeline(deceleration_mps2=2.0)
    line.order(0.8, 0.0, 1.0)
    line.order(0.0, 0.0, 0.35)
    assert line.order(0.0, 0.0, 0.2).linear_high == pytest.approx(0.4, abs=0.011)
    turn = Timeline(deceleration_mps2=2.0)
    turn.order(0.8, 0.5, 1.0)  # 0.4 s and 0.1 s
    turn.order(0.0, 0.0, 0.35)
    assert turn.order(0.0, 0.0, 0.2).angular_high == pytest.approx(0.25, abs=0.01)


def test_backward_and_turning_fall_as_well() -> None:
    line = Timeline()
    line.order(-0.5, 0.0, 1.0)
    line.order(0.0, 0.0, 0.35)
    assert line.order(0.0, 0.0, 0.2).linear_low == pytest.approx(-0.3, abs=0.006)
    for sign in (1.0, -1.0):
        turn = Timeline()
        turn.order(0.0, sign * 2.0, 1.0)
        turn.order(0.0, 0.0, 0.35)
        bounds = turn.order(0.0, 0.0, 0.2)  # 2 rad/s - 0.2 s × 5 rad/s²
        assert (bounds.angular_low + bounds.angular_high) * sign == pytest.approx(1.0, abs=0.03)
        assert numbers(turn.order(0.0, 0.0, 0.21)) == NOTHING


def test_when_leases_end_the_last_one_is_in_force_for_the_lease_timeout() -> None:
    line = Timeline()
    line.order(0.5, 0.0, 1.0)  # the last one 0.02 s before its end
    assert line.silence(0.575).linear_high == pytest.approx(0.5)  # 0.25 + 0.35 - 0.02 - 0.005
    assert line.silence(0.21).linear_high == pytest.approx(0.3, abs=0.01)
    assert numbers(line.silence(0.35)) == NOTHING


def test_an_order_that_is_lower_is_fallen_to_and_not_below() -> None:
    line = Timeline()
    line.order(0.5, 0.0, 1.0)
    line.order(0.2, 0.0, 0.35)
    assert line.order(0.2, 0.0, 0.1).linear_high == pytest.approx(0.4, abs=0.006)
    assert line.order(0.2, 0.0, 5.0).linear_high == pytest.approx(0.2)


def test_an_order_that_rises_again_while_the_wheels_brake() -> None:
    line = Timeline()
    line.order(0.5, 0.0, 1.0)
    line.order(0.0, 0.0, 0.55)
    assert line.order(0.4, 0.0, 0.005).linear_high == pytest.approx(0.4)
    assert line.order(0.0, 0.0, 0.345).linear_high == pytest.approx(0.4)


def test_a_reversal_keeps_both_ways_open_until_the_first_is_braked() -> None:
    line = Timeline()
    line.order(0.5, 0.0, 1.0)
    bounds = line.order(-0.3, 0.0, 0.34)
    assert numbers(bounds) == pytest.approx((-0.3, 0.5, 0.0, 0.0))
    line.order(-0.3, 0.0, 0.01)
    assert line.order(-0.3, 0.0, 0.2).linear_high == pytest.approx(0.3, abs=0.006)
    assert numbers(line.order(-0.3, 0.0, 0.31)) == pytest.approx((-0.3, 0.0, 0.0, 0.0), abs=1e-9)


# --- linear and angular wait for each other


def test_a_stop_follows_the_arc_when_the_turn_takes_longer() -> None:
    line = Timeline(angular_deceleration_radps2=1.0)  # 2 rad/s need 2 s; 0.5 m/s alone would need 0.5 s
    line.order(0.5, 2.0, 1.0)
    line.order(0.0, 0.0, 0.35)
    bounds = line.order(0.0, 0.0, 1.0)
    assert (bounds.linear_high, bounds.angular_high) == pytest.approx((0.25, 1.0), abs=0.01)
    assert numbers(line.order(0.0, 0.0, 1.01)) == NOTHING


def test_a_stop_follows_the_arc_when_the_braking_takes_longer() -> None:
    line = Timeline()
    line.order(0.8, -2.0, 1.0)  # 0.8 s and 0.4 s
    line.order(0.0, 0.0, 0.35)
    bounds = line.order(0.0, 0.0, 0.4)
    assert (bounds.linear_high, bounds.angular_low) == pytest.approx((0.4, -1.0), abs=0.02)
    assert numbers(line.order(0.0, 0.0, 0.41)) == NOTHING


def test_braking_does_not_wait_for_a_turn_that_goes_on() -> None:
    line = Timeline(angular_deceleration_radps2=1.0)
    line.order(0.5, 2.0, 1.0)
    line.order(0.0, 2.0, 0.35)
    assert line.order(0.0, 2.0, 0.2).linear_high == pytest.approx(0.3, abs=0.006)
    assert numbers(line.order(0.0, 2.0, 0.31)) == pytest.approx((0.0, 0.0, 0.0, 2.0), abs=1e-9)


def test_braking_waits_while_any_order_of_the_last_moments_ends_the_turn() -> None:
    line = Timeline(angular_deceleration_radps2=1.0)
    line.order(0.5, 2.0, 1.0)
    line.order(0.0, 2.0, 0.34)
    line.order(0.0, 0.0, 0.02)
    assert line.order(0.0, 2.0, 0.19).linear_high == pytest.approx(0.46, abs=0.01)  # 0.5 × (1 - 0.2 s / 2 s), and on


# 1 m/s at 0.5 m/s² takes 2 s, the turn itself 0.4 s: the slower one sets the time, and the turn ends with it
@pytest.mark.parametrize("after_s", [0.05, 0.2, 0.5, 1.0, 1.5, 1.9, 1.95, 2.0])
def test_a_turn_waits_for_the_linear_velocity_that_grows_and_no_longer(after_s: float) -> None:
    line = Timeline(acceleration_mps2=0.5)
    line.order(0.0, 2.0, 1.0)
    line.order(1.0, 0.0, 0.35)
    assert line.order(1.0, 0.0, after_s).angular_high == pytest.approx(2.0 - after_s, abs=0.011)


def test_a_growth_that_is_interrupted_begins_at_zero_again() -> None:
    line = Timeline(acceleration_mps2=0.5)
    line.order(0.0, 2.0, 1.0)
    line.order(1.0, 0.0, 1.35)
    line.order(0.0, 0.0, 0.02)  # 0.98 rad/s are left, and 2 s
    assert line.order(1.0, 0.0, 0.2).angular_high == pytest.approx(0.98 * (1 - 0.2 / 2.0), abs=0.02)


# -0.3 m/s, then 0.5 m/s: nothing grows until it is braked. dw/dt = -w / (w / 5 + 1 s): the turn, then the growth
@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(("after_s", "left_radps"), [(0.1, 1.86), (0.3, 1.60), (0.8, 1.08), (1.3, 0.71)])
def test_a_turn_waits_for_a_reversal_and_then_for_what_grows(way: float, after_s: float, left_radps: float) -> None:
    line = Timeline(acceleration_mps2=0.5)
    line.order(-0.3 * way, 2.0, 1.0)
    line.order(0.5 * way, 0.0, 0.35)
    assert line.order(0.5 * way, 0.0, after_s).angular_high == pytest.approx(left_radps, abs=0.02)


# Ordered for 5 s: what has grown is waited for no more. Where the driver has to scale an order down nobody knows what
# has grown: then it is all of it.
@pytest.mark.parametrize(
    ("linear", "angular", "falls_s"),
    [
        (0.6, 2.0, 0.4),  # 1.0 m/s at the rim, the limit
        (-0.6, -2.0, 0.4),
        (0.601, 2.0, 6.01),
        (-0.601, -2.0, 6.01),
        (0.2, 3.99, 0.798),
        (0.2, 4.0, 2.0),  # the greatest turn: more may have been ordered
    ],
)
def test_what_has_grown_is_waited_for_no_more(linear: float, angular: float, falls_s: float) -> None:
    line = Timeline(acceleration_mps2=0.1)
    line.order(linear, angular, 20.0)
    line.order(linear, 0.0, 0.35)
    bounds = line.order(linear, 0.0, falls_s / 2.0)
    assert bounds.angular_low + bounds.angular_high == pytest.approx(angular / 2.0, abs=0.05)
    assert line.order(linear, 0.0, 0.45 * falls_s).angular_high == pytest.approx(max(0.0, angular) / 20.0, abs=0.05)


def test_what_grows_waits_for_a_turn_that_grows() -> None:
    """2 rad/s at 1 rad/s² take 2 s, 0.5 m/s alone 1 s. After 0.75 s of both 0.31 m/s are missing, at the least."""
    line = Timeline(acceleration_mps2=0.5, angular_acceleration_radps2=1.0)
    line.order(0.0, 0.0, 1.0)
    line.order(0.5, 2.0, 1.1)
    line.order(0.5, 0.0, 0.35)
    assert line.order(0.5, 0.0, 0.2).angular_high > 1.3


def test_an_emergency_stop_forgets_what_has_grown() -> None:
    """It was at standstill in between: 0.5 m/s grow again, in 1 s."""
    line = Timeline(acceleration_mps2=0.5, emergency_wait_s=0.0, emergency_deceleration_mps2=2.0)
    line.order(0.5, 0.0, 3.0)
    hard_bounds(line, 0.5, LONG_AGO + 0.001 + line.t, linear=0.5)
    line.order(0.5, 2.0, 0.02)
    line.order(0.5, 0.0, 0.35)
    assert line.order(0.5, 0.0, 0.2).angular_high > 1.3


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_turn_that_is_reversed_falls_with_the_lower_limit(way: float) -> None:
    line = Timeline(angular_acceleration_radps2=1.0)
    line.order(0.0, way, 1.0)
    line.order(0.0, -way, 0.35)
    bounds = line.order(0.0, -way, 0.5)
    assert max(way * bounds.angular_low, way * bounds.angular_high) == pytest.approx(0.5, abs=0.01)
    line = Timeline(angular_acceleration_radps2=1.0)
    line.order(0.0, way, 1.0)
    line.order(0.0, 0.0, 0.35)
    assert numbers(line.order(0.0, 0.0, 0.21)) == NOTHING  # 1 rad/s at 5 rad/s²


# --- limits of all of it


def test_a_lease_above_the_limits_allows_no_more_than_they_do() -> None:
    bounds = Timeline().order(1e9, -1e9, 0.005)
    assert numbers(bounds) == pytest.approx((0.0, 1.0, -4.0, 0.0))
    assert numbers(Timeline().order(-1e9, 1e9, 0.005)) == pytest.approx((-1.0, 0.0, 0.0, 4.0))


def test_before_the_start_anything_may_have_been_ordered() -> None:
    envelope = Envelope(CONFIG, 5.0)
    assert numbers(envelope.advance(5.35)) == pytest.approx((-1.0, 1.0, -4.0, 4.0))
    for n in range(70):
        bounds = envelope.advance(5.35 + n / 100)
    assert bounds.linear_high == pytest.approx(0.31, abs=0.01)
    assert numbers(envelope.advance(6.36)) == NOTHING


def test_a_pause_of_the_watchdog_itself_is_one_long_step() -> None:
    line = Timeline()
    line.order(0.5, 0.0, 1.0)
    assert numbers(line.envelope.advance(LONG_AGO + 9.0)) == NOTHING
    assert numbers(line.envelope.advance(LONG_AGO + 9.0)) == NOTHING


# --- wheels


def test_each_wheel_gets_what_its_place_makes_of_the_bounds() -> None:
    bounds = Bounds(-0.1, 0.5, -1.5, 2.0)
    assert bounds.wheel(0.2) == pytest.approx((-0.4, 0.9))  # right: v + w × 0.2 m
    assert bounds.wheel(-0.2) == pytest.approx((-0.5, 0.8))


@pytest.mark.parametrize(("left", "right"), [(0.625, 0.625), (-0.375, -0.375), (-0.125, 0.375), (0.25, -0.25)])
def test_at_the_very_limit_they_go_together(left: float, right: float) -> None:
    assert Bounds(-0.25, 0.5, -0.5, 0.5).left_right(left, right, track_m=0.5, tolerance_mps=0.125) == ""


@pytest.mark.parametrize(
    ("left", "right", "words"),
    [
        (0.5, 0.5, ""),
        (0.55, 0.55, ""),
        (0.551, 0.551, "0.551 m/s together, allowed -0.100 to 0.500 m/s"),
        (-0.15, -0.15, ""),
        (-0.151, -0.151, "-0.151 m/s together, allowed -0.100 to 0.500 m/s"),
        (0.0, 0.4, ""),  # 1 rad/s
        (-0.05, 0.45, ""),  # 1.25 rad/s: 0.25 more, which is 0.05 m/s at each rim
        (-0.051, 0.451, "1.255 rad/s together, allowed -0.500 to 1.000 rad/s"),
        (0.15, -0.15, ""),
        (0.151, -0.151, "-0.755 rad/s together, allowed -0.500 to 1.000 rad/s"),
    ],
)
def test_two_wheels_together(left: float, right: float, words: str) -> None:
    bounds = Bounds(-0.1, 0.5, -0.5, 1.0)
    assert bounds.left_right(left, right, track_m=0.4, tolerance_mps=0.05 + 1e-9) == words


# --- brakes hard: 0.12 s, then with the emergency deceleration (2 m/s²)


def hard_bounds(line: Timeline, seconds: float, since: float, linear: float = 0.0) -> Bounds:
    """Leases every 20 ms with "brakes hard" since `since`, in steps of 5 ms; the bounds at its end."""
    for _ in range(round(seconds / 0.005)):
        if line.ms % 20 == 0:
            line.envelope.order(linear, 0.0, LONG_AGO + 0.001 + line.t)
        line.ms += 5
        line.bounds = line.envelope.advance(LONG_AGO + 0.001 + line.t, since)
    return line.bounds


@pytest.mark.parametrize(
    ("after_s", "high_mps"),
    [(0.005, 0.8), (0.115, 0.8), (0.12, 0.8), (0.125, 0.79), (0.13, 0.78), (0.32, 0.4), (0.515, 0.01), (0.52, 0.0)],
)
@pytest.mark.parametrize("linear", [0.0, 0.8, -0.8])
def test_brakes_hard_ends_what_is_allowed_whatever_is_ordered(linear: float, after_s: float, high_mps: float) -> None:
    line = Timeline(order_hold_s=5.0, emergency_wait_s=0.12, emergency_deceleration_mps2=2.0)
    line.order(0.8, 0.0, 1.0)
    since = LONG_AGO + 0.001 + line.t
    bounds = hard_bounds(line, after_s, since, linear)
    assert bounds.linear_high == pytest.approx(high_mps, abs=1e-6)
    assert bounds.linear_low == pytest.approx(-high_mps if linear < 0.0 else 0.0, abs=1e-6)


def test_a_turn_falls_with_the_way_and_in_half_the_time() -> None:
    """0.5 m/s and 4 rad/s: 0.8 s by the turn with 5 rad/s², in an emergency 0.4 s, both of them."""
    line = Timeline(emergency_wait_s=0.0, emergency_deceleration_mps2=2.0)
    line.order(0.5, -4.0, 1.0)
    since = LONG_AGO + 0.001 + line.t
    for after_s, share in ((0.1, 0.75), (0.2, 0.25), (0.1, 0.0)):
        bounds = hard_bounds(line, after_s, since)
        assert numbers(bounds) == pytest.approx((0.0, 0.5 * share, -4.0 * share, 0.0), abs=1e-6)


def test_after_it_only_orders_from_then_on_count() -> None:
    line = Timeline(order_hold_s=5.0, emergency_wait_s=0.12, emergency_deceleration_mps2=2.0)
    line.order(0.8, 0.0, 1.0)
    hard_bounds(line, 0.6, LONG_AGO + 0.001 + line.t)
    assert numbers(line.order(0.0, 0.0, 0.1)) == NOTHING
    assert line.order(0.3, 0.0, 0.1).linear_high == pytest.approx(0.3)


def test_before_it_counts_orders_do() -> None:
    """It ended within the 0.12 s: nothing has fallen."""
    line = Timeline(order_hold_s=0.35, emergency_wait_s=0.12, emergency_deceleration_mps2=2.0)
    line.order(0.8, 0.0, 1.0)
    hard_bounds(line, 0.1, LONG_AGO + 0.001 + line.t)
    assert line.order(0.0, 0.0, 0.2).linear_high == pytest.approx(0.8)
