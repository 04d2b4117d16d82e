"""What a wheel must show of its orders: samples every 1/64 s, 1 mm/s per bit. Times and speeds are binary fractions.

setpoint   ▁▁████████████████
encoder    ▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁
unseen       ▁▁▁▁▂▃▄▅▆▇█       0.25 s after the lag of 1/8 s, and 1/16 m of ordered travel
"""

from __future__ import annotations

from typing import Any

import pytest

from canbase_watchdog.motion_evidence import Evidence
from support.evidence_wheel import HZ, Wheel, rolling


def test_at_the_start_nothing_speaks_against_a_wheel() -> None:
    assert Wheel().last == Evidence(trusted=True, unseen=False)


def test_before_the_first_setpoint_nothing_is_ordered() -> None:
    watch = Wheel().watch
    watch.on_sample(0.0, 0.0, True, True, 1 / HZ, 1 / HZ)
    assert watch.last == Evidence()


@pytest.mark.parametrize("sign", [1, -1])
def test_a_wheel_that_shows_nothing_of_its_order_any_more_is_unseen_after_the_time(sign: int) -> None:
    wheel = rolling(sign * 0.25)
    last = wheel.samples(15, sign * 0.25, 0.0)
    assert (last.unseen, last.trusted, last.unseen_s, last.setpoint_mps) == (False, True, 15 / HZ, sign * 0.25)
    last = wheel.sample(sign * 0.25, 0.0)
    assert (last.unseen, last.trusted, last.unseen_s, last.unseen_m) == (True, False, 0.25, 0.0625)


@pytest.mark.parametrize("sign", [1, -1])
def test_from_a_stand_it_has_the_lag_besides(sign: int) -> None:
    wheel = Wheel()
    assert wheel.samples(9, sign * 0.25, 0.0).unseen_s == 0.0
    assert not wheel.samples(15, sign * 0.25, 0.0).unseen
    assert wheel.sample(sign * 0.25, 0.0).unseen


def test_a_slow_order_needs_its_way_too() -> None:
    wheel = rolling(2.0**-6)
    assert not wheel.samples(254, 2.0**-6, 0.0).unseen  # one more since its last sign of life
    assert wheel.sample(2.0**-6, 0.0).unseen  # 1/64 m/s for 4 s


def test_of_a_coarse_encoder_four_increments_are_waited_for() -> None:
    wheel = rolling(m_per_count=-(2.0**-5))
    assert not wheel.samples(31, 0.25, 0.0).unseen
    assert wheel.sample(0.25, 0.0).unseen  # 1/8 m


@pytest.mark.parametrize(("setpoint", "counts"), [(2.0**-7, False), (-(2.0**-7), False), (2.0**-7 + 2.0**-12, True)])
def test_what_is_no_faster_than_standstill_need_not_be_seen_in_time(setpoint: float, counts: bool) -> None:
    last = Wheel().samples(20, setpoint, 0.0)
    assert (last.unseen_s > 0.0) is counts
    assert last.unseen_m == pytest.approx(20 * abs(setpoint) / HZ)


@pytest.mark.parametrize("sign", [1, -1])
def test_an_order_may_be_as_slow_as_it_likes_and_has_to_be_seen_on_its_way(sign: int) -> None:
    wheel = Wheel()
    last = wheel.samples(512, sign * 2.0**-7, 0.0)  # 1/128 m/s for 8 s are 1/16 m
    assert (last.unseen_s, last.unseen_m, last.unseen) == (1 / HZ, 0.0625, False)
    assert not wheel.samples(14, sign * 2.0**-7, 0.0).unseen
    assert wheel.sample(sign * 2.0**-7, 0.0).unseen


@pytest.mark.parametrize("sign", [1, -1])
def test_an_encoder_that_moves_lives_whatever_the_direction(sign: int) -> None:
    wheel = rolling()
    wheel.samples(15, 0.25, 0.0)
    last = wheel.sample(0.25, 0.0, rolls=sign * 0.25)
    assert (last.unseen_s, last.unseen_m) == (0.0, 0.0)
    last = wheel.sample(0.25, 0.0, rolls=0.0)
    assert (last.unseen_s, last.unseen_m) == (1 / HZ, 0.25 / HZ)


