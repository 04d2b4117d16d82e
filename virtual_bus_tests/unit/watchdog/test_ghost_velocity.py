"""A velocity without travel: the drive reports that the wheel turns, and its encoder does not."""

from __future__ import annotations

import pytest

from support.evidence_wheel import HZ, Wheel, rolling


@pytest.mark.parametrize("velocity", [0.25, -0.25, 2.0**-6, -(2.0**-9)])
@pytest.mark.parametrize("enabled", [True, False])
def test_a_velocity_one_way_that_the_encoder_does_not_show_is_a_ghost(velocity: float, enabled: bool) -> None:
    """0.1 s after the last sign of life for 0.1 s at least, and two signs of life at least, whatever is ordered."""
    wheel = Wheel()
    wheel.sample(0.0, velocity, rolls=1.0)
    n, last = 0, wheel.last
    while not last.ghost and n < 10000:
        n, last = n + 1, wheel.sample(0.0, velocity, rolls=0.0, enabled=enabled)
    way_n = 2.0 * wheel.watch._life_m / abs(velocity) * HZ
    assert (last.ghost, last.trusted) == (True, False)
    assert max(7, way_n) + 5 <= n <= max(7, way_n) + 9


def test_noise_to_both_sides_and_zeros_are_none() -> None:
    wheel = Wheel()
    for n in range(1000):
        assert wheel.sample(0.0, (-1) ** n * 0.25 if n % 8 else 0.0, rolls=0.0).ghost_m <= 0.25 / HZ
    assert not wheel.last.ghost


def test_a_wheel_that_shows_signs_of_life_is_none_however_slow() -> None:
    wheel = Wheel()
    assert not wheel.samples(5000, 0.0, 2.0**-7).ghost


def test_a_few_bits_at_standstill_are_none() -> None:
    wheel = Wheel(mps_per_bit=0.0)
    wheel.watch._residue_mps = 2.0**-9
    assert wheel.samples(5000, 0.0, 2.0**-9, rolls=0.0).ghost_m == 0.0
    assert wheel.samples(5000, 0.0, 1.01 * 2.0**-9, rolls=0.0).ghost


@pytest.mark.parametrize(("keeps", "ghost"), [(0.985, False), (0.995, True)])
def test_the_tail_of_a_slow_filter_is_none(keeps: float, ghost: bool) -> None:
    wheel = rolling(0.5)
    assert any(wheel.sample(0.0, 0.3 * keeps**n, rolls=0.0).ghost for n in range(60)) == ghost


def test_a_filtered_velocity_that_fades_after_a_hard_stop_is_none() -> None:
    wheel = rolling(0.5)
    for n in range(40):
        assert not wheel.sample(0.0, 0.5 * 0.5**n, rolls=0.0, powered=n < 20).ghost


def test_it_outlives_the_power_but_not_a_reset() -> None:
    wheel = Wheel()
    wheel.sample(0.0, 2.0**-9, rolls=1.0)
    before = wheel.samples(32, 0.0, 2.0**-9, rolls=0.0)
    assert before.ghost_m > 0.0
    assert wheel.samples(4, 0.0, 2.0**-9, rolls=0.0, powered=False).ghost_m == before.ghost_m
    wheel.watch.trust()
    assert wheel.last.ghost_m == 0.0
