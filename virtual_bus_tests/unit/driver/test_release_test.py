"""When the drives let go of wheels that stand: how hard they pushed, and the way there and back. Pure, times in s."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import pytest

from canbase_config.robot import Robot
from canbase_driver.cia402 import Command, DriveState, PowerGoal, next_controlword
from canbase_driver.drives.release_test import LIFE_COUNTS, RETURN_S, ReleaseTest, TorqueEvidence
from support.chain_world import bench_robot

ENABLED, ON, OFF = DriveState.OPERATION_ENABLED, DriveState.SWITCHED_ON, DriveState.SWITCH_ON_DISABLED
CYCLE_S, LIMIT_S = 0.01, 0.05
COUNT_M = 1e-5


def new_evidence() -> TorqueEvidence:
    return TorqueEvidence(LIMIT_S, COUNT_M)


def samples_until_due(each: TorqueEvidence, share: float | None, ordered_mps: float = 0.1, most: int = 200) -> int:
    """Samples, a cycle apart, until it must let go; the first one begins the time. `most`: never."""
    for n in range(most):
        each.on_sample(0.0, share, ordered_mps, True, n * CYCLE_S)
        if each.must_release:
            return n
    return most


def test_a_millimetre_and_no_torque_are_signs_of_life() -> None:
    each, moves = new_evidence(), []
    for n, (travel_m, has_torque) in enumerate(
        [(0.0, True), (0.0009, True), (-0.0001, True), (0.0, True), (0.0, False)]
    ):
        each.on_sample(travel_m, 1.0, 0.1, has_torque, n * CYCLE_S)
        moves.append(each.encoder_moves)
    assert moves == [False, False, True, False, True]


@pytest.mark.parametrize(
    ("share", "cycles"), [(1.0, 5), (-1.0, 5), (0.5, 10), (0.051, 99), (0.0099, 200), (0.0, 5), (None, 5)]
)
def test_torque_and_time_make_the_limit_together(share: float | None, cycles: int) -> None:
    """A drive that tells no torque, or has told nothing but zero, may give the rated one."""
    assert samples_until_due(new_evidence(), share) in (cycles, cycles + 1)


def test_a_torque_that_was_told_once_may_be_zero_then() -> None:
    each = new_evidence()
    each.on_sample(0.0, 0.2, 0.1, True, 0.0)
    each.on_sample(0.002, 0.2, 0.1, True, CYCLE_S)
    for n in range(2, 500):
        each.on_sample(0.002, 0.0, 0.0, True, n * CYCLE_S)
    assert not each.must_release


def test_without_an_order_nothing_is_owed() -> None:
    assert samples_until_due(new_evidence(), 0.5, ordered_mps=0.0) == 200
    assert samples_until_due(new_evidence(), None, ordered_mps=0.0) == 200


def resting(*shares: float, step_m: float = 0.0) -> TorqueEvidence:
    """Held with a fifth of the rated torque for 0.2 s, and then with these."""
    each = new_evidence()
    for n, share in enumerate((*[0.2] * 20, *shares)):
        each.on_sample(step_m * max(0, n - 19), share, 0.0, True, n * CYCLE_S)
    return each


@pytest.mark.parametrize(
    ("share", "samples"), [(0.71, 10), (-0.31, 10), (0.5, 17), (0.31, 46), (0.299, 200), (0.101, 200), (0.0, 200)]
)
def test_a_torque_that_changes_with_nothing_ordered_has_to_be_released(share: float, samples: int) -> None:
    """0.05 s of the change at rated torque. A motor without torque is beside a closed brake."""
    assert not resting(*[share] * (samples - 1)).must_release
    assert resting(*[share] * samples).must_release is (samples < 200)


def test_a_torque_that_comes_back_or_an_encoder_that_counts_ends_it() -> None:
    assert not resting(*[0.7] * 6, 0.25, *[0.7] * 6).must_release
    assert not resting(*[0.7] * 100, step_m=LIFE_COUNTS * COUNT_M).must_release
    assert resting(*[0.7] * 30, step_m=COUNT_M / 100).must_release


def test_more_than_a_slope_takes_is_not_learned_as_what_holds_the_wheel() -> None:
    assert samples_until_due(new_evidence(), 0.6, ordered_mps=0.0) == 200
    assert samples_until_due(new_evidence(), 0.71, ordered_mps=0.0) == 24


@pytest.mark.parametrize(("step_m", "due"), [(0.00099, True), (0.00101, False), (-0.00101, False)])
def test_an_encoder_that_moves_begins_anew(step_m: float, due: bool) -> None:
    each, travel_m = new_evidence(), 0.0
    for n in range(20):
        travel_m += step_m * (n % 2 if due else 1)
        travel_m -= step_m * (n % 2 == 0 and due)
        each.on_sample(travel_m, 1.0, 0.1, True, n * CYCLE_S)
    assert each.must_release is due


def test_without_torque_it_owes_nothing_until_the_next_order() -> None:
    each = new_evidence()
    assert samples_until_due(each, 1.0) == 5
    each.on_sample(0.0, 0.0, 0.0, False, 0.06)
    for n in range(7, 60):
        each.on_sample(0.0, 0.5, 0.0, True, n * CYCLE_S)
    assert not each.must_release
    each.on_sample(0.0, 1.0, -0.001, True, 0.6)
    assert each.must_release


def test_a_gap_counts_as_a_tenth_of_a_second_and_a_time_that_went_back_as_nothing() -> None:
    each = new_evidence()
    each.on_sample(0.0, 0.4, 0.1, True, 0.0)
    each.on_sample(0.0, 0.4, 0.1, True, 60.0)
    assert each.pushed_s == pytest.approx(0.04)
    each.on_sample(0.0, 0.4, 0.1, True, 59.0)
    assert each.pushed_s == pytest.approx(0.04)


@dataclass
class Wheel:
    state: DriveState | None = ENABLED
    velocity_mps: float = 0.0
    torque_evidence: TorqueEvidence = field(default_factory=new_evidence)


def due() -> Wheel:
    wheel = Wheel()
    samples_until_due(wheel.torque_evidence, 1.0)
    return wheel


def robot(proof: str = "let_go") -> Robot:
    whole = bench_robot()
    return whole.model_copy(update={"watchdog": whole.watchdog.model_copy(update={"stand_proof": proof})})


def test_the_way_there_and_back() -> None:
    left, right, each = due(), Wheel(), ReleaseTest(robot())
    told = []
    for now_s, states in enumerate(((ENABLED, ENABLED), (ENABLED, ENABLED), (ON, ENABLED), (ON, ON), (ENABLED, ON))):
        left.state, right.state = states
        each.step((left, right), True, float(now_s))
        told.append(each.goal(0.0))
        assert each.active
    assert told == [PowerGoal.RELEASE, PowerGoal.RELEASE, PowerGoal.RELEASE, PowerGoal.ON, PowerGoal.ON]
    right.state = ENABLED
    each.step((left, right), True, 5.0)
    assert (each.active, each.goal(5.0)) == (False, PowerGoal.ON)


@pytest.mark.parametrize(
    ("rests", "other_mps", "proof", "goes"),
    [
        (True, 0.0, "let_go", True),
        (True, 0.05, "let_go", True),
        (True, -0.051, "let_go", False),
        (False, 0.0, "let_go", False),
        (True, 0.0, "none", False),
    ],
)
def test_all_wheels_rest_and_the_robot_wants_it(rests: bool, other_mps: float, proof: str, goes: bool) -> None:
    each = ReleaseTest(robot(proof))
    each.step((due(), Wheel(velocity_mps=other_mps)), rests, 1.0)
    assert each.active is goes


def test_no_wheel_that_is_due_no_letting_go() -> None:
    each = ReleaseTest(robot())
    each.step((Wheel(), Wheel()), True, 1.0)
    assert not each.active


def test_an_order_does_not_end_it_and_another_stop_does() -> None:
    wheels, each = (due(), Wheel()), ReleaseTest(robot())
    each.step(wheels, True, 1.0)
    each.step(wheels, False, 1.01)
    assert each.active
    each.end(ramps=True)
    assert not each.active


def test_on_the_ramp_of_a_stop_the_drives_are_excused_for_as_long_as_they_may_take_to_return() -> None:
    wheels, each = (due(), Wheel()), ReleaseTest(robot())
    each.step(wheels, True, 1.0)
    each.end(ramps=True)
    assert each.excuses(1.0 + RETURN_S)
    assert not each.excuses(1.01 + RETURN_S)


def test_once_the_power_is_off_no_drive_has_an_excuse() -> None:
    wheels, each = (due(), Wheel()), ReleaseTest(robot())
    each.step(wheels, True, 1.0)
    each.end(ramps=True)
    each.end(ramps=False)
    assert not each.excuses(1.01)
    each.end(ramps=True)
    assert not each.excuses(1.01)


def test_drives_that_are_back_have_no_excuse_and_a_new_letting_go_has_one_again() -> None:
    left, right, each = due(), Wheel(), ReleaseTest(robot())
    for now_s, state in ((1.0, ENABLED), (1.01, ON), (1.02, ENABLED)):
        left.state = right.state = state
        each.step((left, right), True, now_s)
    assert not each.excuses(1.02)
    each.step((left, right), True, 1.03)
    assert each.excuses(1.03)


@pytest.mark.parametrize(("answer_s", "feedback_s", "until_s"), [(0.2, 0.1, 0.05), (0.2, 0.5, 0.1), (0.06, 0.1, 0.03)])
def test_a_drive_that_ignores_disable_operation_is_told_disable_voltage(
    answer_s: float, feedback_s: float, until_s: float
) -> None:
    """Before the watchdog trips: nobody answered, or one drive has no power while another turns."""
    mine = robot()
    watchdog = mine.watchdog.model_copy(update={"stand_answer_s": answer_s})
    timeouts = mine.timeouts.model_copy(update={"feedback_s": feedback_s})
    wheels, each = (due(), Wheel()), ReleaseTest(mine.model_copy(update={"watchdog": watchdog, "timeouts": timeouts}))
    each.step(wheels, True, 0.0)
    words = [next_controlword(ENABLED, each.goal(at)) for at in (0.0, until_s, math.nextafter(until_s, 1.0))]
    assert words == [0x07, 0x07, Command.DISABLE_VOLTAGE.value]


def test_the_way_up_from_any_state_without_torque() -> None:
    for first, then in pairwise((OFF, DriveState.READY_TO_SWITCH_ON, ON)):
        assert next_controlword(first, PowerGoal.RELEASE) == next_controlword(first, PowerGoal.READY)
        assert next_controlword(then, PowerGoal.RELEASE) == next_controlword(then, PowerGoal.READY)


def test_a_drive_that_does_not_come_back_is_no_excuse_for_ever() -> None:
    each = ReleaseTest(robot())
    each.step((due(), Wheel()), True, 1.0)
    assert each.excuses(1.0 + RETURN_S)
    assert not each.excuses(1.01 + RETURN_S)


def test_a_drive_of_unknown_state_may_have_torque() -> None:
    wheels, each = (due(), Wheel()), ReleaseTest(robot())
    each.step(wheels, True, 1.0)
    wheels[0].state, wheels[1].state = None, ON
    each.step(wheels, True, 1.01)
    assert each.goal(1.01) is PowerGoal.RELEASE


@pytest.mark.parametrize(("counts", "moves"), [(1, False), (2, True)])
def test_of_a_coarse_encoder_two_counts_are_a_sign_of_life(counts: int, moves: bool) -> None:
    each = TorqueEvidence(LIMIT_S, 2**-8)
    each.on_sample(0.0, 1.0, 0.1, True, 0.0)
    each.on_sample(counts * 2**-8, 1.0, 0.1, True, CYCLE_S)
    assert each.encoder_moves is moves


def test_before_its_first_sample_nothing_is_held_against_a_wheel() -> None:
    assert new_evidence().encoder_moves


@pytest.mark.parametrize(("share", "pushed"), [(0.01, True), (-0.01, True), (0.00999, False)])
def test_from_a_hundredth_of_the_rated_torque_on_a_wheel_may_move(share: float, pushed: bool) -> None:
    each = new_evidence()
    for now_s in (0.0, CYCLE_S):
        each.on_sample(0.0, share, 0.1, True, now_s)
    assert (each.pushed_s > 0.0) is pushed
