"""A wheel that is slower than the least that its setpoints ask for, or gets no faster with all the torque."""

from __future__ import annotations

from typing import Any

import pytest

from support.evidence_wheel import HZ, Wheel, rolling


@pytest.mark.parametrize("sign", [1, -1])
def test_what_is_asked_for_rises_with_the_slowest_ramp_after_the_lag(sign: int) -> None:
    wheel = Wheel()
    asked = [sign * wheel.sample(sign * 0.25, sign * 0.25).ordered_mps for _ in range(50)]
    # The order came in the first of them; from 9 on nothing else was in force in the last 8 cycles.
    assert asked[:9] == [0.0] * 9
    assert asked[9:12] == [0.5 / 64, 1.0 / 64, 1.5 / 64]
    assert asked[-1] == 0.25


@pytest.mark.parametrize("setpoint", [1.0, -1.0])
def test_of_a_fast_wheel_all_of_its_setpoint_is_asked_for(setpoint: float) -> None:
    assert Wheel().samples(200, setpoint, setpoint).ordered_mps == setpoint


@pytest.mark.parametrize("sign", [1, -1])
def test_after_a_reversal_in_a_gap_of_the_samples_the_ramp_begins_at_a_stand(sign: int) -> None:
    wheel = Wheel()
    wheel.samples(100, sign * 0.5, sign * 0.5)
    wheel.watch.on_setpoint(-sign * 0.5, (wheel.n + 1) / HZ)
    wheel.n += 16
    assert wheel.sample(-sign * 0.5, -sign * 0.1, cycles=17).ordered_mps == -sign * 0.5 * 17 / HZ


def test_it_falls_with_the_setpoints_at_once() -> None:
    wheel = Wheel()
    wheel.samples(100, 0.5, 0.5)
    assert wheel.sample(0.25, 0.5).ordered_mps == 0.25
    assert wheel.sample(0.0, 0.5).ordered_mps == 0.0
    assert wheel.sample(0.5, 0.5).ordered_mps == 0.0


def test_of_a_reversal_nothing_is_asked_for_while_the_wheel_turns_the_old_way() -> None:
    for sign in (1, -1):
        wheel = Wheel()
        wheel.samples(100, sign * 0.5, sign * 0.5)
        wheel.samples(20, -sign * 0.5, sign * 0.5)
        assert wheel.sample(-sign * 0.5, sign * 0.0626).ordered_mps == 0.0
        assert wheel.sample(-sign * 0.5, sign * 0.0625).ordered_mps == -sign * 0.5 / 64
        assert wheel.sample(-sign * 0.5, -sign * 0.25).ordered_mps == -sign * 1.0 / 64


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("velocity", "behind"), [(0.3125, False), (0.3124, True), (-0.01, True), (0.6, False)])
def test_behind_is_what_is_slower_than_share_and_tolerance(sign: int, velocity: float, behind: bool) -> None:
    wheel = Wheel()
    wheel.samples(100, sign * 0.5, sign * 0.5)  # 0.5 × 0.75 - 0.0625 = 0.3125
    assert (wheel.sample(sign * 0.5, sign * velocity).behind_s > 0.0) is behind


def test_one_bit_more_is_not_behind() -> None:
    wheel = Wheel(mps_per_bit=-0.125)
    wheel.samples(100, 0.5, 0.5)
    assert wheel.sample(0.5, 0.1875).behind_s == 0.0
    assert wheel.sample(0.5, 0.1874).behind_s > 0.0


def test_the_time_behind_adds_up_and_goes_down_as_fast() -> None:
    wheel = Wheel()
    wheel.samples(100, 0.5, 0.5)
    assert wheel.samples(8, 0.5, 0.25).behind_s == 8 / HZ
    assert wheel.samples(5, 0.5, 0.5).behind_s == 3 / HZ
    assert wheel.samples(5, 0.5, 0.5).behind_s == 0.0
    assert wheel.samples(2, 0.5, 0.25).behind_s == 2 / HZ


def test_a_wheel_that_stands_while_nothing_is_ordered_is_not_behind() -> None:
    wheel = Wheel()
    wheel.samples(100, 0.5, 0.5)
    wheel.sample(0.0, 0.5)
    assert wheel.samples(20, 0.0, 0.0).behind_s == 0.0
    assert wheel.samples(20, 0.0, -0.5).behind_s == 0.0


