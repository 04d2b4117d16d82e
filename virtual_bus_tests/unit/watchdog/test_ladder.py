"""The rule that climbs the ladder, row by row, with times and speeds dense at the limits.

A wheel may keep its speed for 0.1 s and must then lose 0.5 m/s²; 0.05 m/s and 10 % are forgiven. It rolls for 2 s.
"""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from canbase_watchdog.ladder import RUNGS, Braking, LadderPosition, NodeFeedback, Step, advance, first

RULES = Braking(lag_s=0.1, least_mps2=0.5, tolerance_mps=0.05, tolerance_share=0.1, coasting_s=2.0, samples=3)
BRAKING = NodeFeedback(
    enabled=False,
    powered=True,
    standing=False,
    speed_mps=0.4,
    begin_mps=0.5,
    seen_at=10.0,
    present=True,
    trusted=True,
    reading_s=0.04,
)
ENABLED = replace(BRAKING, enabled=True)
STANDING = replace(BRAKING, powered=False, standing=True, speed_mps=0.0, begin_mps=0.0)
ROLLING = replace(BRAKING, powered=False)
FOOT = LadderPosition(Step.QUICK_STOP, since=9.9, begin_mps=0.5)
OFF = LadderPosition(Step.DISABLE_VOLTAGE, since=9.9, begin_mps=0.5)


def go(position: LadderPosition, feedback: NodeFeedback, now_s: float) -> LadderPosition:
    return advance(position, feedback, RULES, now_s)


def fed(position: LadderPosition, feedback: NodeFeedback, *samples: tuple[float, float]) -> LadderPosition:
    """Samples of (time, speed), each looked at as it comes and once more a moment later."""
    for at, speed_mps in samples:
        sample = replace(feedback, seen_at=at, speed_mps=speed_mps)
        position = go(go(position, sample, at), sample, at + 0.005)
    return position


def test_the_ladder_has_five_rungs_and_each_but_the_last_has_its_deadline() -> None:
    assert list(RUNGS) == list(Step)[1:]
    assert [step for step, rung in RUNGS.items() if rung.step is not step] == []
    assert [rung.obey_s for rung in RUNGS.values()] == [0.15, 0.15, 0.1, 0.1, math.inf]


def test_it_begins_with_the_quick_stop() -> None:
    position = first(BRAKING, 3.0)
    assert (position.step, position.since, position.begin_mps) == (Step.QUICK_STOP, 3.0, 0.5)
    assert (position.stopped, position.runaway, position.assumed, position.too_fast_samples) == (False, False, False, 0)


# trip 9.900          10.050 obey: a drive that is still enabled, or not heard, is on the next rung
#   |------------------|
@pytest.mark.parametrize(
    ("now_s", "feedback", "step"),
    [
        (10.049, ENABLED, Step.QUICK_STOP),
        (10.051, ENABLED, Step.PRE_OPERATIONAL),
        (10.051, BRAKING, Step.QUICK_STOP),
        (10.051, replace(BRAKING, seen_at=9.9), Step.PRE_OPERATIONAL),  # nothing heard since the trip
        (10.051, replace(BRAKING, seen_at=9.8), Step.PRE_OPERATIONAL),
        (10.049, replace(BRAKING, seen_at=9.8), Step.QUICK_STOP),
        (10.051, replace(BRAKING, seen_at=9.901 + 0.001), Step.QUICK_STOP),
        (10.149, BRAKING, Step.QUICK_STOP),
        (10.151, BRAKING, Step.PRE_OPERATIONAL),  # heard at 10.000, and never again
        (10.051, replace(STANDING, seen_at=9.9), Step.PRE_OPERATIONAL),
        (10.049, replace(STANDING, seen_at=9.9), Step.QUICK_STOP),
        (10.149, ROLLING, Step.QUICK_STOP),  # without power no rung can brake it
        (99.0, replace(ROLLING, seen_at=98.99), Step.QUICK_STOP),
        (99.0, replace(ENABLED, present=False), Step.QUICK_STOP),  # no such node on the bus
    ],
)
def test_deadlines(now_s: float, feedback: NodeFeedback, step: Step) -> None:
    assert go(FOOT, feedback, now_s).step is step


def test_at_the_very_deadline_it_climbs() -> None:
    assert go(FOOT, ENABLED, FOOT.since + 0.15).step is Step.PRE_OPERATIONAL
    assert go(FOOT, BRAKING, BRAKING.seen_at + 0.15).step is Step.PRE_OPERATIONAL


