"""When the watchdog takes a wheel for standing: encoder and velocity together. Samples each 10 ms, times in s.

A rim slower than 5 mm/s stands; up to 50 mm/s is noise if the encoder stays where it is for 0.2 s.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field, replace

import pytest

from canbase_watchdog.standstill import GAP_S, STILL_S, StandstillWatch
from canbase_watchdog.watchdog import State
from support.watchdog_story import FakeDrive, Story, config

CONFIG = config()
COUNT_M = CONFIG.drives[0].m_per_count  # 0.1 mm
CYCLE_S = 0.01


@dataclass
class Wheel:
    now_s: float = 100.0
    at_m: float = 0.0
    watch: StandstillWatch = field(default_factory=lambda: StandstillWatch(CONFIG.drives[0], CONFIG))

    def turns(self, seconds: float, encoder_mps: float, velocity_mps: float, noise_mps: float = 0.0) -> bool:
        noise = random.Random(1)
        for _ in range(round(seconds / CYCLE_S)):
            self.now_s += CYCLE_S
            self.at_m += encoder_mps * CYCLE_S
            self.watch.on_position(round(self.at_m / COUNT_M), self.now_s)
            self.watch.on_velocity(velocity_mps + noise.uniform(-noise_mps, noise_mps), self.now_s + 0.0002)
        return self.watch.stands


def test_what_has_not_come_yet_moves() -> None:
    watch = Wheel().watch
    assert not watch.stands
    watch.on_velocity(0.0, 100.0)
    assert not watch.stands
    watch.on_position(5, 100.01)
    assert not watch.stands
    watch.on_position(5, 100.02)
    assert watch.stands


@pytest.mark.parametrize(
    ("encoder_mps", "velocity_mps", "stands"),
    [
        (0.0, 0.0, True),
        (0.0045, 0.005, True),
        (-0.0045, -0.005, True),
        (0.3, 0.0, False),  # the velocity says that it stands, the encoder does not
        (-0.3, 0.0, False),
        (0.015, 0.0, False),  # slower than a step shows
        (-0.015, 0.0, False),
        (0.0, 0.3, False),  # the encoder has stopped, the velocity says that it turns
        (0.0, 0.051, False),
        (0.0, -0.051, False),
        (0.0, 0.05, True),
        (0.1, 0.05, False),
    ],
)
def test_encoder_and_velocity_both_count(encoder_mps: float, velocity_mps: float, stands: bool) -> None:
    assert Wheel().turns(1.0, encoder_mps, velocity_mps) is stands


@pytest.mark.parametrize("noise_mps", [0.006, 0.02, 0.05])
def test_noise_at_standstill_is_no_motion(noise_mps: float) -> None:
    wheel = Wheel()
    wheel.turns(0.5, 0.3, 0.3)
    wheel.turns(STILL_S + 0.05, 0.0, 0.0, noise_mps)
    assert all(wheel.turns(CYCLE_S, 0.0, 0.0, noise_mps) for _ in range(300))


def test_a_wheel_that_has_stopped_stands_with_its_second_slow_sample() -> None:
    wheel = Wheel()
    assert not wheel.turns(1.0, 0.3, 0.3)
    speed_mps = 0.3
    while speed_mps > 0.005:
        speed_mps -= 0.005
        assert not wheel.turns(CYCLE_S, speed_mps, max(speed_mps, 0.0051))
    assert wheel.turns(2 * CYCLE_S, 0.0, 0.0)


def test_a_noisy_one_stands_after_a_fifth_of_a_second() -> None:
    wheel = Wheel()
    wheel.turns(1.0, 0.3, 0.3)
    assert not wheel.turns(STILL_S - 2 * CYCLE_S, 0.0, 0.02)
    assert wheel.turns(4 * CYCLE_S, 0.0, 0.02)


def test_a_wheel_that_creeps_under_a_velocity_of_zero_moves_from_its_first_millimetre_on() -> None:
    wheel = Wheel()
    wheel.turns(1.0, 0.3, 0.3)
    wheel.turns(0.09, 0.012, 0.0)
    assert not wheel.turns(0.03, 0.012, 0.0)
    assert not wheel.turns(2.0, 0.012, 0.0)
    assert wheel.turns(STILL_S + 0.02, 0.0, 0.0)


def test_an_encoder_at_an_edge_counts_to_and_fro() -> None:
    wheel = Wheel()
    wheel.turns(0.1, 0.0, 0.0)
    for n in range(100):
        wheel.at_m = (n % 2) * 2 * COUNT_M
        assert wheel.turns(CYCLE_S, 0.0, 0.0)


def test_counts_wrap_around() -> None:
    watch = Wheel().watch
    for n, counts in enumerate((2**31 - 1, 2**31 - 1, -(2**31), -(2**31))):
        watch.on_position(counts, 100.0 + n * CYCLE_S)
        watch.on_velocity(0.0, 100.0 + n * CYCLE_S)
    assert watch.stands


@pytest.mark.parametrize("gap_s", [0.15, GAP_S - 0.01, GAP_S, 2.0])
def test_values_that_are_read_by_sdo_may_be_further_apart(gap_s: float) -> None:
    watch = Wheel().watch
    for n in range(3):
        watch.on_position(7, 128.0 + n * gap_s)
        watch.on_velocity(0.0, 128.0 + n * gap_s + 0.05)
    assert watch.stands


def test_a_position_that_no_longer_comes_is_no_evidence() -> None:
    wheel = Wheel()
    assert wheel.turns(0.5, 0.0, 0.0)
    wheel.watch.on_velocity(0.0, wheel.now_s + GAP_S)
    assert not wheel.watch.stands


# --- the whole watchdog


class Crawling(FakeDrive):
    """Its velocity says 0, and its encoder goes on at 0.1 m/s while it has power."""

    def step(self, dt: float, now_s: float) -> list:  # type: ignore[type-arg]
        if self.crawls and self.words[0] != 0x0240:
            self.travel[0] += 100 * dt
        return super().step(dt, now_s)

    crawls = False


def test_a_wheel_with_noise_at_standstill_trips_nothing_when_the_leases_end() -> None:
    story = Story()
    story.drive_at(0)
    noise = random.Random(2)

    def shake() -> None:
        for drive in story.drives:
            drive.shows = noise.randint(-20, 20)

    story.on_step = shake
    story.run(0.5)
    story.filter = False
    story.run(1.0)
    assert story.watchdog.status.state is not State.TRIPPED, story.watchdog.status.verdict


def test_a_wheel_whose_velocity_says_zero_while_it_moves_trips_when_the_leases_end() -> None:
    story = Story(Crawling(1), FakeDrive(2))
    story.drive_at(0)
    story.drives[0].crawls = True  # type: ignore[attr-defined]
    story.run(0.02)
    story.filter = False
    story.run(0.26)
    assert story.watchdog.status.state is State.TRIPPED


def test_after_a_trip_a_wheel_with_noise_settles_and_can_be_reset() -> None:
    story = Story()
    story.drive_at(300)
    noise = random.Random(3)

    def shake() -> None:
        for drive in story.drives:
            drive.shows = round(drive.speed[0]) + noise.randint(-20, 20)

    story.on_step = shake
    story.filter = False
    story.run(0.3)
    assert story.watchdog.status.state is State.TRIPPED
    story.filter, story.speed, story.word = True, 0, 0
    story.run(2.0)
    assert story.watchdog.status.settled
    assert story.reset(1) == 1


# --- the limits, in binary fractions: a rim slower than 1/128 m/s stands, up to 1/16 m/s is noise


def exact(m_per_count: float = 2.0**-9) -> StandstillWatch:
    """One count is 2 mm, two of them are near: 4 mm."""
    drive = replace(CONFIG.drives[0], m_per_count=m_per_count)
    return StandstillWatch(drive, replace(CONFIG, standstill_mps=2.0**-7, motion_tolerance_mps=2.0**-4))


@pytest.mark.parametrize(("counts", "stands"), [(384, True), (-384, True), (385, False), (-385, False)])
def test_one_step_may_be_three_times_as_fast(counts: int, stands: bool) -> None:
    watch = exact(2.0**-20)
    watch.on_position(0, 0.0)
    watch.on_velocity(0.0, 0.0)
    watch.on_position(counts, 2.0**-6)
    assert watch.stands is stands


@pytest.mark.parametrize(("velocity_mps", "stands"), [(2.0**-4, True), (2.0**-4 + 2.0**-20, False)])
def test_two_counts_to_and_fro_are_still_after_exactly_the_time(velocity_mps: float, stands: bool) -> None:
    watch = exact()
    watch.on_velocity(velocity_mps, 0.0)
    for at, counts in ((0.0, 0), (0.125, 2)):
        watch.on_position(counts, at)
        assert not watch.stands
    watch.on_position(2, STILL_S)
    assert watch.stands is stands
    watch.on_position(3, 0.25)
    assert not watch.stands


def test_two_counts_under_a_velocity_of_zero_are_no_creeping_and_three_are() -> None:
    for counts, stands in ((2, True), (-2, True), (3, False), (-3, False)):
        watch = exact()
        watch.on_position(0, 0.0)
        watch.on_velocity(0.0, 0.0)
        watch.on_position(counts, 0.01)
        watch.on_position(counts, 0.02)
        assert watch.stands is stands


def test_after_creeping_it_stands_after_exactly_its_time() -> None:
    watch = exact()
    watch.on_position(0, -0.0625)
    watch.on_velocity(0.0, -0.0625)
    watch.on_position(3, 0.0)
    watch.on_velocity(0.0, 0.0)
    watch.on_position(3, 0.19)
    assert not watch.stands
    watch.on_position(3, STILL_S)
    assert watch.stands


def test_what_takes_as_long_as_the_slowest_motion_is_no_creeping() -> None:
    watch = exact()
    watch.on_position(0, 0.0)
    watch.on_velocity(0.0, 0.0)
    watch.on_position(3, STILL_S)
    watch.on_position(3, 0.25)
    assert watch.stands


def test_what_it_rolled_before_it_was_slow_is_no_creeping() -> None:
    watch = exact()
    watch.on_velocity(0.25, 0.0)
    watch.on_position(0, 0.0)
    watch.on_position(3, 0.0625)
    watch.on_velocity(0.0, 0.07)
    watch.on_position(3, 0.08)
    assert watch.stands


def test_it_is_slow_from_exactly_the_limit_on_and_only_once() -> None:
    watch = exact()
    watch.on_velocity(0.25, 0.0)
    watch.on_position(0, 0.0)
    watch.on_position(3, 0.0625)
    watch.on_velocity(2.0**-7, 0.3125)
    watch.on_position(6, 0.375)  # soon after it became slow
    watch.on_position(6, 0.4375)
    assert not watch.stands
    watch = exact()
    watch.on_position(0, 0.0)
    watch.on_velocity(2.0**-7, 0.0)
    watch.on_velocity(2.0**-7, 0.25)
    watch.on_position(3, 0.3125)  # long after it
    watch.on_position(3, 0.375)
    assert watch.stands


def test_after_a_gap_everything_begins_anew() -> None:
    watch = exact()
    watch.on_velocity(2.0**-4, 0.0)
    watch.on_position(0, 0.0)
    watch.on_position(2, 0.25)
    assert watch.stands
    watch.on_position(9, 2.0)
    watch.on_velocity(2.0**-4, 2.0)
    assert not watch.stands
    watch.on_position(10, 2.125)
    assert not watch.stands
    watch.on_position(10, 2.25)
    assert watch.stands


def test_creeping_ends_after_exactly_its_time_also_where_the_encoder_was_still_for_less() -> None:
    watch = exact()
    watch.on_velocity(0.25, -0.125)
    watch.on_position(0, -0.125)
    watch.on_position(-2, -0.0625)
    watch.on_velocity(0.0, -0.0625)
    watch.on_position(1, 0.0)
    watch.on_position(3, 0.1)
    assert not watch.stands
    watch.on_position(3, STILL_S)
    assert watch.stands


def test_a_jump_by_half_of_all_counts_is_no_standstill() -> None:
    watch = exact()
    watch.on_velocity(0.0, 0.0)
    watch.on_position(0, 0.0)
    watch.on_position(-(2**31), 0.01)
    assert not watch.stands


@pytest.mark.parametrize("gap_s", [GAP_S, 1.4])
@pytest.mark.parametrize(
    ("counts", "stands"), [(0, True), (2, True), (-2, True), (3, False), (-3, False), (400, False)]
)
def test_after_half_a_second_a_wheel_stands_only_where_it_was(gap_s: float, counts: int, stands: bool) -> None:
    watch = exact()
    watch.on_velocity(0.0, 0.0)
    watch.on_position(0, 0.0)
    watch.on_velocity(0.0, gap_s)
    watch.on_position(counts, gap_s)
    assert watch.stands is stands


def test_noise_after_a_gap_needs_a_fifth_of_a_second_anew() -> None:
    watch = exact()
    watch.on_velocity(2.0**-5, 0.0)
    watch.on_position(0, 0.0)
    for at_s, stands in ((1.0, False), (1.15, False), (1.25, True)):
        watch.on_velocity(2.0**-5, at_s)
        watch.on_position(0, at_s)
        assert watch.stands is stands, at_s
