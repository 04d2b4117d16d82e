"""When a wheel stands: encoder and velocity together, and whether they are evidence. Samples each 10 ms.

A rim slower than 5 mm/s stands; up to 50 mm/s is noise if the encoder does not move; 0.05 m that were ordered and not
shown take the trust; a wheel without power rolls for 9.6 s.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from canbase_config.load import load_robot, sample
from canbase_driver.stillness import Stillness, StillnessLimits

COUNT_M = 7.67e-6


@dataclass
class Wheel:
    now: float = 100.0
    travel_m: float = 0.0
    stillness: Stillness = field(
        default_factory=lambda: Stillness(StillnessLimits.of(load_robot(sample("bench")).robot), COUNT_M)
    )

    def turns(self, seconds: float, encoder_mps: float, velocity_mps: float, ordered_mps: float = 0.0) -> bool:
        for _ in range(round(seconds / 0.01)):
            self.now += 0.01
            self.travel_m += encoder_mps * 0.01
            self.stillness.on_sample(self.travel_m, velocity_mps, ordered_mps, self.now)
        return self.stillness.stands(self.now)


def test_the_limits_are_those_of_the_robot() -> None:
    limits = StillnessLimits.of(load_robot(sample("bench")).robot)
    assert (limits.standstill_mps, limits.noise_mps, limits.unshown_m) == (0.005, 0.05, 0.05)
    assert limits.coasting_s == pytest.approx(9.6)


def test_before_the_first_sample_nothing_stands() -> None:
    assert not Wheel().stillness.stands(100.0)


@pytest.mark.parametrize(
    ("encoder_mps", "velocity_mps", "stands"),
    [
        (0.0, 0.0, True),
        (0.0049, 0.0049, True),
        (-0.0051, -0.0051, False),
        (0.3, 0.0, False),  # the velocity says it stands, the encoder does not
        (0.02, 0.0, False),
        (0.0, 0.3, False),
        (0.0, -0.051, False),
    ],
)
def test_encoder_and_velocity_both_count(encoder_mps: float, velocity_mps: float, stands: bool) -> None:
    assert Wheel().turns(0.5, encoder_mps, velocity_mps) is stands


def test_noise_of_20_mm_per_s_beside_an_encoder_that_is_still_is_a_stand_after_two_tenths() -> None:
    wheel = Wheel()
    assert not wheel.turns(0.15, 0.0, 0.02)
    for _ in range(50):
        wheel.turns(0.01, 0.0, 0.02)
        stands = wheel.turns(0.01, 0.0, -0.02)
    assert stands
    assert not wheel.turns(0.5, 0.02, 0.02)  # and the same speed with an encoder that moves is none


def test_a_stand_is_seen_with_the_first_slow_sample() -> None:
    wheel = Wheel()
    wheel.turns(0.3, 0.1, 0.1)
    assert wheel.turns(0.01, 0.004, 0.004)


def test_after_a_gap_it_is_measured_anew() -> None:
    wheel = Wheel()
    wheel.turns(0.3, 0.0, 0.02)
    wheel.stillness.forget()
    assert not wheel.stillness.stands(wheel.now)
    assert not wheel.turns(0.01, 0.0, 0.02)
    assert wheel.turns(0.25, 0.0, 0.02)


# What was ordered and not shown


def test_motion_that_was_ordered_and_not_shown_takes_the_evidence() -> None:
    """0.3 m/s ordered, the encoder lost: 0.05 m after 0.17 s."""
    wheel = Wheel()
    wheel.turns(0.5, 0.3, 0.3, ordered_mps=0.3)
    assert wheel.turns(0.15, 0.0, 0.0, ordered_mps=0.3)
    assert not wheel.turns(0.05, 0.0, 0.0, ordered_mps=0.3)
    assert wheel.stillness.doubt == "showed no motion for 0.060 m that were ordered"
    assert not wheel.turns(1.0, 0.0, 0.0)


@pytest.mark.parametrize(("encoder_mps", "velocity_mps"), [(0.3, 0.0), (0.0, 0.3)])
def test_one_of_both_is_not_enough(encoder_mps: float, velocity_mps: float) -> None:
    wheel = Wheel()
    wheel.turns(0.5, encoder_mps, velocity_mps, ordered_mps=0.3)
    assert wheel.stillness.doubt


def test_motion_that_is_shown_gives_it_back() -> None:
    wheel = Wheel()
    wheel.turns(0.5, 0.0, 0.0, ordered_mps=0.3)
    assert wheel.stillness.doubt
    wheel.turns(0.1, 0.2, 0.2, ordered_mps=0.3)
    assert not wheel.stillness.doubt
    assert wheel.turns(0.1, 0.0, 0.0)


def test_a_slow_wheel_that_follows_is_never_doubted() -> None:
    wheel = Wheel()
    wheel.turns(20.0, 0.02, 0.02, ordered_mps=0.03)
    assert not wheel.stillness.doubt


@pytest.mark.parametrize(("off_s", "stands"), [(9.5, False), (9.7, True)])
def test_without_power_a_stand_is_assumed_when_it_must_have_rolled_out_and_it_says_so(
    off_s: float, stands: bool
) -> None:
    wheel = Wheel()
    wheel.stillness.distrust("was caught with a lie")
    wheel.stillness.on_power(False, wheel.now)
    assert wheel.turns(off_s, 0.0, 0.0) is stands
    assumed = "was caught with a lie; its power has been off for 10 s, so a stand is assumed"
    assert wheel.stillness.assumed(wheel.now) == (assumed if stands else "")


def test_a_stand_that_is_measured_is_not_assumed() -> None:
    wheel = Wheel()
    wheel.stillness.on_power(False, wheel.now)
    assert wheel.turns(20.0, 0.0, 0.0)
    assert wheel.stillness.assumed(wheel.now) == ""


def test_power_in_between_begins_the_rolling_anew_and_after_it_the_sensors_have_a_new_trial() -> None:
    wheel = Wheel()
    wheel.stillness.distrust("was caught with a lie")
    wheel.stillness.on_power(False, wheel.now)
    wheel.turns(9.0, 0.0, 0.0)
    wheel.stillness.on_power(True, wheel.now)
    wheel.stillness.on_power(False, wheel.now)
    assert not wheel.turns(9.0, 0.0, 0.0)
    assert wheel.turns(1.0, 0.0, 0.0)
    wheel.stillness.on_power(True, wheel.now)
    assert not wheel.stillness.doubt
    assert wheel.turns(0.1, 0.0, 0.0)


def test_a_wheel_that_shows_motion_stands_never_however_long_its_power_is_off() -> None:
    wheel = Wheel()
    wheel.stillness.distrust("was caught with a lie")
    wheel.stillness.on_power(False, wheel.now)
    assert not wheel.turns(20.0, 0.0, 0.3)


def test_a_sensor_that_stops_faster_than_a_wheel_can_is_no_evidence_until_the_wheel_has_rolled_out() -> None:
    """1 m/s without power; then encoder and velocity show nothing from one sample to the next."""
    wheel = Wheel()
    wheel.stillness.on_power(False, wheel.now)
    off_at = wheel.now
    wheel.turns(0.3, 1.0, 1.0)
    assert not wheel.turns(0.5, 0.0, 0.0)
    assert wheel.stillness.doubt == "stopped from 1.00 m/s within 0.010 s, which no wheel can"
    wheel.turns(off_at + 9.61 - wheel.now, 0.0, 0.0)
    assert wheel.stillness.stands(wheel.now)
    assert "a stand is assumed" in wheel.stillness.assumed(wheel.now)


@pytest.mark.parametrize(
    ("before_mps", "encoder_mps"),
    [(0.24, 0.24), (3.0, 0.0)],  # hard braking against a wall; a velocity that jumps alone is a glitch
)
def test_what_a_wheel_can_do_and_a_glitch_of_the_velocity_are_no_reason_for_doubt(
    before_mps: float, encoder_mps: float
) -> None:
    wheel = Wheel()
    wheel.turns(0.3, encoder_mps, before_mps)
    assert wheel.turns(0.5, 0.0, 0.0)
    assert wheel.stillness.doubt == ""


def test_a_sensor_that_stopped_so_under_power_is_no_evidence_once_the_power_is_off() -> None:
    wheel = Wheel()
    wheel.stillness.on_power(True, wheel.now)
    wheel.turns(0.3, 1.0, 1.0)
    assert wheel.turns(0.02, 0.0, 0.0), "the watchdog judges it as long as there is power"
    wheel.stillness.on_power(False, wheel.now)
    assert not wheel.turns(0.5, 0.0, 0.0)


def test_a_sensor_that_shows_motion_again_is_trusted_again() -> None:
    wheel = Wheel()
    wheel.stillness.on_power(False, wheel.now)
    wheel.turns(0.3, 1.0, 1.0)
    wheel.turns(0.1, 0.0, 0.0)
    assert wheel.stillness.doubt
    wheel.turns(0.3, 0.2, 0.2)
    assert wheel.turns(0.5, 0.0, 0.0)