@pytest.mark.parametrize(
    ("now_s", "feedback", "step"),
    [
        (9.999, BRAKING, Step.DISABLE_VOLTAGE),
        (10.001, BRAKING, Step.HEARTBEAT_WITHHELD),  # quick stop active has power still
        (10.001, ROLLING, Step.DISABLE_VOLTAGE),
        (10.101, ROLLING, Step.HEARTBEAT_WITHHELD),  # heard at 10.000, and never again
    ],
)
def test_power_off_is_obeyed_when_the_power_is_off(now_s: float, feedback: NodeFeedback, step: Step) -> None:
    assert go(OFF, feedback, now_s).step is step


# allowed: 0.5 × 1.1 + 0.05 = 0.60 m/s until 10.000, then 0.5 m/s² less
@pytest.mark.parametrize(
    ("samples", "step"),
    [
        ([(9.91, 0.599), (9.92, 0.599), (9.93, 0.599), (9.94, 0.599)], Step.QUICK_STOP),
        ([(9.91, 0.601), (9.92, 0.601)], Step.QUICK_STOP),
        ([(9.91, 0.601), (9.92, 0.601), (9.93, 0.601)], Step.DISABLE_VOLTAGE),
        ([(9.91, 0.601), (9.92, 0.601), (9.93, 0.599), (9.94, 0.601), (9.95, 0.601)], Step.QUICK_STOP),
        ([(9.9, 0.7), (9.91, 0.7), (9.92, 0.7)], Step.QUICK_STOP),  # the first one is from before the trip
        ([(10.1, 0.549), (10.11, 0.544), (10.12, 0.539)], Step.QUICK_STOP),
        ([(10.1, 0.551), (10.11, 0.546), (10.12, 0.541)], Step.DISABLE_VOLTAGE),
        ([(11.21, 0.01), (11.22, 0.01), (11.23, 0.01)], Step.DISABLE_VOLTAGE),  # creeps on when it should stand
    ],
)
def test_a_wheel_that_does_not_brake_has_its_power_taken_at_once(
    samples: list[tuple[float, float]], step: Step
) -> None:
    position = fed(replace(FOOT), BRAKING, *samples)
    assert (position.step, position.runaway) == (step, step is Step.DISABLE_VOLTAGE)


def test_at_20_hz_two_samples_count() -> None:
    two = replace(RULES, samples=2)
    feedback = replace(BRAKING, speed_mps=0.601)
    position = advance(FOOT, replace(feedback, seen_at=9.91), two, 9.91)
    assert position.step is Step.QUICK_STOP
    assert advance(position, replace(feedback, seen_at=9.96), two, 9.96).step is Step.DISABLE_VOLTAGE


def test_a_wheel_that_keeps_its_speed_within_the_bound_has_its_power_taken_too() -> None:
    position = go(FOOT, replace(BRAKING, unslowed=True), 10.0)
    assert (position.step, position.runaway) == (Step.DISABLE_VOLTAGE, True)
    assert not go(FOOT, replace(STANDING, unslowed=True), 10.0).runaway


def test_the_limit_itself_is_allowed() -> None:
    limit_mps = RULES.allowed_mps(0.5, 0.05)
    assert limit_mps == pytest.approx(0.6)
    assert fed(FOOT, BRAKING, *[(9.95 + i / 1000, limit_mps) for i in range(4)]).too_fast_samples == 0


def test_a_wheel_that_has_no_speed_brakes_though_its_standstill_is_not_proven() -> None:
    position = fed(FOOT, BRAKING, *[(11.3 + i / 100, 0.0) for i in range(4)])
    assert (position.step, position.runaway, position.too_fast_samples) == (Step.QUICK_STOP, False, 0)


def test_a_rolling_wheel_without_power_and_one_that_stands_count_nothing_against_them() -> None:
    fast = [(9.91 + i / 100, 3.0) for i in range(5)]
    assert fed(FOOT, ROLLING, *fast).too_fast_samples == 0
    assert fed(FOOT, replace(BRAKING, standing=True, enabled=True), (11.3, 0.004)).too_fast_samples == 0