@pytest.mark.parametrize(
    ("m_per_count", "missing_m", "life_m"),
    [
        (2.0**-10, 2.0**-4, 2.0**-9),
        (-(2.0**-10), 2.0**-4, 2.0**-9),
        (2.0**-13, 2.0**-4, 0.001),
        (2.0**-20, 0.005, 0.001),
        (2.0**-20, 0.001, 0.0002),
    ],
)
def test_a_millimetre_or_two_increments_are_a_sign_of_life(m_per_count: float, missing_m: float, life_m: float) -> None:
    for step_m, lives in ((life_m, True), (life_m * 0.999, False)):
        wheel = rolling(m_per_count=m_per_count, motion_missing_m=missing_m)
        wheel.sample(0.25, 0.0)
        assert (wheel.sample(0.25, 0.0, rolls=step_m * HZ).unseen_s == 0.0) is lives


def test_small_steps_one_way_add_up_to_a_sign_of_life_and_noise_does_not() -> None:
    creeps, trembles = rolling(), rolling()
    for n in range(12):
        creeps.sample(0.25, 0.0, rolls=2.0**-12 * HZ)
        trembles.sample(0.25, 0.0, rolls=(-1) ** n * 2.0**-12 * HZ)
    assert creeps.last.unseen_s < 5 / HZ
    assert trembles.last.unseen_s == 12 / HZ


@pytest.mark.parametrize("jitter_m", [0.0002, 0.0005, 0.0009])
def test_an_encoder_that_jitters_and_goes_nowhere_is_unseen(jitter_m: float) -> None:
    """Dead, with 0.2 to 0.9 mm of noise from one sample to the next, at a slow order: 0.05 m/s, 0.8 mm a cycle."""
    wheel = Wheel(motion_missing_m=0.005)
    for n in range(40):
        wheel.sample(0.05, 0.0, rolls=(-1) ** n * jitter_m * HZ)
        if wheel.last.unseen:
            break
    assert wheel.last.unseen
    assert n <= 25  # the lag, and 0.25 s


def test_the_travel_of_short_orders_adds_up_and_then_the_time_does_without_an_order() -> None:
    wheel = Wheel()
    for n in range(1, 4):
        wheel.samples(4, 0.25, 0.0)
        last = wheel.samples(30, 0.0, 0.0)
        assert (last.unseen_s, last.unseen_m) == (0.0, n / HZ)
    last = wheel.samples(4, 0.25, 0.0)
    assert (last.unseen_s, last.unseen_m) == (1 / HZ, 0.0625)
    assert not wheel.samples(14, 0.0, 0.0).unseen
    assert wheel.sample(0.0, 0.0).unseen


@pytest.mark.parametrize("off", [{"powered": False}, {"enabled": False}])
def test_of_drives_that_are_not_enabled_most_of_the_way_is_remembered(off: dict[str, bool]) -> None:
    wheel = rolling()
    wheel.samples(15, 0.25, 0.0)
    last = wheel.samples(3, 0.25, 0.0, **off)
    assert (last.unseen_s, last.unseen_m, last.unseen, last.trusted) == (0.0, 14 / 256, False, True)
    assert wheel.samples(99, 0.0, 0.0).unseen_s == 0.0
    assert wheel.samples(16, 0.25, 0.0).unseen_m == 30 / 256
    assert wheel.sample(0.25, 0.0).unseen
    wheel = rolling()
    wheel.samples(4, 0.25, 0.0)
    assert wheel.sample(0.25, 0.0, **off).unseen_m == 1 / 64


@pytest.mark.parametrize("off", [{"powered": False}, {"enabled": False}])
def test_a_wheel_that_is_pushed_without_power_shows_that_its_encoder_lives(off: dict[str, bool]) -> None:
    wheel = rolling()
    wheel.samples(15, 0.25, 0.0)
    assert wheel.sample(0.25, 0.0, rolls=0.25, **off).unseen_m == 0.0


