"""The rule that climbs the ladder, row by row, with times dense at the deadlines. Deceleration 1 m/s²."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_watchdog.ladder import RUNGS, Climb, Look, Step, advance, first

BRAKING = Look(enabled=False, powered=True, standing=False, speed_mps=0.5, seen_at=10.0, present=True)
ENABLED = replace(BRAKING, enabled=True)
STANDING = replace(BRAKING, powered=False, standing=True, speed_mps=0.0)
ROLLING = replace(BRAKING, powered=False)
FOOT = Climb(Step.QUICK_STOP, since=9.9, speed_mps=0.5)


def go(climb: Climb, look: Look, now: float) -> Climb:
    return advance(climb, look, 1.0, now)


def test_the_ladder_has_four_rungs_and_each_but_the_last_has_its_deadlines() -> None:
    assert list(RUNGS) == list(Step)[1:]
    assert [step for step, rung in RUNGS.items() if rung.step is not step] == []
    assert [(rung.obey_s, rung.stand_s) for rung in list(RUNGS.values())[:-1]] == [(0.15, 0.3)] * 3


def test_it_begins_with_the_quick_stop() -> None:
    assert first(BRAKING, 3.0) == Climb(Step.QUICK_STOP, 3.0, 0.5, stopped=False)


# trip 9.900          10.050 obey: enabled drives climb       10.700 stand: 0.5 m/s / 1 m/s² + 0.3 s
#   |------------------|----------------------------------------|
@pytest.mark.parametrize(
    ("now", "look", "step"),
    [
        (10.049, ENABLED, Step.QUICK_STOP),
        (10.051, ENABLED, Step.PRE_OPERATIONAL),
        (10.051, BRAKING, Step.QUICK_STOP),
        (10.051, replace(BRAKING, seen_at=9.9), Step.PRE_OPERATIONAL),  # nothing heard since the trip
        (10.051, replace(BRAKING, seen_at=9.8), Step.PRE_OPERATIONAL),
        (10.051, replace(BRAKING, seen_at=9.901), Step.QUICK_STOP),
        (10.051, replace(STANDING, seen_at=9.9), Step.PRE_OPERATIONAL),
        (10.049, replace(STANDING, seen_at=9.9), Step.QUICK_STOP),
        (10.699, BRAKING, Step.QUICK_STOP),
        (10.701, BRAKING, Step.PRE_OPERATIONAL),
        (10.701, ROLLING, Step.QUICK_STOP),  # without power no rung can brake it
        (99.0, ROLLING, Step.QUICK_STOP),
        (99.0, replace(ENABLED, present=False), Step.QUICK_STOP),  # no such node on the bus
    ],
)
def test_deadlines(now: float, look: Look, step: Step) -> None:
    assert go(FOOT, look, now).step is step


def test_at_the_very_deadline_it_climbs() -> None:
    assert go(FOOT, ENABLED, FOOT.since + 0.15).step is Step.PRE_OPERATIONAL
    assert go(FOOT, BRAKING, FOOT.since + 0.3 + FOOT.speed_mps / 1.0).step is Step.PRE_OPERATIONAL


@pytest.mark.parametrize(("now", "step"), [(10.449, Step.QUICK_STOP), (10.451, Step.PRE_OPERATIONAL)])
def test_a_base_that_brakes_harder_has_less_time(now: float, step: Step) -> None:
    """0.5 m/s / 2 m/s² + 0.3 s after 9.9."""
    assert advance(FOOT, BRAKING, 2.0, now).step is step


def test_a_new_rung_has_new_deadlines_and_takes_the_speed_of_now() -> None:
    assert go(FOOT, replace(ENABLED, speed_mps=0.4), 10.1) == Climb(Step.PRE_OPERATIONAL, 10.1, 0.4)


@pytest.mark.parametrize("seen_at", [9.901, 10.0])
def test_standing_by_fresh_feedback_ends_it(seen_at: float) -> None:
    assert go(FOOT, replace(STANDING, seen_at=seen_at), 10.0) == replace(FOOT, stopped=True)
    held = replace(STANDING, seen_at=seen_at, powered=True)  # quick stop active holds the wheel
    assert go(FOOT, held, 10.0).stopped


def test_standing_but_enabled_is_not_stopped() -> None:
    assert not go(FOOT, replace(STANDING, enabled=True), 10.0).stopped


@pytest.mark.parametrize("seen_at", [9.8, 9.9])
def test_old_feedback_does_not_end_it(seen_at: float) -> None:
    assert not go(FOOT, replace(STANDING, seen_at=seen_at), 10.0).stopped


def test_enabled_again_after_it_stood_climbs_at_once() -> None:
    stood = replace(FOOT, stopped=True)
    assert go(stood, replace(STANDING, enabled=True), 10.0) == Climb(Step.PRE_OPERATIONAL, 10.0, 0.0)


def test_moving_again_begins_the_same_rung_anew() -> None:
    stood = Climb(Step.DISABLE_VOLTAGE, 9.9, 0.5, stopped=True)
    assert go(stood, ROLLING, 10.0) == Climb(Step.DISABLE_VOLTAGE, 10.0, 0.5)


def test_it_stays_stopped_while_it_stands() -> None:
    stood = replace(FOOT, stopped=True)
    assert go(stood, STANDING, 99.0) == stood


@pytest.mark.parametrize(
    ("step", "above"),
    [
        (Step.QUICK_STOP, Step.PRE_OPERATIONAL),
        (Step.PRE_OPERATIONAL, Step.DISABLE_VOLTAGE),
        (Step.DISABLE_VOLTAGE, Step.HEARTBEAT_WITHHELD),
        (Step.HEARTBEAT_WITHHELD, Step.HEARTBEAT_WITHHELD),
    ],
)
def test_rungs_follow_each_other_and_the_last_is_the_last(step: Step, above: Step) -> None:
    assert go(replace(FOOT, step=step), ENABLED, 99.0).step is above
    assert go(replace(FOOT, step=step, stopped=True), ENABLED, 99.0).step is above