@pytest.mark.parametrize(
    ("step", "above"),
    [
        (Step.QUICK_STOP, Step.DISABLE_VOLTAGE),
        (Step.PRE_OPERATIONAL, Step.DISABLE_VOLTAGE),
        (Step.DISABLE_VOLTAGE, Step.HEARTBEAT_WITHHELD),
        (Step.HEARTBEAT_WITHHELD, Step.RESET_NODE),
        (Step.RESET_NODE, Step.RESET_NODE),
    ],
)
def test_a_runaway_leaves_out_the_rungs_that_leave_the_braking_to_the_drive(step: Step, above: Step) -> None:
    position = fed(replace(FOOT, step=step), BRAKING, (9.91, 3.0), (9.92, 3.0), (9.93, 3.0))
    assert (position.step, position.runaway) == (above, True)


def test_the_relay_stays_open_on_the_rungs_after_it() -> None:
    assert go(replace(OFF, runaway=True), BRAKING, 10.1).runaway
    assert not go(FOOT, ENABLED, 10.051).runaway


# A sensor that lies


def test_a_sensor_that_lies_costs_the_power_at_once() -> None:
    position = go(FOOT, replace(BRAKING, trusted=False), 9.9)
    assert (position.step, position.since, position.runaway) == (Step.DISABLE_VOLTAGE, 9.9, False)
    assert go(replace(FOOT, step=Step.PRE_OPERATIONAL), replace(BRAKING, trusted=False), 9.9).step is (
        Step.DISABLE_VOLTAGE
    )
    assert go(OFF, replace(BRAKING, trusted=False), 9.95).step is Step.DISABLE_VOLTAGE


def test_its_standstill_is_no_evidence() -> None:
    held = replace(STANDING, trusted=False, powered=True)
    assert not go(FOOT, held, 10.0).stopped
    assert not go(OFF, held, 9.99).stopped


# power off, by feedback, at 10.000 ── 2 s ── a stand is assumed
@pytest.mark.parametrize(("now_s", "stopped"), [(11.999, False), (12.0, True), (12.001, True)])
def test_without_power_a_stand_is_assumed_when_it_must_have_rolled_out(now_s: float, stopped: bool) -> None:
    off = go(OFF, replace(STANDING, trusted=False), 10.0)
    assert not off.stopped
    after = go(off, replace(STANDING, trusted=False, seen_at=now_s), now_s)
    assert (after.stopped, after.assumed) == (stopped, stopped)


def test_power_in_between_begins_the_rolling_anew() -> None:
    liar = replace(STANDING, trusted=False)
    off = go(OFF, liar, 10.0)
    on = go(off, replace(liar, powered=True, seen_at=10.05), 10.05)
    assert on.off_since == math.inf
    off = go(on, replace(liar, seen_at=10.06), 10.06)
    assert not go(off, replace(liar, seen_at=12.05), 12.05).stopped
    assert go(off, replace(liar, seen_at=12.07), 12.07).stopped


# power off, by feedback, at 10.000 ── 12.0 assumed ── 12.5 half of its values come after a pause ── 12.51 the others
def test_a_look_that_cannot_tell_does_not_let_a_wheel_without_power_roll_anew() -> None:
    liar = replace(STANDING, trusted=False)
    assumed = go(go(OFF, liar, 10.0), replace(liar, seen_at=12.0), 12.0)
    assert assumed.assumed
    unclear = go(assumed, replace(liar, standing=False, seen_at=12.5), 12.5)
    assert (unclear.step, unclear.stopped) == (Step.DISABLE_VOLTAGE, False)
    again = go(unclear, replace(liar, seen_at=12.51), 12.51)
    assert (again.stopped, again.assumed) == (True, True)
    powered = go(unclear, replace(liar, powered=True, seen_at=12.51), 12.51)
    assert not go(powered, replace(liar, seen_at=12.6), 12.6).stopped


# off since 10.0 ── 11.0 not read for 0.1 s, next rung ── 12.0 off for 2 s all the same
def test_a_rung_more_gives_a_wheel_without_power_none() -> None:
    liar = replace(STANDING, trusted=False)
    off = go(OFF, liar, 10.0)
    above = go(off, liar, 11.0)
    assert (above.step, above.off_since) == (Step.HEARTBEAT_WITHHELD, 10.0)
    assert not go(above, replace(liar, seen_at=11.999), 11.999).stopped
    assert go(above, replace(liar, seen_at=12.0), 12.0).stopped


