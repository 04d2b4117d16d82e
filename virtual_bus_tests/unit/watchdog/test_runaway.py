"""Drives whose quick stop does not stop: how long they keep power, how fast the wheel gets, how far the base goes.

Real driver core, real watchdog, simulated drives whose loops close on the faulty sensor. All limits follow from
robot.yaml: under power a wheel may keep 110 % + 0.05 m/s of the speed from which it brakes for 0.1 s, and loses half of
deceleration_mps2 after that; three samples (30 ms) beyond it cost the power.
"""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from canbase_config.robot import Robot
from canbase_config.stopping import ramp
from canbase_driver.motion.kinematics import Twist2D
from canbase_sim.faults import KINDS
from canbase_watchdog.ladder import Braking, Step
from canbase_watchdog.watchdog import State
from support.chain_world import STEP_S, World

SAMPLES = 3
SEEN_S = 0.02
"""A sample waits for its SYNC, and the order to take the power for the next tick."""


@dataclass(frozen=True)
class Story:
    """Seconds from the trip until the faulty drive is without power, and what its wheel did until it stood."""

    trip_s: float
    off_s: float
    peak_mps: float
    at_trip_mps: float
    path_m: float
    keeps_relay: bool


def told(kind: str, mps: float, stop: bool = False) -> Story:
    """Drive, break the left drive, and (`stop`) have the watchdog stop it for something else: its leases end."""
    world = World()
    world.drive(Twist2D(mps, 0.0), 1.2)
    assert world.watchdog is not None
    watchdog, begin, path_m = world.watchdog, world.now_s, world.truth.path_m
    if stop:
        world.leases = False
        world.run(1.0, lambda: watchdog.status.state is State.TRIPPED)
    KINDS[kind][0](world.node, world.now_s)
    peak_mps = at_trip_mps = trip_s = 0.0

    def off() -> bool:
        nonlocal peak_mps, at_trip_mps, trip_s
        truth = world.truth
        peak_mps = max(peak_mps, abs(truth.v_left_mps), abs(truth.v_right_mps))
        if watchdog.status.state is State.TRIPPED and not trip_s:
            trip_s, at_trip_mps = world.now_s - begin, abs(truth.v_left_mps)
        return not world.powered[0]

    assert world.run(3.0, off), "the drive has power for ever"
    off_s, keeps_relay = world.now_s - begin - trip_s, watchdog.keeps_relay
    world.run(12.0)
    assert world.truth.standing_s > 0.5
    assert watchdog.status.step <= Step.DISABLE_VOLTAGE, "the drive obeyed: no rung after it"
    return Story(trip_s, off_s, peak_mps, at_trip_mps, world.truth.path_m - path_m, keeps_relay)


def longest_power_s(robot: Robot, mps: float) -> float:
    """A wheel that just keeps its speed: from the trip until it is faster than braking allows, and that is seen."""
    wheel = robot.watchdog
    forgiven_mps = wheel.motion_tolerance_mps + wheel.motion_tolerance_share * mps
    keeps_s = wheel.drive_lag_s + forgiven_mps / (0.5 * robot.limits.deceleration_mps2)
    return keeps_s + SAMPLES / robot.rates.control_hz + SEEN_S


@pytest.mark.parametrize("mps", [0.1, 0.3, 0.5])
def test_a_reversed_encoder_ends_in_power_off_within_a_fraction_of_a_second(mps: float) -> None:
    """0.3 m/s ── lie ── 0.05 s ── trip ── 0.04 s ── power off; it went on for 5.5 s and to 9.9 m/s before."""
    story = told("encoder_reversed", mps)
    assert story.trip_s + story.off_s < 0.35
    assert story.off_s < SAMPLES * 0.01 + 0.05
    assert story.peak_mps < 1.5
    assert story.path_m < 0.1 + story.peak_mps * 0.2 + story.peak_mps**2 / 2.0 / 0.35
    assert not story.keeps_relay


def test_a_velocity_that_stays_and_an_encoder_that_goes_on_are_a_lie_and_cost_the_power_with_the_trip() -> None:
    story = told("encoder_frozen", 0.3)
    assert story.off_s <= 2 * STEP_S
    assert story.peak_mps < 0.35
    assert story.keeps_relay  # the drive obeyed


def test_an_encoder_that_turns_its_sign_in_the_middle_of_a_quick_stop() -> None:
    """leases end ── trip, quick stop ── reversed: the braking loop drives ── 0.1 s ── power off."""
    story = told("encoder_reversed", 0.5, stop=True)
    assert story.off_s < longest_power_s(World().robot, 0.5)
    assert story.peak_mps < 1.5


@pytest.mark.parametrize("mps", [0.1, 0.3, 0.8])
def test_a_wheel_that_only_keeps_its_speed_loses_its_power_within_a_time_that_follows_from_robot_yaml(
    mps: float,
) -> None:
    robot = World().robot
    rules = Braking.of(World().watchdog._config)  # type: ignore[union-attr]
    at_s = next(t / 1000 for t in range(5000) if rules.allowed_mps(mps, t / 1000) < mps)
    assert at_s + SAMPLES / robot.rates.control_hz < longest_power_s(robot, mps) < 0.5
    assert rules.coasting_s == pytest.approx(1.2 * 0.8 / 0.1)


def test_what_brakes_as_the_ramp_says_is_never_near_the_limit() -> None:
    """Half of the ordinary deceleration is enough, from any speed, at any time of the stop."""
    robot = World().robot
    rules = Braking.of(World().watchdog._config)  # type: ignore[union-attr]
    for mps in (0.05, 0.3, 0.8):
        longest_s = 2.0 * ramp(robot.limits, mps).time_s
        steps = [longest_s * i / 200 for i in range(201)]
        half = 0.5 * robot.limits.deceleration_mps2
        assert all(
            max(0.0, mps - half * (t - rules.lag_s)) <= max(0.0, rules.allowed_mps(mps, t)) + 1e-9 for t in steps
        )


@pytest.mark.parametrize("kind", ["encoder_lost", "encoder_zero"])
def test_a_lost_encoder_ends_in_power_off_within_035_s_and_below_1_5_mps(kind: str) -> None:
    """0.3 m/s ── encoder lost ── 0.05 s ── trip and power off in one cycle; fastest 0.56 m/s."""
    story = told(kind, 0.3)
    assert story.off_s <= 2 * STEP_S
    assert story.trip_s + story.off_s <= 0.35
    assert story.peak_mps <= 1.5
