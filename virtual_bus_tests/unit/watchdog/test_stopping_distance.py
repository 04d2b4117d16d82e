"""A wheel needs a distance to stop: what the watchdog calls an unproven standstill. Samples each 10 ms, 0.1 mm a count.

The drive brakes by 4 m/s² at most, the floor by 8 m/s² at most; 0.05 m/s is noise; rolled out after 2 s; 5 samples.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import pytest

from canbase_watchdog.counts import difference
from canbase_watchdog.frames import DriveState
from canbase_watchdog.standstill import StandstillWatch
from canbase_watchdog.view import Axis
from support.watchdog_story import config

DRIVE = replace(config().drives[0], hardest_braking_mps2=4.0)
CONFIG = replace(config(), hardest_stop_mps2=8.0)
CYCLE_S = 0.01


@dataclass
class Wheel:
    powered: bool = True
    now_s: float = 100.0
    at_m: float = 0.0
    watch: StandstillWatch = field(default_factory=lambda: StandstillWatch(DRIVE, CONFIG))

    def sample(self, step_m: float, velocity_mps: float, after_s: float = CYCLE_S) -> None:
        self.now_s += after_s
        self.at_m += step_m
        self.watch.on_position(round(self.at_m / DRIVE.m_per_count), self.now_s)
        self.watch.on_velocity(velocity_mps, self.now_s + 0.0002, self.powered)

    def turns(self, samples: int, mps: float) -> Wheel:
        for _ in range(samples):
            self.sample(mps * CYCLE_S, mps)
        return self

    def brakes(self, mps: float, slope_mps2: float) -> Wheel:
        while mps > 0.0:
            after = max(0.0, mps - slope_mps2 * CYCLE_S)
            self.sample((mps + after) / 2.0 * CYCLE_S, after)
            mps = after
        return self

    def lost(self, partly: float = 0.0, samples: int = 10) -> bool:
        """Dead within a cycle. Whether its standstill is called unproven then."""
        self.sample(partly, 0.0)
        self.turns(samples, 0.0)
        assert self.watch.stands
        return self.watch.unproven


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("partly", [0.0, 0.5, 1.0])
@pytest.mark.parametrize(("powered", "speed"), [(True, 0.12), (True, 0.5), (True, 1.0), (False, 0.22), (False, 0.6)])
def test_a_sensor_that_is_lost_shows_no_distance(powered: bool, speed: float, partly: float, sign: float) -> None:
    wheel = Wheel(powered).turns(30, sign * speed)
    assert wheel.lost(sign * partly * speed * CYCLE_S)


@pytest.mark.parametrize("mps", [0.06, 0.3, 0.8, 2.5])
@pytest.mark.parametrize(("powered", "slope"), [(True, 0.3), (True, 2.0), (True, 3.5), (False, 0.5), (False, 7.5)])
def test_a_wheel_that_brakes_as_it_can_is_proven_to_stand(powered: bool, slope: float, mps: float) -> None:
    wheel = Wheel(powered).turns(30, mps).brakes(mps, slope)
    assert not wheel.lost()


def test_it_takes_five_samples_in_a_row() -> None:
    wheel = Wheel().turns(30, 0.5)
    wheel.sample(0.0, 0.0)
    wheel.turns(3, 0.0)
    assert not wheel.watch.unproven
    wheel.turns(1, 0.0)
    assert wheel.watch.unproven
    wheel.sample(0.0, 0.5)
    assert not wheel.watch.unproven, "the velocity says that it moves"
    wheel.turns(4, 0.0)
    assert not wheel.watch.unproven


@pytest.mark.parametrize("gap_s", [0.03, 0.15, 0.3, 1.0])
@pytest.mark.parametrize(("shown_m", "unproven"), [(0.02, True), (0.046, False)])
def test_in_a_gap_the_encoder_counts_on(shown_m: float, unproven: bool, gap_s: float) -> None:
    """From 0.6 m/s at 4 m/s² it takes 0.045 m and 0.15 s."""
    wheel = Wheel().turns(30, 0.6)
    wheel.sample(shown_m, 0.0, gap_s)
    wheel.turns(10, 0.0)
    assert wheel.watch.unproven is unproven


@pytest.mark.parametrize(("mean_mps", "unproven"), [(0.2, False), (0.25, False), (0.27, True), (0.5, True)])
def test_positions_that_come_seldom_tell_a_speed_of_their_own(mean_mps: float, unproven: bool) -> None:
    """Read by SDO each 0.1 s: at its end the wheel may have lost 0.2 m/s more than its mean; 0.05 m/s is noise."""
    wheel = Wheel()
    for _ in range(3):
        wheel.sample(0.0, 0.0, 0.1)
    wheel.sample(mean_mps * 0.1, 0.0, 0.1)
    while not wheel.watch.stands:
        wheel.sample(0.0, 0.0, 0.1)
    assert (wheel.watch.sudden, wheel.watch.unproven) == (unproven, False)
    wheel.sample(0.0, 0.0, 0.1)
    assert (wheel.watch.sudden, wheel.watch.unproven) == (unproven, unproven)


@pytest.mark.parametrize("after_s", [0.04, 0.6])
def test_positions_that_come_often_or_not_at_all_do_not(after_s: float) -> None:
    wheel = Wheel()
    wheel.sample(0.0, 0.0)
    wheel.sample(0.5 * after_s, 0.0, after_s)
    assert not wheel.lost(samples=40)


def test_power_that_goes_off_in_the_gap_lets_the_floor_brake_it() -> None:
    braked, rolled = Wheel().turns(30, 0.6), Wheel().turns(30, 0.6)
    rolled.powered = False
    for wheel in (braked, rolled):
        wheel.sample(0.03, 0.0, 0.09)
        wheel.turns(10, 0.0)
    assert (braked.watch.unproven, rolled.watch.unproven) == (True, False)
    first = Wheel(False).turns(30, 0.6)
    first.powered = True  # power that comes in the gap is the same
    first.sample(0.03, 0.0, 0.09)
    assert not first.turns(10, 0.0).watch.unproven


def test_to_and_fro_is_no_distance_and_a_jump_is_none() -> None:
    wheel = Wheel().turns(30, 0.5)
    for n in range(100):
        wheel.sample((-1) ** n * 0.0001, 0.0)
    assert wheel.watch.unproven
    wheel = Wheel().turns(30, 0.5)
    wheel.sample(0.2, 0.0)
    assert wheel.lost()


def test_a_velocity_alone_and_an_encoder_alone_are_no_motion() -> None:
    wheel = Wheel()
    for _ in range(30):
        wheel.sample(0.0, 0.9)
    assert not wheel.lost()
    for _ in range(30):
        wheel.sample(0.009, 0.0)
    assert not wheel.lost(samples=30)


def test_the_missing_distance_may_be_shown_by_hand() -> None:
    """0.4 m/s at 4 m/s²: 20 mm, less what noise may have left."""
    wheel = Wheel().turns(30, 0.4)
    assert wheel.lost()
    assert wheel.turns(34, -0.05).lost()
    assert not wheel.turns(8, -0.05).lost()


def test_a_reset_and_power_after_it_must_have_rolled_out_are_a_new_trial() -> None:
    wheel = Wheel().turns(30, 0.5)
    assert wheel.lost()
    wheel.watch.trust()
    assert not wheel.lost()
    for off_s, unproven in ((1.9, True), (2.1, False)):
        wheel = Wheel(False).turns(30, 0.5)
        wheel.lost(samples=round(off_s / CYCLE_S) - 31)
        assert wheel.watch.unproven, "as long as there is no power"
        wheel.powered = True
        assert wheel.lost() is unproven


def test_what_is_unproven_is_not_trusted_but_for_an_enabled_drive() -> None:
    """There a wheel that met something hard is told from a dead sensor by what is ordered of it."""
    assert Axis(DRIVE).trusted
    assert not Axis(DRIVE, unproven=True).trusted
    assert not Axis(DRIVE, DriveState.QUICK_STOP_ACTIVE, unproven=True).trusted
    assert Axis(DRIVE, DriveState.OPERATION_ENABLED, unproven=True).trusted


@pytest.mark.parametrize(
    ("counts", "before", "steps"),
    [(5, 3, 2), (3, 5, -2), (-(2**31), 2**31 - 1, 1), (2**31 - 1, -(2**31), -1), (2**31, 0, -(2**31)), (0, 0, 0)],
)
def test_counts_wrap_around_the_short_way(counts: int, before: int, steps: int) -> None:
    assert difference(counts, before) == steps


def test_what_was_braked_with_power_is_not_braked_again_without_it() -> None:
    """0.5 m/s, then 0.02 m with power: 0.3 m/s are left. Dead when the power goes: as much again would not do."""
    wheel = Wheel().turns(30, 0.5)
    wheel.sample(0.02, 0.0, 0.04)
    wheel.powered = False
    assert wheel.lost(samples=30)


# 0.5 m/s ── lost: unproven ── 0.1 s ── it shows 0.45 m/s again ── lost again, for good
def test_a_wheel_that_moves_again_before_it_can_have_rolled_out_has_never_stood() -> None:
    wheel = Wheel(powered=False).turns(30, 0.5)
    assert wheel.lost()
    wheel.turns(60, 0.45)
    assert wheel.brakes(0.45, 5.0).lost()
    assert wheel.watch.stands
    wheel.watch.trust()
    assert not wheel.watch.unproven


@pytest.mark.parametrize(("mps", "wait_s"), [(0.04, 0.5), (0.45, 2.1)])
def test_a_wheel_that_is_turned_slowly_or_later_has_stood(mps: float, wait_s: float) -> None:
    wheel = Wheel(powered=False).turns(30, 0.5)
    assert wheel.lost()
    wheel.turns(round(wait_s / CYCLE_S), 0.0)
    wheel.turns(100, mps)
    assert not wheel.brakes(mps, 5.0).lost()