# a turn of readings takes 0.08 s, of two axes: one may be lost
@pytest.mark.parametrize(("now_s", "step"), [(10.059, Step.DISABLE_VOLTAGE), (10.061, Step.HEARTBEAT_WITHHELD)])
def test_a_node_of_several_axes_has_the_time_of_two_readings(now_s: float, step: Step) -> None:
    rolling = replace(ROLLING, seen_at=9.9, reading_s=0.08)
    assert go(OFF, rolling, now_s).step is step
    powered = replace(rolling, powered=True, speed_mps=0.0, seen_at=now_s)
    assert go(OFF, powered, now_s).step is step


def test_a_trusted_stand_is_seen_not_assumed() -> None:
    assert not go(FOOT, STANDING, 10.0).assumed


# Stopped, and what comes after


@pytest.mark.parametrize("seen_at", [9.901, 10.0])
def test_standing_by_fresh_feedback_ends_it(seen_at: float) -> None:
    assert go(FOOT, replace(STANDING, seen_at=seen_at), 10.0).stopped
    held = replace(STANDING, seen_at=seen_at, powered=True)  # quick stop active holds the wheel
    assert go(FOOT, held, 10.0).stopped


def test_standing_but_enabled_is_not_stopped() -> None:
    assert not go(FOOT, replace(STANDING, enabled=True), 10.0).stopped


@pytest.mark.parametrize("seen_at", [9.8, 9.9])
def test_old_feedback_does_not_end_it(seen_at: float) -> None:
    assert not go(FOOT, replace(STANDING, seen_at=seen_at), 10.0).stopped


def test_enabled_again_after_it_stood_climbs_at_once() -> None:
    stood = replace(FOOT, stopped=True)
    assert go(stood, replace(STANDING, enabled=True, powered=True), 10.0) == LadderPosition(
        Step.PRE_OPERATIONAL, 10.0, 0.0
    )
    end = replace(FOOT, step=Step.HEARTBEAT_WITHHELD, stopped=True)
    again = go(end, replace(STANDING, enabled=True, powered=True), 10.0)
    assert (again.step, again.stopped, again.since) == (Step.HEARTBEAT_WITHHELD, False, 10.0)


def test_moving_again_begins_the_same_rung_anew() -> None:
    stood = LadderPosition(Step.DISABLE_VOLTAGE, 9.9, 0.5, stopped=True)
    assert go(stood, ROLLING, 10.0) == LadderPosition(Step.DISABLE_VOLTAGE, 10.0, 0.5, off_since=10.0)
    assert go(replace(stood, runaway=True), ROLLING, 10.0).runaway


@pytest.mark.parametrize(("step", "then"), [(Step.QUICK_STOP, Step.QUICK_STOP), (Step.DISABLE_VOLTAGE,) * 2])
def test_a_stand_that_a_liar_showed_was_none(step: Step, then: Step) -> None:
    stood = replace(FOOT, step=step, stopped=True, sampled_at=STANDING.seen_at)
    again = go(stood, replace(STANDING, trusted=False), 99.0)
    assert (again.step, again.stopped, again.since) == (then, False, 99.0)
    assert go(again, replace(STANDING, trusted=False, seen_at=99.001), 99.001).step is Step.DISABLE_VOLTAGE
    assumed = replace(stood, assumed=True)
    assert go(assumed, replace(STANDING, trusted=False), 99.0).stopped


# standing, and held with power, from 10.0 on ── 0.2 s for the drive or the driver ── power off
@pytest.mark.parametrize(("now_s", "step"), [(10.199, Step.QUICK_STOP), (10.2, Step.DISABLE_VOLTAGE)])
def test_a_drive_that_goes_on_holding_loses_its_power(now_s: float, step: Step) -> None:
    held = replace(STANDING, powered=True)
    stood = go(FOOT, held, 10.0)
    assert stood.stopped
    assert go(stood, replace(held, seen_at=now_s), now_s).step is step
    assert go(stood, replace(STANDING, seen_at=now_s), now_s).step is Step.QUICK_STOP
    off = replace(stood, step=Step.DISABLE_VOLTAGE)
    above = Step.HEARTBEAT_WITHHELD if step is Step.DISABLE_VOLTAGE else Step.DISABLE_VOLTAGE
    assert go(off, replace(held, seen_at=now_s), now_s).step is above
    end = replace(stood, step=Step.HEARTBEAT_WITHHELD)
    assert go(end, replace(held, seen_at=now_s), now_s).step is Step.HEARTBEAT_WITHHELD


