"""With require_client_lease a goal lives as long as its client does; times are those of the lease, 1 s."""

from __future__ import annotations

from canbase_action_server.outcome import ErrorCode
from support.goal_queue_world import GoalQueueWorld, robot_with


def leased_world() -> GoalQueueWorld:
    robot = robot_with("queue")
    action = robot.action.model_copy(update={"require_client_lease": True, "client_lease_s": 1.0})
    return GoalQueueWorld(robot.model_copy(update={"action": action}))


def test_a_goal_runs_to_its_end_while_its_client_lives() -> None:
    world = leased_world()
    key = world.ask_way(1.0)
    world.run(0.1)
    for _ in range(20):
        world.goal_queue.keepalive(key, world.now_s)
        world.run(0.98)
    assert world.code(key) is ErrorCode.OK


def test_the_base_stops_within_the_lease_of_the_last_sign_of_life() -> None:
    # heard at 0.5 ... lost at 1.52 ... brakes for 0.4 s
    world = leased_world()
    key = world.ask_way(5.0, 0.4)
    world.goal_queue.keepalive(key, world.now_s)
    world.run(0.5)
    world.goal_queue.keepalive(key, world.now_s)
    world.run(0.98)
    assert world.goal_queue.phase.value == "driving"
    world.run(0.06)
    assert world.goal_queue.phase.value == "stopping"
    world.run_out()
    assert world.code(key) is ErrorCode.CLIENT_LOST
    assert world.goals[key].ended < 0.5 + 1.0 + 0.4 + 0.4
    assert "keepalive" in world.goals[key].ends[0].message


def test_the_life_of_another_client_does_not_count() -> None:
    world = leased_world()
    first, second = world.ask_way(3.0), world.ask_way(0.1)
    world.goal_queue.keepalive(first, world.now_s)
    world.run(0.6)
    world.goal_queue.keepalive(first, world.now_s)
    world.goal_queue.keepalive("unknown", world.now_s)
    world.run(0.6)
    assert world.code(second) is ErrorCode.CLIENT_LOST
    assert world.goals[first].ends == []


def test_a_goal_whose_client_never_learned_of_its_acceptance_never_starts() -> None:
    world = leased_world()
    key = world.ask_way(1.0)
    world.run(0.98)
    assert world.goals[key].ends == []
    world.run(0.1)
    assert world.code(key) is ErrorCode.CLIENT_LOST
    assert world.goals[key].began is None
    assert world.x_m == 0.0


def test_without_the_lease_a_goal_needs_no_client() -> None:
    world = GoalQueueWorld(robot_with("queue"))
    key = world.ask_way(1.0)
    world.run_out()
    assert world.code(key) is ErrorCode.OK
