"""Goals of Nav2's behaviours in the queue: each alone as a story, and a thousand of them among those of canbase."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import replace

import pytest

from canbase_action_server.along_track import displacement
from canbase_action_server.goal_request import DriveRequest, Request, RotateRequest
from canbase_action_server.inputs import Inputs
from canbase_action_server.nav2_request import RELEASE_S, BehaviorRequest, Target, back_up, drive_on_heading, spin
from canbase_action_server.outcome import ErrorCode
from canbase_runtime.stop_cause import StopCause
from support.action_plant import GOOD_MUX, GOOD_SAFETY, bench_robot, replaced
from support.goal_queue_world import GoalQueueWorld, Policy, Told, robot_with

ROBOT = bench_robot()
HALF_TRACK_M = ROBOT.base.track_m / 2.0


def commanded_by(name: str) -> GoalQueueWorld:
    """A world in which this source of the mux has the base."""
    world = GoalQueueWorld(robot_with("reject"))
    world.change = lambda inputs: replaced(inputs, world.now_s, mux=replace(GOOD_MUX, active=name))
    return world


def release(world: GoalQueueWorld) -> None:
    world.change = lambda inputs: inputs


def sent(world: GoalQueueWorld, request: Request) -> str:
    """The key of a goal that must be accepted."""
    key = world.ask(request)
    assert key is not None, world.refusals
    return key


def way(world: GoalQueueWorld, goal: Told) -> float:
    """What it truly drove so far [m], or turned [m at the rims of the wheels]."""
    start, turned_rad = goal.began_at
    if isinstance(motion_of(goal.request), RotateRequest):
        return (world.turned_rad - turned_rad) * HALF_TRACK_M
    return displacement(start, world.pose).along_m


def motion_of(request: Request) -> DriveRequest | RotateRequest:
    inner = request.motion_request if isinstance(request, BehaviorRequest) else request
    assert isinstance(inner, DriveRequest | RotateRequest)
    return inner


def asked_m(request: Request) -> float:
    inner = motion_of(request)
    return inner.distance_m if isinstance(inner, DriveRequest) else inner.angle_rad * HALF_TRACK_M


@pytest.mark.parametrize(
    "request_",
    [
        drive_on_heading(ROBOT, Target(0.4), 0.2, 10.0),
        drive_on_heading(ROBOT, Target(-0.4), -0.2, 10.0),
        back_up(ROBOT, Target(0.3), 0.15, 10.0),
        spin(ROBOT, 1.57, 10.0),
        spin(ROBOT, -7.0, 20.0),
    ],
)
def test_a_goal_ends_at_its_distance_or_angle_and_has_its_time(request_: BehaviorRequest) -> None:
    world = GoalQueueWorld(robot_with("reject"))
    key = sent(world, request_)
    world.run_out()
    (end,) = world.goals[key].ends
    assert end.code is ErrorCode.OK
    assert way(world, world.goals[key]) == pytest.approx(asked_m(request_), abs=ROBOT.action.tolerance_m)
    assert end.duration_s == pytest.approx(world.now_s - (world.goals[key].began or 0.0))


def test_the_time_allowance_ends_a_goal_with_a_stop() -> None:
    world = GoalQueueWorld(robot_with("reject"))
    key = sent(world, back_up(ROBOT, Target(2.0), 0.2, 1.5))
    world.run(1.5)
    assert world.goals[key].ends == []
    world.run_out(2.0)
    (end,) = world.goals[key].ends
    assert end.code is ErrorCode.TIMEOUT
    assert "1.5 s" in end.message
    assert abs(world.mps) <= ROBOT.base.standstill_mps


def test_a_generous_time_allowance_does_not_replace_the_limit_of_robot_yaml() -> None:
    world = GoalQueueWorld(robot_with("reject"))
    key = sent(world, spin(ROBOT, 4.0, 3600.0))

    def creeps() -> bool:
        world.radps = min(world.radps, 0.05)
        return not world.goal_queue.busy

    world.run(60.0, until=creeps)
    assert world.code(key) is ErrorCode.TIMEOUT


def test_an_invalid_goal_is_accepted_and_ends_at_once_and_nothing_moves() -> None:
    world = GoalQueueWorld(robot_with("reject"))
    key = sent(world, drive_on_heading(ROBOT, Target(0.5), -0.2, 10.0))
    world.run_out(0.1)
    (end,) = world.goals[key].ends
    assert end.code is ErrorCode.INVALID_GOAL
    assert "same sign" in end.message
    assert "never started" in end.message
    assert world.goals[key].began is None
    assert world.x_m == 0.0


@pytest.mark.parametrize("policy", ["reject", "queue", "preempt"])
def test_an_invalid_goal_disturbs_no_other(policy: Policy) -> None:
    world = GoalQueueWorld(robot_with(policy, queue_length=1))
    first = world.ask_way(0.3)
    world.run(0.5)
    invalid = sent(world, spin(ROBOT, math.nan, 10.0))
    world.run(0.02)
    assert world.code(invalid) is ErrorCode.INVALID_GOAL
    world.run_out()
    assert world.code(first) is ErrorCode.OK


def test_all_actions_share_one_base() -> None:
    world = GoalQueueWorld(robot_with("reject"))
    first = sent(world, spin(ROBOT, 1.0, 10.0))
    for other in (spin(ROBOT, 1.0, 10.0), back_up(ROBOT, Target(0.2), 0.1, 10.0), DriveRequest(0.1, 0.2)):
        assert world.ask(other) is None
    world.run_out()
    assert world.code(first) is ErrorCode.OK


def test_a_goal_waits_until_the_controller_of_nav2_has_released_the_base() -> None:
    world = commanded_by("navigation")
    key = sent(world, back_up(ROBOT, Target(0.3), 0.2, 10.0))
    world.run(1.5)
    assert world.goals[key].began is None
    assert world.x_m == 0.0
    release(world)
    world.run_out()
    assert world.code(key) is ErrorCode.OK


def test_a_goal_waits_until_the_base_is_at_standstill() -> None:
    world = GoalQueueWorld(robot_with("reject"))
    world.mps = 0.3  # still braking for the controller
    key = sent(world, back_up(ROBOT, Target(0.3), 0.2, 10.0))
    world.run_out()  # the world checks that it began at standstill
    assert world.code(key) is ErrorCode.OK


def test_a_controller_that_goes_on_keeps_the_base() -> None:
    world = commanded_by("navigation")
    key = sent(world, spin(ROBOT, 1.0, 10.0))
    world.run(RELEASE_S - 0.1)
    assert world.goals[key].ends == []
    world.run_out(1.0)
    assert world.code(key) is ErrorCode.TAKEN_OVER
    assert world.turned_rad == 0.0


def test_a_goal_does_not_wait_for_an_operator_nor_does_one_of_drive_distance_wait_for_a_program() -> None:
    assert commanded_by("joystick").ask(spin(ROBOT, 1.0, 10.0)) is None
    assert commanded_by("navigation").ask(DriveRequest(0.3, 0.2)) is None


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"mux": replace(GOOD_MUX, active="joystick")}, ErrorCode.TAKEN_OVER),
        ({"mux": replace(GOOD_MUX, active="navigation", held_back="pause")}, ErrorCode.TAKEN_OVER),
        ({"safety": replace(GOOD_SAFETY, estop=True)}, ErrorCode.ESTOP),
    ],
)
def test_a_goal_that_waits_for_the_controller_ends_when_something_else_speaks_against_it(
    change: dict[str, object], code: ErrorCode
) -> None:
    world = commanded_by("navigation")
    key = sent(world, spin(ROBOT, 1.0, 10.0))
    world.run(0.5)
    world.change = lambda inputs: replaced(inputs, world.now_s, **change)
    world.run(0.1)
    release(world)
    world.run(1.0)
    assert world.code(key) is code
    assert world.turned_rad == 0.0


def a_request(chance: random.Random) -> Request:
    """Of any action; one in ten is invalid, some have too little time."""
    sign, speed_mps = chance.choice((-1.0, 1.0)), chance.uniform(0.1, 0.7)
    distance_m, angle_rad = sign * chance.uniform(0.02, 0.4), sign * chance.uniform(0.05, 2.0)
    allowance_s = chance.choice((0.0, 0.4, 10.0))
    side_m = 0.1 if chance.random() < 0.1 else 0.0
    return chance.choice(
        (
            DriveRequest(distance_m, min(speed_mps, 0.5)),
            RotateRequest(angle_rad, 1.0),
            drive_on_heading(ROBOT, Target(distance_m, side_m), sign * speed_mps, allowance_s),
            back_up(ROBOT, Target(distance_m, side_m), speed_mps, allowance_s),
            spin(ROBOT, 0.0 if side_m else angle_rad, allowance_s),
        )
    )


class Disturbance:
    """Obstacles, and a controller of Nav2 that has the base now and then."""

    def __init__(self, world: GoalQueueWorld, chance: random.Random) -> None:
        self._world, self._chance = world, chance
        self._obstacle = self._controller = False
        world.change = self._change

    def roll(self) -> None:
        """The next moment."""
        self._obstacle = self._chance.random() < 0.15
        self._controller = self._chance.random() < 0.15

    def _change(self, inputs: Inputs) -> Inputs:
        if self._obstacle:
            stop = replace(GOOD_SAFETY, stops=True, cause=StopCause.OBSTACLE)
            inputs = replaced(inputs, self._world.now_s, safety=stop)
        if self._controller and self._world.goal_queue.running is None:
            inputs = replaced(inputs, self._world.now_s, mux=replace(GOOD_MUX, active="navigation"))
        return inputs


@pytest.mark.parametrize("policy", ["reject", "queue", "preempt"])
@pytest.mark.parametrize("seed", range(4))
def test_of_a_thousand_goals_none_succeeds_without_having_driven(policy: Policy, seed: int) -> None:
    """Twelve stories of some 85 accepted goals each, with repeats, cancels, obstacles and a controller."""
    chance = random.Random(seed)
    world = GoalQueueWorld(robot_with(policy, queue_length=3))
    disturbance = Disturbance(world, chance)
    request, succeeded = a_request(chance), 0
    while len(world.goals) < 85:
        request = request if chance.random() < 0.2 else a_request(chance)
        key = world.ask(request)
        for _ in range(chance.choice((1, 4, 40))):
            disturbance.roll()
            world.run(chance.choice((0.02, 0.3)), until=another_ends(world))
            succeeded += sum(succeeds_rightly(world, goal) for goal in ended(world) if goal.ended == world.now_s)
        if key is not None and chance.random() < 0.25:
            world.cancel(key)
    assert succeeded > 10


def ended(world: GoalQueueWorld) -> list[Told]:
    """Those that have ended."""
    return [goal for goal in world.goals.values() if goal.ends]


def another_ends(world: GoalQueueWorld) -> Callable[[], bool]:
    """True from the end of the next goal on."""
    before = len(ended(world))
    return lambda: len(ended(world)) > before


def succeeds_rightly(world: GoalQueueWorld, goal: Told) -> bool:
    """True for a success. Looked at in the cycle of its end."""
    (end,) = goal.ends
    if end.code is ErrorCode.CANCELED:
        assert goal.canceled
    if end.code is not ErrorCode.OK:
        return False
    assert goal.began is not None
    assert way(world, goal) == pytest.approx(asked_m(goal.request), abs=ROBOT.action.tolerance_m)
    assert max(abs(world.mps), abs(world.radps) * HALF_TRACK_M) <= ROBOT.base.standstill_mps
    return True
