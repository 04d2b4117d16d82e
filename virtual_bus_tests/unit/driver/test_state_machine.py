"""Who has power, and what takes it away: every state with every hazard."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from canbase_config.load import load_robot, sample
from canbase_driver.causes import DriverCause, Finding
from canbase_driver.cia402 import PowerGoal
from canbase_driver.motion.braking import Braking
from canbase_driver.supervision.hazards import BLOCKERS, HAZARDS
from canbase_driver.supervision.phases import NO_POWER, ORDERS, SHOWN, Drive, Orders, Phase
from canbase_driver.supervision.situation import Situation
from canbase_driver.supervision.state_machine import StateMachine
from canbase_runtime.driver_state import DriverState
from support.state_machine_story import (
    BOOTING,
    DISARMED,
    ENABLED,
    ENABLING,
    FOLLOW,
    LATCHED,
    OFF,
    OFFLINE,
    ON,
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

NOT_YET = {
    "bus failed": OFFLINE,
    "booting": BOOTING,
    "drive missing": BOOTING,
    "drive restarted": BOOTING,
    "not configured": OFFLINE,
} | dict.fromkeys(
    ("stop unproven", "drive silent", "watchdog missing", "inactive", "resetting", "command not zero", "not standing"),
    DISARMED,
)
BEFORE_POWER = [(wrong, state, False) for wrong, state in NOT_YET.items()] + [
    ("drive fault", LATCHED, True),
    ("watchdog tripped", LATCHED, True),
    ("stop requested", LATCHED, True),
]


@pytest.mark.parametrize("state", [OFFLINE, BOOTING, DISARMED])
@pytest.mark.parametrize(("wrong", "shown", "latched"), BEFORE_POWER)
def test_without_power_whatever_is_wrong_keeps_it_off(
    state: DriverState, wrong: str, shown: DriverState, latched: bool
) -> None:
    story = at(state)
    situation = also(READY, WRONG[wrong])
    for _ in range(3):
        assert story.step(situation) == OFF
    name = "booting" if wrong == "drive restarted" else wrong
    assert story.told == (shown, name, latched)
    assert story.state_machine.finding.clears_on


@pytest.mark.parametrize("state", [OFFLINE, BOOTING, DISARMED])
def test_when_nothing_is_wrong_the_drives_are_enabled_at_once(state: DriverState) -> None:
    story = at(state)
    assert story.step(READY) == ON
    assert story.told == (ENABLING, "enabling", False)
    assert story.step(STANDING) == FOLLOW
    assert story.told == (ENABLED, "none", False)


def test_while_nothing_is_wrong_it_follows() -> None:
    story = at(ENABLED, RUNNING)
    for _ in range(3):
        assert story.step(RUNNING) == FOLLOW
    assert story.told == (ENABLED, "none", False)


STOPS = [
    ("bus failed", QUICK, True),
    ("watchdog tripped", QUICK, True),
    ("drive fault", QUICK, True),
    ("drive restarted", QUICK, True),
    ("drive silent", QUICK, True),
    ("watchdog tripped", QUICK, True),
    ("watchdog missing", RAMP, True),
    ("drive disabled", QUICK, True),
    ("stalled", QUICK, True),
    ("feedback implausible", RAMP, True),
    ("did not stop", QUICK, True),
    ("stop requested", RAMP, True),
    ("inactive", RAMP, False),
    ("shutdown", RAMP, False),
]
"""Hazard, first step from ENABLED, latched."""


def test_the_tables_of_this_test_name_every_hazard_and_every_blocker() -> None:
    assert [name for name, _, _ in STOPS] == [hazard.cause.value for hazard in HAZARDS]
    assert {name for name, _, _ in BEFORE_POWER} - {"drive restarted"} == {blocker.cause.value for blocker in BLOCKERS}
    assert set(ORDERS) == set(SHOWN) == set(Phase)
    assert set(SHOWN.values()) == set(DriverState)


@pytest.mark.parametrize(("wrong", "first", "latched"), STOPS)
def test_from_enabled_each_hazard_stops_the_base_by_its_first_step(wrong: str, first: Orders, latched: bool) -> None:
    story = at(ENABLED, RUNNING)
    assert story.step(also(RUNNING, WRONG[wrong])) == first
    assert story.told == (STOPPING, wrong, latched)


@pytest.mark.parametrize(("wrong", "first", "latched"), [row for row in STOPS if row[0] != "drive disabled"])
def test_while_enabling_each_hazard_is_a_quick_stop_since_there_is_no_ramp_to_go_down(
    wrong: str, first: Orders, latched: bool
) -> None:
    story = at(ENABLING)
    assert story.step(also(READY, WRONG[wrong])) == QUICK
    assert story.told == (STOPPING, wrong, latched)


@pytest.mark.parametrize(("wrong", "first", "latched"), STOPS)
def test_on_the_ramp_only_what_needs_a_quick_stop_changes_the_step_and_the_cause_stays(
    wrong: str, first: Orders, latched: bool
) -> None:
    story = at(STOPPING, RUNNING)
    assert story.step(also(RUNNING, WRONG[wrong])) == (QUICK if first == QUICK else RAMP)
    assert story.told == (STOPPING, "stop requested", True)


@pytest.mark.parametrize("wrong", [name for name in WRONG if name != "shutdown"])
def test_latched_stays_latched_without_power_whatever_else_goes_wrong_or_well(wrong: str) -> None:
    story = at(LATCHED)
    assert story.step(also(READY, WRONG[wrong]), cycles=3) == OFF
    assert story.step(READY, cycles=3) == OFF
    assert story.told == (LATCHED, "drive fault", True)


@pytest.mark.parametrize("wrong", ["", *WRONG])
@pytest.mark.parametrize("state", list(DriverState))
def test_a_shutdown_ends_from_every_state_with_everything_wrong_in_bounded_time(state: DriverState, wrong: str) -> None:
    story = at(state, RUNNING)
    hopeless = also(RUNNING, WRONG.get(wrong, Situation()))  # still turning, still powered: no feedback helps
    situation = also(hopeless, WRONG["shutdown"])
    last = Orders(PowerGoal.ON, Drive.FOLLOW)
    start = story.now_s
    while not story.state_machine.finished:
        last = story.step(situation)
        assert story.now_s - start < 0.6 + 0.4 + 0.5 + 0.1
    assert last == OFF
    assert story.state_machine.state in NO_POWER
    assert story.state_machine.finding.cause.value == "shutdown"


@pytest.mark.parametrize("state", [OFFLINE, BOOTING, DISARMED, LATCHED])
def test_a_shutdown_without_power_ends_in_the_same_cycle(state: DriverState) -> None:
    story = at(state)
    story.step(also(READY, WRONG["shutdown"]))
    assert story.state_machine.finished


def test_enabling_gives_up_after_two_seconds_and_needs_a_reset() -> None:
    story = at(ENABLING)
    assert story.lasts(READY, ON) == pytest.approx(2.0, abs=0.021)
    assert story.told == (STOPPING, "enable timeout", True)
    assert story.state_machine.finding.detail == "after 2.0 s left is switch on disabled"
    story.step(READY, cycles=3)
    assert story.told == (LATCHED, "enable timeout", True)


def test_when_several_things_are_seen_at_once_the_first_cause_is_told() -> None:
    """This process was stopped; the watchdog stopped the drives, which left OPERATIONAL or failed by that."""
    story = at(ENABLED, RUNNING)
    several = also(also(RUNNING, WRONG["watchdog tripped"]), WRONG["drive disabled"])
    story.step(also(also(several, WRONG["drive fault"]), WRONG["drive restarted"]))
    assert story.state_machine.finding.cause.value == "watchdog tripped"


@pytest.mark.parametrize("wrong", ["drive fault", "drive silent", "drive restarted"])
def test_of_a_drive_that_the_watchdog_tripped_about_the_driver_tells_more(wrong: str) -> None:
    story = at(ENABLED, RUNNING)
    tripped = replace(also(RUNNING, WRONG["watchdog tripped"]), watchdog_about_drive=True)
    story.step(also(tripped, WRONG[wrong]))
    assert story.state_machine.finding.cause.value == wrong
    alone = at(ENABLED, RUNNING)
    assert alone.step(tripped) == QUICK
    assert alone.told == (STOPPING, "watchdog tripped", True)


@pytest.mark.parametrize("wrong", [name for name, _, latched in STOPS if latched])
def test_a_stop_that_needs_no_reset_is_taken_over_by_the_first_cause_that_does(wrong: str) -> None:
    story = at(ENABLED, RUNNING)
    inactive = also(RUNNING, WRONG["inactive"])
    story.step(inactive)
    story.step(also(inactive, WRONG[wrong]))
    assert story.told == (STOPPING, wrong, True)
    story.step(also(inactive, WRONG["bus failed"]))
    assert story.told == (STOPPING, wrong, True)  # the first that latched stays


@pytest.mark.parametrize(("wrong", "taken_over"), [("watchdog missing", True), ("drive disabled", False)])
def test_while_the_power_goes_off_drives_that_are_disabled_are_no_news(wrong: str, taken_over: bool) -> None:
    story = at(ENABLED, RUNNING)
    inactive = also(STANDING, WRONG["inactive"])
    assert story.step(inactive) == RAMP
    assert story.step(inactive) == OFF
    story.step(also(inactive, WRONG[wrong]))
    assert story.told == (STOPPING, wrong if taken_over else "inactive", taken_over)


@pytest.mark.parametrize("state", [LATCHED, DISARMED])
def test_a_reset_leads_to_disarmed_and_no_further(state: DriverState) -> None:
    story = at(state)
    story.state_machine.reset()
    assert story.state_machine.state is DISARMED
    assert not story.state_machine.latches
    assert story.step(also(READY, WRONG["command not zero"])) == OFF
    assert story.step(READY) == ON


@pytest.mark.parametrize("state", [OFFLINE, BOOTING, ENABLING, ENABLED, STOPPING])
def test_a_reset_in_any_other_state_is_our_own_mistake_and_changes_nothing(state: DriverState) -> None:
    story = at(state)
    before = story.told
    with pytest.raises(RuntimeError, match=f"reset in state {state.name}"):
        story.state_machine.reset()
    assert story.told == before


STO_OPEN = Situation(disabled="left is switch on disabled", unprepared="left stays in switch on disabled: STO?")


def test_the_way_to_switched_on_is_no_warning_while_it_takes_less_than_a_second() -> None:
    story = at(DISARMED, STO_OPEN)
    assert story.step(STO_OPEN, cycles=4) == Orders(PowerGoal.READY, Drive.ZERO)
    assert story.told == (DISARMED, "preparing", False)
    story.step(WRONG["command not zero"])
    story.step(STO_OPEN, cycles=99)
    assert story.state_machine.finding.cause.value == "preparing"
    story.step(STO_OPEN, cycles=3)
    assert story.state_machine.finding.cause.value == "drive not ready"


def test_drives_that_are_not_ready_are_waited_for_without_power_and_without_a_latch() -> None:
    story = at(DISARMED, STO_OPEN)
    for _ in range(1000):
        assert story.step(STO_OPEN) == Orders(PowerGoal.READY, Drive.ZERO)
    assert story.told == (DISARMED, "drive not ready", False)
    assert story.step(replace(STO_OPEN, unprepared="")) == ON
    assert story.state_machine.state is ENABLING


def test_while_they_are_waited_for_every_blocker_takes_the_power_off() -> None:
    story = at(DISARMED, STO_OPEN)
    story.step(STO_OPEN)
    for name in ("watchdog missing", "command not zero"):
        assert story.step(also(STO_OPEN, WRONG[name])) == OFF
        assert story.told == (DISARMED, name, False)


@pytest.mark.parametrize("waits", [STO_OPEN, Situation(unarmed="not on disk yet")])
def test_a_shutdown_takes_drives_back_that_were_prepared_for_power(waits: Situation) -> None:
    story = at(DISARMED)
    assert story.step(waits) == Orders(PowerGoal.READY, Drive.ZERO)
    assert story.step(also(waits, WRONG["shutdown"])) == OFF
    assert story.told == (DISARMED, "shutdown", False)
    assert story.state_machine.finished


# drives prepared ── the records say so on disk ── power
def test_no_power_before_the_record_is_on_disk() -> None:
    story = Story()
    waits = Situation(unarmed="not on disk yet")
    orders = story.step(waits, 500)
    assert (story.state_machine.state, story.state_machine.finding.cause.value) == (DISARMED, "stop record")
    assert orders == ORDERS[Phase.PREPARING]
    story.step(replace(waits, unprepared="no main voltage"), 102)
    assert story.state_machine.finding.cause.value == "drive not ready"
    story.step(READY)
    assert story.state_machine.state is ENABLING


def test_a_stop_of_before_the_start_is_latched_until_a_reset() -> None:
    before = Finding(DriverCause.DRIVE_FAULT, "latched since before the start: left_wheel", "reset")
    state_machine = StateMachine(Braking(load_robot(sample("bench")).robot), 3.0, before)
    for step in range(100):
        orders = state_machine.step(READY, 10.0 + step)
    assert orders == ORDERS[Phase.LATCHED]
    assert (state_machine.state, state_machine.finding, state_machine.latches) == (LATCHED, before, True)
    state_machine.reset()
    state_machine.step(READY, 200.0)
    assert state_machine.state is ENABLING


# Exactly at its limits: times that a float holds exactly


def exact(*steps: tuple[float, Situation]) -> StateMachine:
    """A state machine that has seen these situations at these times [s]."""
    state_machine = StateMachine(Braking(load_robot(sample("bench")).robot), ramp_timeout_s=3.0)
    for now_s, situation in steps:
        state_machine.step(situation, now_s)
    return state_machine


def just_after(now_s: float) -> float:
    return math.nextafter(now_s, now_s + 1.0)


def test_drives_may_take_a_whole_second_to_be_switched_on() -> None:
    assert exact((8.0, STO_OPEN), (9.0, STO_OPEN)).finding.cause is DriverCause.PREPARING
    assert exact((8.0, STO_OPEN), (just_after(9.0), STO_OPEN)).finding.cause is DriverCause.DRIVE_NOT_READY


def test_drives_may_take_two_seconds_to_operation_enabled_and_then_it_is_a_quick_stop() -> None:
    assert exact((8.0, READY), (10.0, READY)).phase is Phase.ENABLING
    late = exact((8.0, READY), (just_after(10.0), READY))
    assert (late.phase, late.finding.cause, late.latches) == (Phase.QUICK_STOP, DriverCause.ENABLE_TIMEOUT, True)


# 8 s enabled ── 9 s stop requested ── 12 s the ramp has had its 3 s
def test_a_ramp_may_take_its_whole_time() -> None:
    slow = also(replace(RUNNING, speed_mps=0.0), WRONG["stop requested"])
    begun = ((8.0, READY), (8.5, RUNNING), (9.0, slow))
    assert exact(*begun, (12.0, slow)).phase is Phase.RAMP
    assert exact(*begun, (just_after(12.0), slow)).phase is Phase.QUICK_STOP


# 9 s power off ── 9.5 s the drives have had half a second to report it
def test_drives_have_half_a_second_to_report_that_the_power_is_off() -> None:
    stop = also(STANDING, WRONG["inactive"])
    begun = ((8.0, READY), (8.25, STANDING), (8.5, stop), (9.0, stop))
    assert exact(*begun).phase is Phase.POWER_OFF
    assert exact(*begun, (9.5, stop)).phase is Phase.POWER_OFF
    assert exact(*begun, (just_after(9.5), stop)).phase is Phase.DISARMED


# 8 s latched ── 20 s reset ── the drives have their whole second to be switched on, not what the stop has left of it
def test_after_a_reset_the_time_for_the_drives_begins_anew() -> None:
    state_machine = exact((8.0, WRONG["drive fault"]), (20.0, READY))
    assert state_machine.phase is Phase.LATCHED
    state_machine.reset()
    causes = []
    for now_s in (20.0, 21.0, 21.25):
        state_machine.step(STO_OPEN, now_s)
        causes.append(state_machine.finding.cause)
    assert causes == [DriverCause.PREPARING, DriverCause.PREPARING, DriverCause.DRIVE_NOT_READY]


@pytest.mark.parametrize("powered", [False, True])
def test_a_shutdown_in_motion_ends_once_the_power_is_off(powered: bool) -> None:
    """Power off is reported at 9.0 s, or never: then it ends half a second later all the same."""
    stop = also(STANDING, WRONG["shutdown"])
    state_machine = exact((8.0, READY), (8.25, STANDING), (8.5, stop), (8.75, stop))
    assert (state_machine.phase, state_machine.finished) == (Phase.POWER_OFF, False)
    for cycle in range(200):
        if state_machine.finished:
            break
        state_machine.step(replace(stop, powered=powered), 9.0 + cycle / 128)
    assert state_machine.finished
    assert (state_machine.state, state_machine.finding.cause) == (DISARMED, DriverCause.SHUTDOWN)
    assert cycle == (35 if powered else 2)
