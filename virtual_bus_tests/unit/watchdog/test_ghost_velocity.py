"""A velocity without travel: the drive reports that the wheel turns, and its encoder does not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from canbase_watchdog.ghost import FROZEN_COUNTS, LIVES, Ghost, GhostWatch
from support.evidence_wheel import CONFIG, HZ, Wheel

COUNT_M = 2.0**-17
"""7.6 µm: a sign of life is 1 mm, a frozen encoder is found after 0.1 mm."""
DRIVE = replace(CONFIG.drives[0], mps_per_bit=0.0, m_per_count=COUNT_M)
LIFE_M = 0.001


class Axis:
    """One wheel, a sample each 1/64 s; its encoder has been still for longer than it takes."""

    def __init__(self, m_per_count: float = COUNT_M, mps_per_bit: float = 0.0) -> None:
        drive = replace(DRIVE, m_per_count=m_per_count, mps_per_bit=mps_per_bit)
        self.watch, self.n = GhostWatch(drive, CONFIG, -1.0), 0

    def sample(self, velocity: float, step_m: float | None = 0.0, *, powered: bool = True) -> Ghost:
        self.n += 1
        return self.watch.on_sample(velocity, step_m, powered, 1.0 / HZ, self.n / HZ)

    def until_found(self, velocity: float, step_m: Callable[[int], float] = lambda n: 0.0, most: int = 1000) -> int:
        """Samples until it is one; `most`: it is none."""
        return next((n for n in range(1, most) if self.sample(velocity, step_m(n)).is_one), most)


def jitter(n: int) -> float:
    """To and fro by 0.9 mm."""
    return -0.0009 if n % 2 else 0.0009


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("velocity", "samples"), [(0.25, 7), (2.0**-9, 7), (2.0**-11, 14)])
def test_a_frozen_encoder_is_found_after_a_tenth_of_a_second_or_of_a_millimetre(
    velocity: float, samples: int, sign: float
) -> None:
    """7 samples are 0.11 s; 14 at 0.49 mm/s are 0.107 mm."""
    assert Axis().until_found(sign * velocity) == samples


def test_of_a_coarse_encoder_four_increments_are_waited_for() -> None:
    coarse = Axis(m_per_count=-(2.0**-10))
    assert coarse.until_found(2.0**-6) == FROZEN_COUNTS * 2.0**-10 / (2.0**-6 / HZ)


def test_one_that_jitters_has_to_miss_two_signs_of_life() -> None:
    axis = Axis()
    axis.sample(0.0, 0.0009)
    assert axis.until_found(2.0**-6, jitter) == pytest.approx(LIVES * LIFE_M / (2.0**-6 / HZ), abs=1.0)


@pytest.mark.parametrize("counts", [2, -2, 50])
def test_an_encoder_that_counts_is_no_ghost(counts: int) -> None:
    """Two increments each 1/16 s: at 0.24 mm/s they are all of its travel."""
    axis = Axis()
    assert axis.until_found(2.0**-12, lambda n: counts * COUNT_M * (n % 4 == 0)) == 1000


def test_one_increment_at_an_edge_is_no_motion() -> None:
    axis = Axis()
    axis.sample(0.0, COUNT_M)
    assert axis.until_found(2.0**-9, lambda n: COUNT_M * (-1) ** n) == 7


@pytest.mark.parametrize("step_m", [None, 1.0])
def test_after_a_motion_or_a_gap_a_filtered_velocity_may_last_for_as_long(step_m: float | None) -> None:
    axis = Axis()
    axis.sample(0.25, step_m)
    assert axis.until_found(0.25) == 13


def test_noise_to_both_sides_and_zeros_are_none() -> None:
    axis = Axis()
    for n in range(1000):
        assert axis.sample((-1) ** n * 0.25 if n % 8 else 0.0).travel_m <= 0.25 / HZ
    assert not axis.sample(0.0).is_one


@pytest.mark.parametrize(("share", "samples"), [(1.0, 1000), (1.01, 7)])
def test_four_bits_at_standstill_are_none(share: float, samples: int) -> None:
    axis = Axis(mps_per_bit=2.0**-11 / CONFIG.drives[0].velocity_scale)
    assert axis.until_found(share * 2.0**-9) == samples


@pytest.mark.parametrize(("keeps", "ghost"), [(0.985, False), (0.995, True)])
def test_the_tail_of_a_slow_filter_is_none(keeps: float, ghost: bool) -> None:
    axis = Axis()
    assert any(axis.sample(0.3 * keeps**n).is_one for n in range(60)) == ghost


def test_it_outlives_the_power_but_not_a_reset() -> None:
    axis = Axis()
    before = [axis.sample(2.0**-9) for _ in range(5)][-1]
    assert before.travel_m == 5 * 2.0**-9 / HZ
    assert axis.sample(2.0**-9, powered=False).travel_m == before.travel_m
    axis.watch.trust()
    assert axis.sample(0.0) == Ghost()


@pytest.mark.parametrize("enabled", [True, False])
def test_its_wheel_is_not_trusted_until_a_reset(enabled: bool) -> None:
    """0.1 s after the start, and as long again."""
    wheel = Wheel()
    last = wheel.samples(12, 0.0, -0.25, rolls=0.0, enabled=enabled)
    assert (last.ghost.is_one, last.trusted) == (False, True)
    last = wheel.samples(1, 0.0, -0.25, rolls=0.0, enabled=enabled)
    assert (last.ghost.is_one, last.trusted) == (True, False)
    off = wheel.sample(0.0, -0.25, rolls=0.0, powered=False)
    assert (off.ghost, off.trusted) == (Ghost(last.ghost.travel_m), False)
    wheel.watch.trust()
    assert (wheel.last.ghost, wheel.last.trusted) == (Ghost(), True)