def test_a_step_that_is_not_known_neither_counts_nor_forgets() -> None:
    wheel = rolling()
    wheel.samples(5, 0.25, 0.0)
    last = wheel.samples(50, 0.25, 0.0, known=False)
    assert (last.unseen_s, last.unseen_m) == (5 / HZ, 5 / 256)


def test_a_reset_trusts_the_sensor_again() -> None:
    wheel = rolling()
    wheel.sample(0.25, 0.0, rolls=2.0**-13 * HZ)
    wheel.samples(16, 0.25, 0.0)
    assert not wheel.samples(3, 0.25, 0.25).trusted
    assert not wheel.samples(3, 0.25, 0.25, enabled=False).trusted
    wheel.sample(0.25, 0.0, rolls=2.0**-13 * HZ)
    wheel.watch.trust()
    assert wheel.last == Evidence()
    wheel.samples(15, 0.25, 0.0)
    assert wheel.sample(0.25, 0.0, rolls=2.0**-13 * HZ).unseen


def test_a_sensor_that_contradicts_itself_is_doubted_until_a_reset() -> None:
    wheel = Wheel()
    wheel.samples(4, 0.25, 0.25)
    wheel.watch.doubt()
    assert not wheel.samples(50, 0.25, 0.25).trusted
    wheel.watch.trust()
    assert wheel.samples(50, 0.25, 0.25).trusted


def held_until_its_order_has_gone(**changes: Any) -> Wheel:
    """Against a threshold for 12/64 s; then zero is commanded, and it is free."""
    wheel = rolling(0.5, **changes)
    last = wheel.samples(12, 0.5, 0.0, torque=1.0)
    assert (last.unseen_s, last.unseen_m) == (12 / HZ, 6 / HZ)
    return wheel


@pytest.mark.parametrize("creep", [0.0, 2.0**-9, 2.0**-4])
@pytest.mark.parametrize(
    ("torque", "samples"), [(None, 4), (1.0, 4), (-0.51, 4), (0.5, 8), (-0.5, 8), (0.25, 16), (0.1, 16), (0.0, 16)]
)
def test_of_a_slow_order_the_time_is_one_at_rated_torque_or_longer_at_less(
    creep: float, torque: float | None, samples: int
) -> None:
    """4/64 s are left; a wheel that takes no torque at all has four times as much."""
    wheel = held_until_its_order_has_gone()
    assert not wheel.samples(samples - 1, creep, 0.0, torque=torque).unseen
    assert wheel.sample(creep, 0.0, torque=torque).unseen


@pytest.mark.parametrize(("velocity", "samples"), [(2.0**-7, 16), (2.0**-6, 4), (-(2.0**-6), 4)])
def test_a_velocity_without_travel_is_no_wheel_that_friction_holds(velocity: float, samples: int) -> None:
    wheel = held_until_its_order_has_gone()
    assert not wheel.samples(samples - 1, 0.0, velocity, rolls=0.0, torque=0.25).unseen
    assert wheel.sample(0.0, velocity, rolls=0.0, torque=0.25).unseen


def test_a_wheel_that_just_begins_to_roll_has_its_time() -> None:
    wheel = held_until_its_order_has_gone()
    assert wheel.samples(2, 0.0, 2.0**-6, rolls=2.0**-6, torque=0.25).unseen_s == 12.5 / HZ
    other = held_until_its_order_has_gone()
    assert other.samples(2, 0.0, 2.0**-6, rolls=2.0**-6).unseen_s == 14 / HZ  # without a torque nothing bounds it


@pytest.mark.parametrize(
    ("ordered", "velocity", "rolls", "weight"),
    [
        (60, 2.0**-6, 2.0**-6, 0.25),
        (63, 2.0**-6, 2.0**-6, 0.25),
        (64, 2.0**-6, 2.0**-6, 1.0),  # 1/16 m were ordered: it has had its time to begin
        (60, 2.0**-6, 2.0**-7, 1.0),
        (60, 2.0**-6, 0.0, 1.0),
        (60, 2.0**-7, 2.0**-7, 1.0),
        (60, -(2.0**-6), -(2.0**-6), 1.0),
        (60, 0.0, 0.0, 1.0),
    ],
)
def test_a_wheel_that_tells_no_torque_has_less_time_while_it_begins_to_roll_as_ordered(
    ordered: int, velocity: float, rolls: float, weight: float
) -> None:
    """Ordered 1/1024 m a sample."""
    wheel = Wheel(motion_missing_s=4.0)
    before_s = wheel.samples(ordered - 1, 2.0**-4, 0.0).unseen_s
    last = wheel.sample(2.0**-4, velocity, rolls=rolls)
    assert last.unseen_m == ordered / 1024
    assert last.unseen_s - before_s == weight / HZ


