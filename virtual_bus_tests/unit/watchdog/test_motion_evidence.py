"""What a wheel must show of its orders: samples every 1/64 s, 1 mm/s per bit. Times and speeds are binary fractions.

setpoint   ▁▁████████████████
encoder    ▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁▁
unseen       ▁▁▁▁▂▃▄▅▆▇█       0.25 s after the lag of 1/8 s, and 1/16 m of ordered travel
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from canbase_watchdog.motion_evidence import Evidence, EvidenceWatch
from support.watchdog_story import config

HZ = 64.0
CONFIG = replace(
    config(),
    control_hz=HZ,
    drive_lag_s=0.125,
    standstill_mps=2.0**-7,
    motion_tolerance_mps=0.0625,
    motion_missing_s=0.25,
    motion_missing_m=2.0**-4,
    jolt_mps2=16.0,
    slow_wheel_share=0.25,
    slow_wheel_s=0.5,
    slowest_ramp_mps2=0.5,
)


class Wheel:
    """An enabled wheel on the table."""

    def __init__(self, m_per_count: float = 2.0**-13, mps_per_bit: float = 0.0, **changes: Any) -> None:
        drive = replace(CONFIG.drives[0], mps_per_bit=mps_per_bit, m_per_count=m_per_count)
        self.watch = EvidenceWatch(drive, replace(CONFIG, **changes), 0.0)
        self.n = 0

    @property
    def last(self) -> Evidence:
        return self.watch.last

    def sample(
        self,
        setpoint: float,
        velocity: float,
        *,
        rolls: float | None = None,
        enabled: bool = True,
        powered: bool = True,
        known: bool = True,
        cycles: float = 1.0,
        torque: float | None = None,
    ) -> Evidence:
        """One cycle. The encoder rolls like the velocity unless it is told otherwise."""
        self.n += 1
        now_s, elapsed_s = self.n / HZ, cycles / HZ
        self.watch.on_setpoint(setpoint, now_s)
        step_m = (velocity if rolls is None else rolls) * elapsed_s
        self.watch.on_sample(
            velocity, step_m if known else None, powered, enabled and powered, elapsed_s, now_s, torque
        )
        return self.last

    def samples(self, count: int, setpoint: float, velocity: float, **how: Any) -> Evidence:
        for _ in range(count):
            self.sample(setpoint, velocity, **how)
        return self.last


# --- 1: ordered to move, and nothing moves


def test_at_the_start_nothing_speaks_against_a_wheel() -> None:
    assert Wheel().last == Evidence(trusted=True, unseen=False, ghost=False)


def test_before_the_first_setpoint_nothing_is_ordered() -> None:
    watch = Wheel().watch
    watch.on_sample(0.0, 0.0, True, True, 1 / HZ, 1 / HZ)
    assert watch.last == Evidence()


def rolling(setpoint: float = 0.25, **changes: Any) -> Wheel:
    """It has followed its order for longer than the lag."""
    wheel = Wheel(**changes)
    wheel.samples(16, setpoint, setpoint / 2, rolls=setpoint)
    return wheel


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
    """Against a threshold for 12/64 s; then zero is ordered, and it is free."""
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


# --- 2: halted at once. 16 m/s² in 1/64 s are 0.25 m/s, and 0.0625 m/s tolerance


def fast(speed: float = 0.5, **changes: Any) -> Wheel:
    wheel = Wheel(**changes)
    for n in range(1, 33):
        wheel.sample(speed, speed * n / 32)
    return wheel


@pytest.mark.parametrize("sign", [1, -1])
def test_a_velocity_that_drops_to_nothing_at_once_is_counted_while_nothing_moves(sign: int) -> None:
    wheel = fast(sign * 0.5)
    counts = [wheel.sample(sign * 0.5, 0.0) for _ in range(6)]
    assert [each.halted for each in counts] == [1, 2, 3, 4, 5, 6]
    assert [each.trusted for each in counts] == [True] * 4 + [False] * 2
    assert counts[-1].jolts == 1


@pytest.mark.parametrize(("speed", "halts"), [(0.3125, False), (0.3126, True), (-0.3125, False), (-0.3126, True)])
def test_what_a_wheel_can_lose_in_a_cycle_is_no_halt(speed: float, halts: bool) -> None:
    wheel = Wheel()
    wheel.samples(3, speed, speed / 2)
    wheel.sample(speed, speed)
    assert (wheel.sample(speed, 0.0).halted == 1) is halts


def test_one_bit_of_the_velocity_is_no_jolt() -> None:
    wheel = Wheel(mps_per_bit=-0.125)
    assert wheel.sample(0.5, 0.4375).jolts == 0
    assert Wheel(mps_per_bit=-0.125).sample(0.5, 0.4376).jolts == 1


def test_after_a_longer_time_more_can_be_lost_and_after_a_shorter_one_no_less() -> None:
    assert fast().sample(0.5, 0.0, cycles=2.0).halted == 0
    assert fast().sample(0.5, 0.25, cycles=0.0).jolts == 0


FASTER = 2.0**-7 + 2.0**-12


@pytest.mark.parametrize(("velocity", "halted"), [(0.0, 1), (2.0**-7, 1), (-(2.0**-7), 1), (FASTER, 0), (-FASTER, 0)])
def test_slower_than_standstill_is_halted_and_faster_is_not(velocity: float, halted: int) -> None:
    assert fast().sample(0.5, velocity, rolls=0.0).halted == halted


def test_a_wheel_that_moves_on_was_not_halted() -> None:
    wheel = fast()
    wheel.samples(3, 0.5, 0.0)
    assert wheel.sample(0.5, 0.25).halted == 0
    assert wheel.samples(9, 0.5, 0.0).halted == 0
    wheel = fast()
    wheel.samples(3, 0.5, 0.0)
    assert wheel.sample(0.5, 0.0, rolls=0.25).halted == 0
    assert wheel.sample(0.5, 0.0).halted == 0


def test_what_it_rolled_until_the_jolt_is_no_sign_of_life() -> None:
    wheel = fast()
    wheel.sample(0.5, 0.0, rolls=0.25)
    assert wheel.sample(0.5, 0.0, rolls=0.01).halted == 2


def test_no_wheel_stands_at_once_when_it_is_ordered_to_either() -> None:
    wheel = fast()
    assert wheel.sample(0.0, 0.0).halted == 1
    assert wheel.samples(20, 0.0, 0.0).halted == 21


@pytest.mark.parametrize(("share", "halted"), [(0.5, 0), (0.51, 1), (-0.51, 1), (-0.5, 0), (0.0, 0)])
def test_a_velocity_that_was_an_error_itself_is_no_wheel_that_halts(share: float, halted: int) -> None:
    wheel = Wheel()
    wheel.sample(0.0, 0.5, rolls=share * 0.5)
    assert wheel.sample(0.0, 0.0).halted == halted
    wheel = Wheel()
    wheel.sample(0.0, 0.5, known=False)
    assert wheel.sample(0.0, 0.0).halted == 0


def test_before_the_first_sample_it_did_not_roll() -> None:
    last = Wheel(standstill_mps=1.0).sample(0.0, 0.5, rolls=0.0)
    assert (last.jolts, last.halted) == (1, 0)


def test_without_power_to_turn_nothing_is_halted() -> None:
    wheel = fast()
    assert wheel.sample(0.5, 0.0, powered=False).halted == 0
    assert wheel.samples(9, 0.5, 0.0).halted == 0


def test_a_wheel_in_its_quick_stop_is_halted_and_jolted_as_well() -> None:
    wheel = fast()
    counts = [wheel.sample(0.5, 0.0, enabled=False) for _ in range(5)]
    assert [each.halted for each in counts] == [1, 2, 3, 4, 5]
    assert [each.trusted for each in counts] == [True] * 4 + [False]
    wheel = Wheel()
    for n in range(6):
        last = wheel.sample(0.5, 0.5 * (n % 2), rolls=0.5, enabled=False)
    assert (last.jolts, last.trusted) == (5, False)


# --- 3: jolts


def test_changes_that_no_wheel_can_do_are_counted_while_none_is_a_second_after_the_one_before() -> None:
    wheel = Wheel()
    for n in range(8):
        last = wheel.sample(0.5, 0.5 * (n % 2), rolls=0.5)
    assert (last.jolts, last.trusted) == (7, False)
    assert wheel.samples(62, 0.5, 0.5, rolls=0.5).jolts == 7
    assert wheel.sample(0.5, 0.5).jolts == 7
    assert wheel.sample(0.5, 0.5).jolts == 0


def test_of_few_jolts_a_sensor_may_still_be_trusted() -> None:
    wheel = Wheel()
    for n in range(5):
        last = wheel.sample(0.5, 0.5 * (n % 2), rolls=0.5)
    assert (last.jolts, last.trusted) == (4, True)
    last = wheel.sample(0.5, 0.5, rolls=0.5)
    assert (last.jolts, last.trusted) == (5, False)


def test_jolts_add_up_over_a_moment_without_power() -> None:
    """An encoder that comes and goes while its drive lets go after each order."""
    wheel = Wheel()
    for n in range(5):
        wheel.sample(0.5, 0.5 * (n % 2), rolls=0.5)
    assert wheel.samples(8, 0.0, 0.0, powered=False).jolts == 4
    assert wheel.sample(0.5, 0.5, rolls=0.5).jolts == 5
    assert not wheel.last.trusted


def test_a_jolt_after_a_long_time_is_the_first_again() -> None:
    wheel = fast()
    assert wheel.sample(0.5, 0.0).jolts == 1
    for n in range(70):
        wheel.sample(0.5, min(0.5, n / 64))
    assert wheel.sample(0.5, 0.0).jolts == 1


# --- 4: a velocity without travel


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


# --- 5: slower than the least that the setpoints ask for


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


# --- 6: all the torque, and no gain


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
