"""The way down step by step: ramp, quick stop, power off, each with its deadline."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_config.load import load_robot, sample
from canbase_driver.motion.braking import Braking
from canbase_driver.supervision.situation import Situation
from canbase_driver.supervision.state_machine import StateMachine
from support.state_machine_story import (
    ENABLED,
    LATCHED,
    OFF,
    QUICK,
    RAMP,
    READY,
    RUNNING,
    STANDING,
    STOPPING,
    WRONG,
    Story,
    also,
    at,
)


def test_the_way_down_goes_on_at_standstill() -> None:
    story = at(ENABLED, RUNNING)
    stop = WRONG["stop requested"]
    assert story.step(also(RUNNING, stop), cycles=30) == RAMP
    assert story.step(also(STANDING, stop)) == OFF
    assert story.state_machine.state is STOPPING  # the drives have not said yet that they are off
    assert story.step(also(READY, stop)) == OFF
    assert story.told == (LATCHED, "stop requested", True)


def wheels(speed_mps: float, base: Situation = RUNNING) -> Situation:
    """The same, with the fastest wheel at another speed."""
    return replace(base, speed_mps=speed_mps, begin_mps=speed_mps, standstill=speed_mps == 0.0)


STOP = also(RUNNING, WRONG["stop requested"])


def test_a_base_that_does_not_lose_speed_has_its_power_taken_step_by_step_in_less_than_a_second() -> None:
    """0.5 m/s: allowed 0.6 m/s for 0.12 s, then 0.415 m/s² less on the ramp, 0.5 m/s² less in the quick stop."""
    story = at(ENABLED, RUNNING)
    story.step(STOP)
    assert story.lasts(STOP, RAMP) == pytest.approx(0.12 + 0.1 / 0.415 + 0.03, abs=0.021)
    assert story.lasts(STOP, QUICK) == pytest.approx(0.12 + 0.1 / 0.5 + 0.03, abs=0.021)
    while story.state_machine.state is STOPPING:
        assert story.step(STOP) == OFF
    assert story.told == (LATCHED, "stop requested", True)


def test_a_base_that_brakes_with_half_of_its_deceleration_is_waited_for() -> None:
    story = at(ENABLED, RUNNING)
    story.step(STOP)
    cycles = round(0.5 / 0.4 / 0.01)
    for cycle in range(cycles):
        assert story.step(wheels(0.5 - 0.4 * 0.01 * cycle, STOP)) == RAMP
    assert story.step(wheels(0.0, STOP)) == OFF


def test_a_quick_stop_from_3_mps_at_0_9_mps2_is_waited_for_until_it_stands() -> None:
    story = Story()
    fast = load_robot(sample("bench")).robot
    limits = {"linear_mps": 3.0, "deceleration_mps2": 0.9, "emergency_deceleration_mps2": 0.9}
    fast = fast.model_copy(update={"limits": fast.limits.model_copy(update=limits)})
    story.state_machine = StateMachine(Braking(fast), ramp_timeout_s=8.0)
    fault = also(wheels(3.0), WRONG["drive fault"])
    story.step(READY)
    story.step(wheels(3.0))
    assert story.step(fault) == QUICK
    for cycle in range(round(3.0 / 0.9 / 0.01)):
        assert story.step(wheels(3.0 - 0.9 * 0.01 * cycle, fault)) == QUICK
    assert story.step(wheels(0.0, fault)) == OFF


def test_a_wheel_that_gets_faster_in_a_quick_stop_has_its_power_taken_in_the_third_cycle() -> None:
    story = at(ENABLED, RUNNING)
    story.step(also(RUNNING, WRONG["drive fault"]))
    runaway = also(wheels(0.7), WRONG["drive fault"])
    assert [story.step(runaway) for _ in range(3)] == [QUICK, QUICK, OFF]


def test_a_ramp_that_is_given_up_latches_with_its_own_cause() -> None:
    story = at(ENABLED, RUNNING)
    hopeless = also(RUNNING, WRONG["inactive"])
    story.step(hopeless)
    assert story.told == (STOPPING, "inactive", False)
    story.lasts(hopeless, RAMP)
    assert story.told == (STOPPING, "did not stop", True)
    assert story.state_machine.finding.detail.startswith("left turns on its ramp, 0.")


def test_the_ramp_takes_no_longer_than_timeouts_standstill_s() -> None:
    story = at(ENABLED, RUNNING)
    story.step(STOP)
    trembles = replace(STOP, speed_mps=0.0)
    assert story.lasts(trembles, RAMP) < 3.1  # it never stands: the allowed speed falls below zero


@pytest.mark.parametrize(
    ("wrong", "name"), [("stop requested", "stop requested"), ("inactive", "feedback implausible")]
)
def test_a_sensor_that_is_no_evidence_has_the_power_taken_at_once(wrong: str, name: str) -> None:
    story = at(ENABLED, RUNNING)
    story.step(also(RUNNING, WRONG[wrong]))
    assert story.step(also(replace(RUNNING, doubted="left showed no motion"), WRONG[wrong])) == OFF
    assert story.told == (STOPPING, name, True)


def test_in_a_quick_stop_too() -> None:
    story = at(ENABLED, RUNNING)
    assert story.step(also(RUNNING, WRONG["drive fault"])) == QUICK
    assert story.step(also(replace(RUNNING, doubted="left showed no motion"), WRONG["drive fault"])) == OFF


def test_a_quick_stop_ends_at_standstill_but_lasts_one_cycle_at_least() -> None:
    story = at(ENABLED)
    assert story.step(also(STANDING, WRONG["drive fault"])) == QUICK
    assert story.step(also(STANDING, WRONG["drive fault"])) == OFF