def test_nothing_is_asked_of_a_drive_that_is_not_enabled() -> None:
    wheel = Wheel()
    wheel.samples(100, 0.5, 0.5)
    wheel.samples(4, 0.5, 0.25)
    last = wheel.sample(0.5, 0.25, enabled=False)
    assert (last.ordered_mps, last.behind_s, last.setpoint_mps) == (0.0, 0.0, 0.5)
    assert wheel.sample(0.5, 0.25).ordered_mps == 0.5 / 64


# --- all the torque, and no gain


@pytest.mark.parametrize("sign", [1, -1])
def test_a_wheel_that_gets_no_faster_with_all_the_torque_is_strained(sign: int) -> None:
    """1/64 m/s slower than ordered; standstill is 1/128 m/s. The first 0.1 s are no time."""
    wheel, slow = rolling(sign * 0.5), sign * (0.5 - 2.0**-6)
    assert wheel.samples(7, sign * 0.5, slow, torque=0.9).strained_s == 0.0
    last = wheel.samples(15, sign * 0.5, slow, torque=-0.9)
    assert (last.strained_s, last.trusted, last.behind_s) == (15 / HZ, True, 0.0)
    last = wheel.sample(sign * 0.5, slow, torque=0.9)
    assert (last.strained_s, last.trusted) == (16 / HZ, False)


@pytest.mark.parametrize(
    ("velocity", "how"),
    [
        (0.5 - 2.0**-6, {"torque": 0.89}),
        (0.5 - 2.0**-6, {"torque": None}),
        (0.5 - 2.0**-7, {"torque": 1.0}),
        (0.75, {"torque": 1.0}),
        (0.5 - 2.0**-6, {"torque": 1.0, "enabled": False}),
    ],
)
def test_with_less_torque_or_at_its_order_it_is_not(velocity: float, how: dict[str, Any]) -> None:
    wheel = rolling(0.5)
    assert wheel.samples(40, 0.5, velocity, **how).strained_s == 0.0


@pytest.mark.parametrize("velocity", [0.25, -0.25])
def test_a_wheel_that_is_held_with_nothing_ordered_is_not_strained(velocity: float) -> None:
    """A hill may be too steep for its drives; without power it would only roll faster."""
    wheel = rolling(0.5)
    wheel.samples(9, 0.0, velocity, torque=1.0)
    assert wheel.samples(40, 0.0, velocity, torque=1.0).strained_s == 0.0


def test_a_wheel_that_gains_is_not_strained_however_far_from_its_order() -> None:
    """5/4 mm/s a sample: more than 1/128 m/s in seven of them, and one in seven may count."""
    wheel = rolling(0.125)
    worst_s = max(wheel.sample(0.5, 0.125 + n * 0.00125, torque=1.0).strained_s for n in range(200))
    assert worst_s <= 1 / HZ
    assert wheel.samples(30, 0.5, wheel.watch._velocity_mps, torque=1.0).strained_s > 0.25


def test_a_wheel_that_recovers_from_a_threshold_gains() -> None:
    """Held for 0.2 s, from 1/2 m/s to a stand; then it takes 0.4 s to get back: 1/50 m/s a sample. Noise is no gain."""
    wheel = rolling(0.5)
    held = [wheel.sample(0.5, 0.5 - n / 24, torque=1.0).strained_s for n in range(1, 13)]
    assert 0.0 < max(held) < 0.1
    assert max(wheel.sample(0.5, n / 50, torque=1.0).strained_s for n in range(1, 25)) < 0.25
    assert wheel.last.strained_s == 0.0
    noisy = rolling(0.5)
    for n in range(30):
        noisy.sample(0.5, 0.4 + (-1) ** n * 0.03, torque=1.0)
    assert noisy.last.strained_s > 0.25


@pytest.mark.parametrize("how", [{"torque": 0.5}, {"torque": 1.0, "enabled": False}, {"torque": 1.0, "powered": False}])
def test_a_moment_without_all_the_torque_begins_it_anew(how: dict[str, Any]) -> None:
    wheel = rolling(0.5)
    assert wheel.samples(20, 0.5, 0.25, torque=1.0).strained_s > 0.0
    assert wheel.sample(0.5, 0.25, **how).strained_s == 0.0
    assert wheel.samples(7, 0.5, 0.25, torque=1.0).strained_s == 0.0
    assert wheel.sample(0.5, 0.25, torque=1.0).strained_s > 0.0
