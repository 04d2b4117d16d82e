"""When a wheel stands: encoder and velocity together, and whether they are evidence. Samples each 10 ms.

A rim slower than 5 mm/s stands; up to 50 mm/s is noise if the encoder does not move; 0.05 m that were ordered and not
shown take the trust; a wheel without power rolls for 9.6 s. Its quick stop brakes it by 2 m/s², by 4 m/s² at most, the
floor by 8 m/s² at most. The wheel is enabled until it is told otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest

from canbase_config.load import load_robot, sample
from canbase_driver.drives.standstill import Stillness, StillnessLimits

COUNT_M = 7.67e-6
ROBOT = load_robot(sample("bench")).robot
LIMITS = StillnessLimits.of(ROBOT, ROBOT.drives[0])


@dataclass
class Wheel:
    now_s: float = 100.0
    travel_m: float = 0.0
    stillness: Stillness = field(default_factory=lambda: Stillness(LIMITS, COUNT_M))

    def __post_init__(self) -> None:
        self.stillness.on_power(True, self.now_s, follows=True)

    def quick_stop(self) -> None:
        self.stillness.on_power(True, self.now_s)

    def power_off(self) -> None:
        self.stillness.on_power(False, self.now_s)

    def brakes(self, from_mps: float, slope_mps2: float, cycle_s: float = 0.01) -> None:
        """Down to standstill, as a sound sensor shows it."""
        mps = from_mps
        while mps > 0.0:
            after_mps = max(0.0, mps - slope_mps2 * cycle_s)
            self.now_s += cycle_s
            self.travel_m += (mps + after_mps) / 2.0 * cycle_s
            mps = after_mps
            self.stillness.on_sample(self.travel_m, mps, 0.0, self.now_s)

    def turns(self, seconds: float, encoder_mps: float, velocity_mps: float, ordered_mps: float = 0.0) -> bool:
        for _ in range(round(seconds / 0.01)):
            self.now_s += 0.01
            self.travel_m += encoder_mps * 0.01
            self.stillness.on_sample(self.travel_m, velocity_mps, ordered_mps, self.now_s)
        return self.stillness.stands(self.now_s)


def test_the_limits_are_those_of_the_robot() -> None:
    assert (LIMITS.standstill_mps, LIMITS.noise_mps, LIMITS.unshown_m) == (0.005, 0.05, 0.05)
    assert LIMITS.coasting_s == pytest.approx(9.6)
    assert (LIMITS.braking_mps2, LIMITS.rolling_mps2) == (4.0, 8.0)


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
    assert not wheel.stillness.stands(wheel.now_s)
    assert not wheel.turns(0.01, 0.0, 0.02)
    assert wheel.turns(0.25, 0.0, 0.02)


# What was ordered and not shown


def test_motion_that_was_ordered_and_not_shown_takes_the_evidence() -> None:
    """0.3 m/s ordered, the encoder lost: 0.05 m after 0.17 s."""
    wheel = Wheel()
    wheel.turns(0.5, 0.3, 0.3, ordered_mps=0.3)
    assert wheel.turns(0.15, 0.0, 0.0, ordered_mps=0.3)
    assert not wheel.turns(0.05, 0.0, 0.0, ordered_mps=0.3)
    assert wheel.stillness.doubt == "showed no motion for 0.060 m of ordered travel"
    wheel.power_off()
    wheel.turns(2.0, 0.0, 0.0)
    assert wheel.stillness.unproven(wheel.now_s) == (
        "showed no motion for 0.060 m of ordered travel; repair it, and wait until its power has been off for 10 s "
        "(8 s left)"
    )
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
    wheel.stillness.on_power(False, wheel.now_s)
    assert wheel.turns(off_s, 0.0, 0.0) is stands
    assumed = "was caught with a lie; its power has been off for 10 s, so standstill is assumed"
    assert wheel.stillness.assumed(wheel.now_s) == (assumed if stands else "")


def test_a_stand_that_is_measured_is_not_assumed() -> None:
    wheel = Wheel()
    wheel.stillness.on_power(False, wheel.now_s)
    assert wheel.turns(20.0, 0.0, 0.0)
    assert wheel.stillness.assumed(wheel.now_s) == ""


def test_power_in_between_begins_the_rolling_anew_and_after_it_the_sensors_have_a_new_trial() -> None:
    wheel = Wheel()
    wheel.stillness.distrust("was caught with a lie")
    wheel.stillness.on_power(False, wheel.now_s)
    wheel.turns(9.0, 0.0, 0.0)
    wheel.stillness.on_power(True, wheel.now_s)
    wheel.stillness.on_power(False, wheel.now_s)
    assert not wheel.turns(9.0, 0.0, 0.0)
    assert wheel.turns(1.0, 0.0, 0.0)
    wheel.stillness.on_power(True, wheel.now_s)
    assert not wheel.stillness.doubt
    assert wheel.turns(0.1, 0.0, 0.0)


def test_a_wheel_that_shows_motion_stands_never_however_long_its_power_is_off() -> None:
    wheel = Wheel()
    wheel.stillness.distrust("was caught with a lie")
    wheel.stillness.on_power(False, wheel.now_s)
    assert not wheel.turns(20.0, 0.0, 0.3)


def lost(wheel: Wheel, partly_m: float = 0.0, seconds: float = 0.5) -> bool:
    """Encoder and velocity show nothing any more, from the middle of a cycle on."""
    wheel.now_s += 0.01
    wheel.travel_m += partly_m
    wheel.stillness.on_sample(wheel.travel_m, 0.0, 0.0, wheel.now_s)
    return wheel.turns(seconds, 0.0, 0.0)


# A wheel needs a distance to stop


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("speed", [0.2, 0.5, 1.0])
def test_a_sensor_that_stops_within_less_than_a_wheel_can_is_no_evidence_until_it_has_rolled_out(
    speed: float, share: float
) -> None:
    """It rolls without power. The encoder dies at the begin, in the middle or at the end of a cycle."""
    wheel = Wheel()
    wheel.power_off()
    off_at = wheel.now_s
    wheel.turns(0.3, speed, speed)
    assert not lost(wheel, share * speed * 0.01)
    assert "it met something hard, or its encoder is dead" in wheel.stillness.doubt
    wheel.turns(off_at + 9.61 - wheel.now_s, 0.0, 0.0)
    assert wheel.stillness.stands(wheel.now_s)
    assert "standstill is assumed" in wheel.stillness.assumed(wheel.now_s)


def test_a_wheel_that_follows_and_stops_too_soon_is_not_proven_to_stand_before_it_must_have_rolled_out() -> None:
    """Nothing depends on it but what is told: the watchdog judges it. 0.2 m/s; 9.6 s later it has rolled out."""
    wheel = Wheel()
    wheel.turns(0.3, 0.2, 0.2, ordered_mps=0.2)
    assert lost(wheel, seconds=9.5)
    assert not wheel.stillness.is_proven(wheel.now_s)
    assert wheel.turns(0.2, 0.0, 0.0)
    assert wheel.stillness.is_proven(wheel.now_s)


def test_a_wheel_that_follows_and_met_something_hard_is_proven_to_stand_once_it_has_moved() -> None:
    """20 ms against a threshold, and then its order is zero."""
    wheel = Wheel()
    wheel.turns(0.3, 0.2, 0.2, ordered_mps=0.2)
    lost(wheel, seconds=0.02)
    assert not wheel.stillness.is_proven(wheel.now_s)
    wheel.turns(0.1, 0.1, 0.1, ordered_mps=0.1)
    wheel.brakes(0.1, 2.0)
    assert wheel.turns(0.01, 0.0, 0.0)
    assert wheel.stillness.is_proven(wheel.now_s)


@pytest.mark.parametrize("lost_at", range(1, 24))
def test_a_sensor_that_is_lost_in_a_quick_stop_is_no_evidence_whenever_that_is(lost_at: int) -> None:
    """From 0.5 m/s, 2 m/s²: 25 cycles; the last that leaves more than noise is found is that of 0.1 m/s."""
    wheel = Wheel()
    wheel.turns(0.3, 0.5, 0.5, ordered_mps=0.5)
    wheel.quick_stop()
    for n in range(lost_at):
        wheel.turns(0.01, 0.5 - 0.02 * n, 0.5 - 0.02 * n)
    left_mps = 0.5 - 0.02 * (lost_at - 1)
    stands = lost(wheel, 0.5 * left_mps * 0.01)
    assert stands is (left_mps < 0.07)


@pytest.mark.parametrize("gap_s", [0.03, 0.06, 0.09, 0.3])
def test_lost_frames_do_not_make_a_lost_sensor_a_stand(gap_s: float) -> None:
    """0.6 m/s in a quick stop; the samples that would show how it lost the rest do not come."""
    wheel = Wheel()
    wheel.turns(0.3, 0.6, 0.6, ordered_mps=0.6)
    wheel.quick_stop()
    wheel.now_s += gap_s
    wheel.travel_m += 0.012
    if gap_s > 0.1:
        wheel.stillness.pause()
    wheel.stillness.on_sample(wheel.travel_m, 0.0, 0.0, wheel.now_s)
    assert not wheel.turns(0.5, 0.0, 0.0)


@pytest.mark.parametrize("gap_s", [0.03, 0.06, 0.09, 0.3, 1.0])
def test_a_stop_that_no_frame_showed_but_the_encoder_counted_is_a_stand(gap_s: float) -> None:
    wheel = Wheel()
    wheel.turns(0.3, 0.6, 0.6, ordered_mps=0.6)
    wheel.quick_stop()
    wheel.now_s += gap_s
    wheel.travel_m += 0.6**2 / 2.0 / 2.0
    if gap_s > 0.1:
        wheel.stillness.pause()
    wheel.stillness.on_sample(wheel.travel_m, 0.0, 0.0, wheel.now_s)
    assert wheel.turns(0.5, 0.0, 0.0)


def test_a_velocity_that_is_filtered_dies_slowly_and_its_encoder_at_once() -> None:
    """0.1 s of filter: 0.5 m/s fade away while nothing is counted."""
    wheel = Wheel()
    wheel.turns(0.3, 0.5, 0.5)
    wheel.quick_stop()
    mps = 0.5
    for _ in range(80):
        mps *= 0.9
        wheel.turns(0.01, 0.0, mps)
    assert not wheel.turns(0.1, 0.0, 0.0)


def test_an_encoder_that_jitters_shows_no_way_to_a_stand() -> None:
    wheel = Wheel()
    wheel.power_off()
    wheel.turns(0.3, 0.5, 0.5)
    for n in range(200):
        wheel.turns(0.01, (-1) ** n * 0.01, 0.0)
    assert wheel.stillness.doubt


@pytest.mark.parametrize("cycle_s", [0.005, 0.01, 0.02])
@pytest.mark.parametrize("from_mps", [0.05, 0.2, 0.5, 1.0, 3.0])
@pytest.mark.parametrize(("power", "slope_mps2"), [(True, 0.5), (True, 2.0), (True, 3.5), (False, 0.3), (False, 7.0)])
def test_a_wheel_that_brakes_stands_as_soon_as_it_shows_it(
    power: bool, slope_mps2: float, from_mps: float, cycle_s: float
) -> None:
    wheel = Wheel()
    wheel.turns(0.3, from_mps, from_mps, ordered_mps=from_mps)
    wheel.stillness.on_power(power, wheel.now_s)
    wheel.brakes(from_mps, slope_mps2, cycle_s)
    assert wheel.turns(0.3, 0.0, 0.0)
    assert not wheel.stillness.doubt


def test_a_velocity_alone_is_a_glitch_and_no_motion() -> None:
    wheel = Wheel()
    wheel.power_off()
    wheel.turns(0.3, 0.0, 3.0)
    assert wheel.turns(0.5, 0.0, 0.0)


def test_a_wheel_that_met_something_hard_counts_as_standing_while_its_drive_is_enabled_and_not_without_power() -> None:
    """While it is enabled the watchdog tells a blocked wheel from a dead sensor."""
    wheel = Wheel()
    wheel.turns(0.3, 1.0, 1.0, ordered_mps=1.0)
    assert lost(wheel)
    wheel.power_off()
    assert not wheel.turns(0.5, 0.0, 0.0)
    wheel.stillness.on_power(True, wheel.now_s, follows=True)
    assert wheel.turns(0.5, 0.0, 0.0), "it let go for a moment"


def test_what_to_do_is_told_and_helps() -> None:
    wheel = Wheel()
    wheel.quick_stop()
    wheel.turns(0.3, 0.4, 0.4)
    lost(wheel)
    assert wheel.stillness.doubt == (
        "shows standstill and nothing of how it braked from 0.40 m/s: it met something hard, or its encoder is dead; "
        "turn it by hand by 0.021 m, or wait until its power has been off for 10 s"
    )
    assert not wheel.turns(0.38, -0.05, -0.05)
    assert not wheel.turns(0.1, 0.0, 0.0)
    wheel.turns(0.04, -0.05, -0.05)
    assert wheel.turns(0.5, 0.0, 0.0)


def test_a_restart_forgets_a_speed_and_no_doubt() -> None:
    sound, caught = Wheel(), Wheel()
    for wheel in (sound, caught):
        wheel.quick_stop()
        wheel.turns(0.3, 1.0, 1.0)
    lost(caught)
    for wheel in (sound, caught):
        wheel.stillness.forget()
        wheel.power_off()
    assert sound.turns(0.5, 0.0, 0.0)
    assert not caught.turns(0.5, 0.0, 0.0)


def test_power_after_a_stand_that_was_assumed_is_a_new_trial() -> None:
    wheel = Wheel()
    wheel.power_off()
    wheel.turns(0.3, 1.0, 1.0)
    lost(wheel, 0.0, 10.0)
    wheel.stillness.on_power(True, wheel.now_s, follows=True)
    wheel.power_off()
    assert wheel.turns(0.1, 0.0, 0.0)
    assert wheel.stillness.assumed(wheel.now_s) == ""