def test_of_a_faster_order_each_moment_counts_whatever_the_torque_is() -> None:
    """Faster than twice the tolerance of motion, 1/16 m/s; the lag is 8 samples."""
    wheel = held_until_its_order_has_gone()
    wheel.sample(0.0, 0.0, torque=0.25)
    assert wheel.samples(8, 2.0**-2, 0.0, torque=0.25).unseen_s == (12 + 9 * 0.25) / HZ
    last = wheel.sample(2.0**-2, 0.0, torque=0.25)
    assert (last.unseen_s, last.unseen) == ((12 + 10 * 0.25) / HZ, False)
    last = wheel.sample(2.0**-2, 0.0, torque=0.25)
    assert (last.unseen_s, last.unseen) == ((12 + 10 * 0.25 + 1) / HZ, False)
    assert wheel.sample(2.0**-2, 0.0, torque=0.25).unseen


@pytest.mark.parametrize(("share", "weight"), [(1.0, 0.25), (1.001, 1.0)])
def test_an_order_is_slow_up_to_twice_what_a_velocity_may_be_off(share: float, weight: float) -> None:
    wheel = held_until_its_order_has_gone()
    order_mps = share * 2.0 * 2.0**-4  # 606Ch of this drive has no bits to lose
    before_s = wheel.samples(9, order_mps, 0.0, torque=0.25).unseen_s
    assert wheel.sample(order_mps, 0.0, torque=0.25).unseen_s - before_s == pytest.approx(weight / HZ)


@pytest.mark.parametrize("sign", [1, -1])
def test_an_order_to_the_other_side_counts_apart(sign: int) -> None:
    """Held for 12/64 s with 1/2 m/s; then 1/16 m/s to the other side, of which the lag's nine samples do not count."""
    wheel = rolling(sign * 0.5)
    wheel.samples(12, sign * 0.5, 0.0)
    last = wheel.sample(-sign * 2.0**-4, 0.0)
    assert (last.unseen_s, last.unseen_m, last.both_m) == (0.0, 2.0**-4 / HZ, 6.0625 / HZ)
    last = wheel.samples(8 + 8, -sign * 2.0**-4, 0.0)
    assert (last.unseen, last.unseen_s, last.unseen_m) == (False, 8 / HZ, 17 * 2.0**-4 / HZ)


def test_orders_to_and_fro_have_twice_the_travel_in_all() -> None:
    """1/8 m, of 1/16 m each way, and 0.25 s since the first 1/16 m."""
    wheel = rolling(0.5)
    last = wheel.samples(7, 0.5, 0.0)
    assert (last.both_s, last.both_m) == (0.0, 3.5 / HZ)
    last = wheel.samples(4, -0.5, 0.0)
    assert (last.both_s, last.both_m) == (4 / HZ, 5.5 / HZ)
    last = wheel.samples(4, 0.5, 0.0)
    assert (last.both_s, last.both_m, last.unseen) == (8 / HZ, 7.5 / HZ, False)
    last = wheel.samples(7, -0.5, 0.0)
    assert (last.both_s, last.both_m, last.unseen) == (15 / HZ, 11 / HZ, False)
    last = wheel.sample(0.5, 0.0)
    assert (last.both_s, last.unseen_s, last.unseen) == (16 / HZ, 0.0, True)


def test_slow_orders_to_and_fro_need_their_way() -> None:
    """1/32 m/s, 32 samples each way: 8 of them are 1/8 m."""
    wheel = rolling(2.0**-5)
    for n in range(7):
        assert not wheel.samples(32, (-1) ** n * 2.0**-5, 0.0).unseen
    assert not wheel.samples(30, -(2.0**-5), 0.0).unseen
    assert wheel.samples(2, -(2.0**-5), 0.0).unseen