def test_it_stays_stopped_while_it_stands() -> None:
    stood = replace(FOOT, stopped=True, sampled_at=STANDING.seen_at)
    assert go(stood, STANDING, 99.0) == stood


@pytest.mark.parametrize(
    ("step", "above"),
    [
        (Step.QUICK_STOP, Step.PRE_OPERATIONAL),
        (Step.PRE_OPERATIONAL, Step.DISABLE_VOLTAGE),
        (Step.DISABLE_VOLTAGE, Step.HEARTBEAT_WITHHELD),
        (Step.HEARTBEAT_WITHHELD, Step.RESET_NODE),
        (Step.RESET_NODE, Step.RESET_NODE),
    ],
)
def test_rungs_follow_each_other_and_the_last_is_the_last(step: Step, above: Step) -> None:
    assert go(replace(FOOT, step=step), ENABLED, 99.0).step is above
    assert go(replace(FOOT, step=step, stopped=True), ENABLED, 99.0).step is min(above, Step.HEARTBEAT_WITHHELD)


# power off ordered, own heartbeat withheld at 9.900 ── 0.1 s ── NMT reset node, if the drive says that it has power
WITHHELD = LadderPosition(Step.HEARTBEAT_WITHHELD, since=9.9, begin_mps=0.5)


@pytest.mark.parametrize(
    ("now_s", "feedback", "step"),
    [
        (9.999, replace(BRAKING, seen_at=9.99), Step.HEARTBEAT_WITHHELD),
        (10.001, BRAKING, Step.RESET_NODE),
        (10.001, ENABLED, Step.RESET_NODE),
        (10.001, replace(BRAKING, seen_at=9.901), Step.RESET_NODE),
        (10.001, replace(BRAKING, seen_at=9.9), Step.HEARTBEAT_WITHHELD),  # said on the rung before, and nothing since
        (99.0, replace(BRAKING, seen_at=9.8), Step.HEARTBEAT_WITHHELD),  # not heard: it may be off
        (10.001, ROLLING, Step.HEARTBEAT_WITHHELD),
        (99.0, replace(ROLLING, seen_at=98.99), Step.HEARTBEAT_WITHHELD),
        (99.0, replace(ROLLING, seen_at=98.99, trusted=False), Step.HEARTBEAT_WITHHELD),
        (10.001, replace(BRAKING, trusted=False), Step.RESET_NODE),
        (10.001, replace(BRAKING, present=False), Step.HEARTBEAT_WITHHELD),
        (10.001, replace(STANDING, seen_at=10.0), Step.HEARTBEAT_WITHHELD),
    ],
)
def test_only_a_drive_that_says_itself_that_it_kept_its_power_is_reset(
    now_s: float, feedback: NodeFeedback, step: Step
) -> None:
    assert go(WITHHELD, feedback, now_s).step is step


def test_at_its_very_deadline_it_is_reset() -> None:
    assert go(WITHHELD, BRAKING, WITHHELD.since + 0.1).step is Step.RESET_NODE


def test_a_reset_drive_that_rolls_without_power_is_waited_for() -> None:
    reset = replace(WITHHELD, step=Step.RESET_NODE)
    for at in (10.0, 12.0, 99.0):
        assert go(reset, replace(ROLLING, seen_at=at), at) == replace(reset, sampled_at=at, off_since=at)


@pytest.mark.parametrize("feedback", [ENABLED, BRAKING, ROLLING])
def test_after_a_reset_power_is_ordered_off_before_the_next_one(feedback: NodeFeedback) -> None:
    stood = LadderPosition(Step.RESET_NODE, 9.9, 0.5, stopped=True)
    off_since = math.inf if feedback.powered else 10.5
    expected = LadderPosition(Step.HEARTBEAT_WITHHELD, 10.5, 0.5, off_since=off_since)
    assert go(stood, replace(feedback, seen_at=10.5), 10.5) == expected


@pytest.mark.parametrize("step", list(Step))
def test_the_relay_is_left_for_a_drive_that_keeps_its_power_or_its_speed(step: Step) -> None:
    position = LadderPosition(step, since=10.0, begin_mps=0.5)
    assert position.defied is (step is Step.RESET_NODE)
    assert replace(position, runaway=True).defied is True
