"""Torque that changes with nothing ordered, without a count of the encoder. A sample each 1/64 s, 1/8 s × rated."""

from __future__ import annotations

import pytest

from canbase_watchdog.unasked_torque import UnaskedTorque

HZ, LIMIT_S = 64.0, 0.125
COUNT_M = 2.0**-17


class Wheel:
    def __init__(self) -> None:
        self.watch = UnaskedTorque(-COUNT_M, LIMIT_S)

    def run(self, samples: int, share: float | None, *, rests: bool = True, step_m: float = 0.0) -> UnaskedTorque:
        for _ in range(samples):
            self.watch.on_step(step_m)
            self.watch.on_torque(share, rests, 1.0 / HZ)
        return self.watch

    def held(self, share: float = 0.25) -> Wheel:
        self.run(8, share)
        return self


@pytest.mark.parametrize(("share", "samples"), [(0.75, 16), (-0.25, 16), (0.5, 32), (-1.0, 7)])
def test_the_change_times_the_time_is_what_counts(share: float, samples: int) -> None:
    wheel = Wheel().held()
    assert not wheel.run(samples - 1, share).is_due
    assert wheel.run(1, share).is_due
    assert wheel.run(50, share).unasked_s == LIMIT_S


@pytest.mark.parametrize(("share", "counts"), [(0.351, True), (0.349, False), (0.149, True), (0.151, False)])
def test_a_tenth_of_the_rated_torque_may_be_noise(share: float, counts: bool) -> None:
    assert (Wheel().held().run(1, share).unasked_s > 0.0) is counts


@pytest.mark.parametrize(("share", "counts"), [(0.01, True), (-0.01, True), (0.009, False), (0.0, False)])
def test_a_motor_without_torque_moves_nothing(share: float, counts: bool) -> None:
    assert (Wheel().held().run(1, share).unasked_s > 0.0) is counts


def test_a_change_that_comes_back_is_forgotten() -> None:
    wheel = Wheel().held()
    wheel.run(15, 0.75)
    assert wheel.run(1, 0.25).unasked_s == 0.0


@pytest.mark.parametrize(("share", "counts"), [(0.6, False), (0.61, True), (-0.6, False), (-0.61, True)])
def test_what_is_more_than_a_slope_takes_holds_no_wheel(share: float, counts: bool) -> None:
    assert (Wheel().run(1, share).unasked_s > 0.0) is counts


def test_what_holds_it_is_known_a_tenth_of_a_second_after_the_power_or_the_last_count() -> None:
    wheel = Wheel()
    wheel.run(6, 0.0)
    assert wheel.run(1, 0.4).unasked_s == 0.0  # 0.094 s
    assert wheel.run(1, 0.0).unasked_s == 0.0
    assert wheel.run(1, 0.1).unasked_s > 0.0
    wheel.run(1, 0.1, step_m=2 * COUNT_M)
    wheel.run(6, 0.3)
    assert wheel.run(1, 0.1).unasked_s > 0.0


@pytest.mark.parametrize(("share", "rests"), [(None, True), (0.9, False)])
def test_an_order_or_a_torque_that_is_not_reported_begins_anew(share: float | None, rests: bool) -> None:
    wheel = Wheel().held()
    wheel.run(50, 0.75)
    assert wheel.run(1, share, rests=rests).unasked_s == 0.0
    assert wheel.run(7, 0.5).unasked_s == 0.0


def released(wheel: Wheel, step_m: float = 0.0) -> None:
    wheel.watch.on_step(step_m)
    wheel.watch.release()


def test_half_of_the_limit_before_and_after_a_release_is_a_dead_sensor() -> None:
    """The driver releases at three quarters."""
    wheel = Wheel().held()
    assert wheel.run(7, 0.75).times == 0
    assert wheel.run(5, 0.75).times == 1
    released(wheel)
    wheel.held()
    assert not wheel.run(7, 0.75).is_dead
    assert wheel.run(1, 0.75).is_dead
    assert not wheel.watch.is_due


def test_without_a_release_it_is_one_time() -> None:
    wheel = Wheel().held()
    for _ in range(3):
        wheel.run(12, 0.75)
        wheel.run(1, 0.25)
    assert wheel.watch.times == 1


@pytest.mark.parametrize(("counts", "dead"), [(1, True), (2, False), (-2, False)])
def test_a_count_of_the_encoder_ends_it(counts: int, dead: bool) -> None:
    wheel = Wheel().held()
    wheel.run(12, 0.75)
    released(wheel, counts * COUNT_M)
    assert wheel.held().run(12, 0.75).is_dead is dead


def test_a_reset_begins_anew() -> None:
    wheel = Wheel().held()
    wheel.run(20, 0.75)
    wheel.watch.trust()
    assert (wheel.watch.times, wheel.watch.unasked_s) == (0, 0.0)
    assert wheel.held().run(12, 0.75).times == 1
