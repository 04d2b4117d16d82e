"""Changes of velocity that no wheel can do: halts and jolts. 16 m/s² in 1/64 s are 0.25 m/s; tolerance 0.0625 m/s."""

from __future__ import annotations

from typing import Any

import pytest

from support.evidence_wheel import Wheel


def fast(speed: float = 0.5, **changes: Any) -> Wheel:
    wheel = Wheel(**changes)
    for n in range(1, 33):
        wheel.sample(speed, speed * n / 32)
    return wheel


@pytest.mark.parametrize("sign", [1, -1])
def test_a_velocity_that_drops_to_nothing_at_once_is_counted_while_nothing_moves(sign: int) -> None:
    wheel = fast(sign * 0.5)
    counts = [wheel.sample(sign * 0.5, 0.0) for _ in range(6)]
    assert [each.halted_samples for each in counts] == [1, 2, 3, 4, 5, 6]
    assert [each.trusted for each in counts] == [True] * 4 + [False] * 2
    assert counts[-1].velocity_jumps == 1


@pytest.mark.parametrize(("speed", "halts"), [(0.3125, False), (0.3126, True), (-0.3125, False), (-0.3126, True)])
def test_what_a_wheel_can_lose_in_a_cycle_is_no_halt(speed: float, halts: bool) -> None:
    wheel = Wheel()
    wheel.samples(3, speed, speed / 2)
    wheel.sample(speed, speed)
    assert (wheel.sample(speed, 0.0).halted_samples == 1) is halts


def test_one_bit_of_the_velocity_is_no_jolt() -> None:
    wheel = Wheel(mps_per_bit=-0.125)
    assert wheel.sample(0.5, 0.4375).velocity_jumps == 0
    assert Wheel(mps_per_bit=-0.125).sample(0.5, 0.4376).velocity_jumps == 1


def test_after_a_longer_time_more_can_be_lost_and_after_a_shorter_one_no_less() -> None:
    assert fast().sample(0.5, 0.0, cycles=2.0).halted_samples == 0
    assert fast().sample(0.5, 0.25, cycles=0.0).velocity_jumps == 0


FASTER = 2.0**-7 + 2.0**-12


@pytest.mark.parametrize(("velocity", "halted"), [(0.0, 1), (2.0**-7, 1), (-(2.0**-7), 1), (FASTER, 0), (-FASTER, 0)])
def test_slower_than_standstill_is_halted_and_faster_is_not(velocity: float, halted: int) -> None:
    assert fast().sample(0.5, velocity, rolls=0.0).halted_samples == halted


def test_a_wheel_that_moves_on_was_not_halted() -> None:
    wheel = fast()
    wheel.samples(3, 0.5, 0.0)
    assert wheel.sample(0.5, 0.25).halted_samples == 0
    assert wheel.samples(9, 0.5, 0.0).halted_samples == 0
    wheel = fast()
    wheel.samples(3, 0.5, 0.0)
    assert wheel.sample(0.5, 0.0, rolls=0.25).halted_samples == 0
    assert wheel.sample(0.5, 0.0).halted_samples == 0


def test_what_it_rolled_until_the_jolt_is_no_sign_of_life() -> None:
    wheel = fast()
    wheel.sample(0.5, 0.0, rolls=0.25)
    assert wheel.sample(0.5, 0.0, rolls=0.01).halted_samples == 2


def test_no_wheel_stands_at_once_when_it_is_ordered_to_either() -> None:
    wheel = fast()
    assert wheel.sample(0.0, 0.0).halted_samples == 1
    assert wheel.samples(20, 0.0, 0.0).halted_samples == 21


@pytest.mark.parametrize(("share", "halted"), [(0.5, 0), (0.51, 1), (-0.51, 1), (-0.5, 0), (0.0, 0)])
def test_a_velocity_that_was_an_error_itself_is_no_wheel_that_halts(share: float, halted: int) -> None:
    wheel = Wheel()
    wheel.sample(0.0, 0.5, rolls=share * 0.5)
    assert wheel.sample(0.0, 0.0).halted_samples == halted
    wheel = Wheel()
    wheel.sample(0.0, 0.5, known=False)
    assert wheel.sample(0.0, 0.0).halted_samples == 0


def test_before_the_first_sample_it_did_not_roll() -> None:
    last = Wheel(standstill_mps=1.0).sample(0.0, 0.5, rolls=0.0)
    assert (last.velocity_jumps, last.halted_samples) == (1, 0)


def test_without_power_to_turn_nothing_is_halted() -> None:
    wheel = fast()
    assert wheel.sample(0.5, 0.0, powered=False).halted_samples == 0
    assert wheel.samples(9, 0.5, 0.0).halted_samples == 0


def test_a_wheel_in_its_quick_stop_is_halted_and_jolted_as_well() -> None:
    wheel = fast()
    counts = [wheel.sample(0.5, 0.0, enabled=False) for _ in range(5)]
    assert [each.halted_samples for each in counts] == [1, 2, 3, 4, 5]
    assert [each.trusted for each in counts] == [True] * 4 + [False]
    wheel = Wheel()
    for n in range(6):
        last = wheel.sample(0.5, 0.5 * (n % 2), rolls=0.5, enabled=False)
    assert (last.velocity_jumps, last.trusted) == (5, False)


# --- jolts


def test_changes_that_no_wheel_can_do_are_counted_while_none_is_a_second_after_the_one_before() -> None:
    wheel = Wheel()
    for n in range(8):
        last = wheel.sample(0.5, 0.5 * (n % 2), rolls=0.5)
    assert (last.velocity_jumps, last.trusted) == (7, False)
    assert wheel.samples(62, 0.5, 0.5, rolls=0.5).velocity_jumps == 7
    assert wheel.sample(0.5, 0.5).velocity_jumps == 7
    assert wheel.sample(0.5, 0.5).velocity_jumps == 0


def test_of_few_jolts_a_sensor_may_still_be_trusted() -> None:
    wheel = Wheel()
    for n in range(5):
        last = wheel.sample(0.5, 0.5 * (n % 2), rolls=0.5)
    assert (last.velocity_jumps, last.trusted) == (4, True)
    last = wheel.sample(0.5, 0.5, rolls=0.5)
    assert (last.velocity_jumps, last.trusted) == (5, False)


def test_jolts_add_up_over_a_moment_without_power() -> None:
    """An encoder that comes and goes while its drive lets go after each order."""
    wheel = Wheel()
    for n in range(5):
        wheel.sample(0.5, 0.5 * (n % 2), rolls=0.5)
    assert wheel.samples(8, 0.0, 0.0, powered=False).velocity_jumps == 4
    assert wheel.sample(0.5, 0.5, rolls=0.5).velocity_jumps == 5
    assert not wheel.last.trusted


def test_a_jolt_after_a_long_time_is_the_first_again() -> None:
    wheel = fast()
    assert wheel.sample(0.5, 0.0).velocity_jumps == 1
    for n in range(70):
        wheel.sample(0.5, min(0.5, n / 64))
    assert wheel.sample(0.5, 0.0).velocity_jumps == 1
