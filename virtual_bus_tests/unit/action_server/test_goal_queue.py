"""The three goal policies as stories, and a storm of goals and cancels in which each goal must end once and rightly."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import replace

import pytest

from canbase_action_server.goal_request import DriveRequest, RotateRequest
from canbase_action_server.inputs import Inputs
from canbase_action_server.motion import STOP
from canbase_action_server.motion_limits import lever_m
from canbase_action_server.outcome import ErrorCode
from support.action_plant import GOOD_SAFETY, replaced
from support.goal_queue_world import GoalQueueWorld, Policy, Told, robot_with


def estop(inputs: Inputs) -> Inputs:
    return replaced(inputs, math.inf, safety=replace(GOOD_SAFETY, estop=True, detail="pressed"))


def test_reject_refuses_whatever_comes_while_a_goal_waits_or_runs() -> None:
    world = GoalQueueWorld(robot_with("reject"))
    first = world.ask_way(0.3)
    assert world.ask(DriveRequest(0.1, 0.2)) is None  # not begun yet
    world.run(0.5)
    assert world.ask(DriveRequest(0.1, 0.2)) is None
    assert all("busy" in reason for reason in world.refusals)
    world.run_out()
    assert world.code(first) is ErrorCode.OK
    assert world.ask(DriveRequest(0.1, 0.2)) is not None


def test_a_wrong_number_is_told_before_busy() -> None:
    world = GoalQueueWorld(robot_with("reject"))
    world.ask_way(0.3)
    world.ask(DriveRequest(100.0, 0.2))
    assert "outside" in world.refusals[-1]


def test_a_goal_that_was_refused_or_is_known_cannot_be_admitted() -> None:
    world = GoalQueueWorld(robot_with("queue"))
    key = world.ask_way(0.3)
    with pytest.raises(RuntimeError, match="known already"):
        world.goal_queue.admit(key, DriveRequest(0.1, 0.2), world.now_s)
    with pytest.raises(RuntimeError, match="outside"):
        world.goal_queue.admit("new", DriveRequest(100.0, 0.2), world.now_s)


def test_odometry_that_becomes_too_old_between_judgement_and_admission_ends_the_goal_and_is_no_defect() -> None:
    world = GoalQueueWorld(robot_with("reject"))
    request, last = DriveRequest(0.3, 0.2), world.inputs.odometry
    world.change = lambda inputs: replace(inputs, odometry=last)
    world.now_s = 0.19
    assert world.goal_queue.refusal(request, world.inputs, world.now_s) is None
    world.now_s = 0.29
    world.goal_queue.admit("late", request, world.now_s)
    cycles = [world.goal_queue.tick(world.inputs, world.now_s + at_s) for at_s in (0.02, 2.0, 4.0, 6.0)]
    assert {cycle.twist for cycle in cycles} <= {STOP, None}
    (end,) = (end for cycle in cycles for end in cycle.ends)
    assert end.outcome.code is ErrorCode.ODOMETRY_LOST


def test_a_queue_runs_in_order_and_the_base_stands_in_between() -> None:
    world = GoalQueueWorld(robot_with("queue"))
    keys = [world.ask_way(distance_m) for distance_m in (0.3, -0.2, 0.1)]
    world.run_out()
    assert [world.code(key) for key in keys] == [ErrorCode.OK] * 3
    assert world.x_m == pytest.approx(0.2, abs=0.005)
    times = [time for key in keys for time in (world.goals[key].began, world.goals[key].ended)]
    assert times == sorted(times, key=lambda time: time or 0.0)


def test_a_goal_that_waits_reports_once_a_second_that_everything_remains() -> None:
    world = GoalQueueWorld(robot_with("queue"))
    first = world.ask_way(2.0, 0.2)  # some 10 s
    second = world.ask_way(-0.5)
    third = world.ask(RotateRequest(math.pi, 0.5))
    world.run(9.0)
    assert third is not None
    for key, remains_m in ((second, 0.5), (third, math.pi * lever_m(world.robot))):
        times = [at_s for at_s, _feedback in world.feedback[key]]
        assert times[0] < 0.1
        assert max(after - before for before, after in itertools.pairwise([*times, 9.0])) < 1.05
        assert {feedback.traveled_m for _at_s, feedback in world.feedback[key]} == {0.0}
        assert [feedback.remaining_m for _at_s, feedback in world.feedback[key]] == pytest.approx(
            [remains_m] * len(times)
        )
    assert len(world.feedback[second]) == 9
    world.run_out()
    assert world.feedback[second][-1][1].traveled_m == pytest.approx(-0.5, abs=0.005)
    assert [world.code(key) for key in (first, second, third)] == [ErrorCode.OK] * 3


def test_a_queue_has_its_length() -> None:
    world = GoalQueueWorld(robot_with("queue", queue_length=2))
    world.ask_way(0.3)
    world.run(0.1)  # it runs now: the queue is empty
    world.ask_way(0.1)
    world.ask_way(0.1)
    assert world.ask(DriveRequest(0.1, 0.2)) is None
    assert "2 goals wait already" in world.refusals[0]


def test_a_goal_that_waits_is_canceled_at_once_and_the_others_go_on() -> None:
    world = GoalQueueWorld(robot_with("queue"))
    first, second, third = (world.ask_way(0.3) for _ in range(3))
    world.run(0.5)
    world.cancel(second)
    world.run(0.02)
    assert world.code(second) is ErrorCode.CANCELED
    assert "never started" in world.goals[second].ends[0].message
    world.run_out()
    assert [world.code(first), world.code(third)] == [ErrorCode.OK, ErrorCode.OK]
    assert world.goals[second].began is None


def test_after_a_cancel_of_the_running_goal_the_next_one_begins_when_the_base_stands() -> None:
    world = GoalQueueWorld(robot_with("queue"))
    first, second = world.ask_way(2.0), world.ask_way(0.1)
    world.run(1.0)
    world.cancel(first)
    world.run_out()
    assert [world.code(first), world.code(second)] == [ErrorCode.CANCELED, ErrorCode.OK]


def test_after_an_emergency_stop_nothing_of_the_queue_starts_by_itself() -> None:
    world = GoalQueueWorld(robot_with("queue"))
    keys = [world.ask_way(1.0) for _ in range(3)]
    world.run(1.0)
    world.change = estop
    world.run_out()
    assert [world.code(key) for key in keys] == [ErrorCode.ESTOP] * 3
    assert "the goal before it ended with ESTOP" in world.goals[keys[1]].ends[0].message
    world.change = lambda inputs: inputs
    assert world.ask(DriveRequest(0.1, 0.2)) is not None


def test_preempt_stops_the_old_goal_before_the_new_one_owns_the_base() -> None:
    world = GoalQueueWorld(robot_with("preempt"))
    old = world.ask_way(2.0)
    world.run(1.0)
    new = world.ask_way(-0.2)
    world.run(0.02)
    assert world.goals[old].ends == []  # it brakes
    world.run_out()
    assert [world.code(old), world.code(new)] == [ErrorCode.PREEMPTED, ErrorCode.OK]
    assert world.goals[old].ends[0].status.name == "ABORTED"
    assert world.goals[old].ended - 1.0 > 0.4 / world.robot.limits.deceleration_mps2
    assert (world.goals[new].began or 0.0) >= world.goals[old].ended


def test_of_several_newer_goals_the_newest_gets_the_base() -> None:
    world = GoalQueueWorld(robot_with("preempt"))
    keys = [world.ask_way(2.0)]
    world.run(1.0)
    keys += [world.ask_way(0.1), world.ask_way(0.2), world.ask_way(0.3)]
    world.run(0.02)
    assert [len(world.goals[key].ends) for key in keys] == [0, 1, 1, 0]
    world.run_out()
    assert [world.code(key) for key in keys] == [ErrorCode.PREEMPTED] * 3 + [ErrorCode.OK]


def test_a_new_goal_that_is_wrong_preempts_nobody() -> None:
    world = GoalQueueWorld(robot_with("preempt"))
    old = world.ask_way(0.3)
    world.run(0.5)
    assert world.ask(DriveRequest(100.0, 0.2)) is None
    world.run_out()
    assert world.code(old) is ErrorCode.OK


def test_a_goal_that_has_arrived_is_not_preempted_any_more() -> None:
    world = GoalQueueWorld(robot_with("preempt"))
    old = world.ask_way(0.3)
    world.run(20.0, lambda: world.goal_queue.phase.value == "stopping")
    new = world.ask_way(0.1)
    world.run_out()
    assert [world.code(old), world.code(new)] == [ErrorCode.OK, ErrorCode.OK]


def test_a_cancel_of_a_goal_that_is_preempted_is_still_a_cancel() -> None:
    world = GoalQueueWorld(robot_with("preempt"))
    old = world.ask_way(2.0)
    world.run(1.0)
    new = world.ask_way(0.1)
    world.run(0.1)
    world.cancel(old)
    world.run_out()
    assert [world.code(old), world.code(new)] == [ErrorCode.CANCELED, ErrorCode.OK]


def test_the_new_goal_does_not_get_a_base_whose_stop_went_wrong() -> None:
    world = GoalQueueWorld(robot_with("preempt"))
    old = world.ask_way(2.0)
    world.run(1.0)
    new = world.ask_way(-0.2)
    world.run(0.1)
    world.change = estop
    world.run_out()
    assert [world.code(old), world.code(new)] == [ErrorCode.ESTOP, ErrorCode.ESTOP]
    assert world.goals[new].began is None


def test_a_shutdown_ends_all() -> None:
    world = GoalQueueWorld(robot_with("queue"))
    keys = [world.ask_way(1.0) for _ in range(3)]
    world.run(1.0)
    world.change = lambda inputs: replace(inputs, shutdown=True)
    world.run_out()
    assert {world.code(key) for key in keys} == {ErrorCode.SHUTDOWN}


def test_a_defect_ends_all_as_internal() -> None:
    world = GoalQueueWorld(robot_with("queue"))
    keys = [world.ask_way(1.0) for _ in range(3)]
    world.run(1.0)
    world.goal_queue.fail(ZeroDivisionError("a defect"), world.now_s)
    world.run_out()
    assert {world.code(key) for key in keys} == {ErrorCode.INTERNAL}


def test_a_process_out_of_time_ends_all_at_once() -> None:
    world = GoalQueueWorld(robot_with("queue"))
    keys = [world.ask_way(1.0) for _ in range(3)]
    world.run(1.0)
    cycle = world.goal_queue.give_up(ErrorCode.SHUTDOWN, "no time", world.now_s)
    assert [end.key for end in cycle.ends] == keys
    assert {end.outcome.code for end in cycle.ends} == {ErrorCode.SHUTDOWN}
    assert cycle.twist == STOP
    assert not world.goal_queue.busy


def test_a_cancel_of_an_unknown_goal_changes_nothing() -> None:
    world = GoalQueueWorld(robot_with("queue"))
    assert not world.goal_queue.cancel("who?")


def storm(policy: Policy, seed: int) -> GoalQueueWorld:
    """1500 goals are sent, some of them are canceled, and sometimes the emergency stop is pressed."""
    chance = random.Random(seed)
    world = GoalQueueWorld(robot_with(policy, queue_length=3))
    for _ in range(1500):
        way_m = chance.choice((-1, 1)) * chance.uniform(0.01, 0.15)
        world.ask(DriveRequest(way_m, chance.uniform(0.1, 0.5)))
        living = [key for key, told in world.goals.items() if not told.ends]
        if living and chance.random() < 0.3:
            world.cancel(chance.choice(living))
        pressed = chance.random() < 0.03
        world.change = estop if pressed else lambda inputs: inputs
        world.run(chance.choice((0.0, 0.02, 0.1, 0.5, 1.5)))
    world.change = lambda inputs: inputs
    world.run_out()
    return world


def right(told: Told, policy: Policy) -> bool:
    """This goal may have ended as it did."""
    (end,) = told.ends
    assert isinstance(told.request, DriveRequest)
    arrived = told.began is not None and abs(end.traveled_m - told.request.distance_m) <= 0.005
    allowed = {
        ErrorCode.OK: arrived,
        ErrorCode.CANCELED: told.canceled,
        ErrorCode.PREEMPTED: policy == "preempt",
        ErrorCode.ESTOP: True,
    }
    return allowed.get(end.code, False)


@pytest.mark.parametrize("policy", ["reject", "queue", "preempt"])
@pytest.mark.parametrize("seed", range(2))
def test_in_a_storm_of_goals_and_cancels_each_goal_ends_once_and_rightly(policy: Policy, seed: int) -> None:
    world = storm(policy, seed)
    assert [told for told in world.goals.values() if not right(told, policy)] == []
    began = [told.began for told in world.goals.values() if told.began is not None]
    assert began == sorted(began)
    seen = {world.code(key) for key in world.goals}
    assert seen >= {ErrorCode.OK, ErrorCode.CANCELED, ErrorCode.ESTOP}
    assert (ErrorCode.PREEMPTED in seen) == (policy == "preempt")