def test_the_first_turn_has_no_time_until_a_millimetre_was_ordered_that_way() -> None:
    """1/64 m/s are 1/4 mm a sample. Its drive has to turn its torque round; who turns again has had that time."""
    wheel = rolling(0.5)
    before_s = wheel.samples(12, 0.5, 0.0).both_s
    assert before_s > 0.0
    assert wheel.samples(4, -(2.0**-6), 0.0).both_s == before_s
    assert wheel.samples(2, -(2.0**-6), 0.0).both_s == before_s + 2 / HZ
    assert wheel.samples(2, 2.0**-6, 0.0).both_s == before_s + 4 / HZ
    wheel.sample(0.0, 2.0**-2)
    assert wheel.last.both_s == 0.0
    before_s = wheel.samples(12, 0.5, 0.0).both_s
    assert wheel.samples(4, -(2.0**-6), 0.0).both_s == before_s


def test_most_of_the_time_outlives_the_power_too() -> None:
    """A drive that lets go after each order is found all the same: nothing of 1/8 m and an eighth of 0.25 s is left."""
    wheel = rolling(0.5)
    wheel.samples(15, 0.5, 0.0)
    wheel.samples(10, -0.5, 0.0)
    last = wheel.sample(0.0, 0.0, powered=False)
    assert (last.unseen_m, last.both_s, last.both_m) == (0.875 * 2.0**-4, 0.875 * 0.25, 2.0**-3)
    assert not wheel.samples(1, 0.5, 0.0).unseen
    assert wheel.samples(1, -0.5, 0.0).unseen


def test_short_orders_add_up_however_little_each_of_them_asks_for() -> None:
    """Taps of 3/256 m, each with a let-go: eleven of them are 1/8 m."""
    wheel = rolling(0.25)
    for _ in range(10):
        assert not wheel.samples(3, 0.25, 0.0).unseen
        wheel.samples(2, 0.0, 0.0, powered=False)
    assert wheel.samples(3, 0.25, 0.0).unseen


def test_a_sign_of_life_begins_both_directions_anew() -> None:
    wheel = rolling(0.5)
    wheel.samples(12, 0.5, 0.0)
    wheel.samples(12, -0.5, 0.0)
    last = wheel.sample(-0.5, 0.0, rolls=0.25)
    assert (last.unseen_s, last.unseen_m, last.both_s, last.both_m) == (0.0, 0.0, 0.0, 0.0)
    last = wheel.sample(0.5, 0.0)
    assert last.unseen_m == last.both_m == 0.5 / HZ


def test_while_nothing_is_ordered_of_any_wheel_and_none_moves_its_drive_has_to_let_go_instead() -> None:
    wheel = held_until_its_order_has_gone()
    wheel.watch.on_sync(rests=True)
    assert wheel.samples(640, 0.0, 0.0).unseen_s == 12 / HZ
    wheel.watch.on_sync(rests=False)
    assert not wheel.samples(3, 0.0, 0.0).unseen
    assert wheel.sample(0.0, 0.0).unseen


def test_without_the_proof_by_letting_go_it_counts_at_rest_too() -> None:
    wheel = held_until_its_order_has_gone(stand_proof=False)
    wheel.watch.on_sync(rests=True)
    assert not wheel.samples(3, 0.0, 0.0).unseen
    assert wheel.sample(0.0, 0.0).unseen


# places that are a sign of life apart, whatever it did between them
def test_a_wheel_that_turns_round_lives_by_the_way_from_where_it_turned() -> None:
    wheel = rolling(0.5)
    life_m = wheel.watch._life_m
    wheel.sample(0.5, 0.0, rolls=-0.75 * life_m * HZ)
    assert wheel.last.unseen_m > 0.0
    wheel.sample(0.5, 0.0, rolls=0.75 * life_m * HZ)
    assert wheel.last.unseen_m > 0.0
    wheel.sample(0.5, 0.0, rolls=0.25 * life_m * HZ)
    assert wheel.last.unseen_m == 0.0
