"""The topics that a goal depends on: their timeouts against their periods, and each one lost in each phase."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import product

import pytest
from canbase.msg import ForeignPublisher, MuxState

from canbase_action_server.goal_queue import GoalQueue
from canbase_action_server.goal_request import DriveRequest, Request, RotateRequest
from canbase_action_server.inputs import Inputs, Mux
from canbase_action_server.messages import contested_in
from canbase_action_server.motion import STOP
from canbase_action_server.nav2_request import Target, back_up, drive_on_heading, spin
from canbase_action_server.outcome import ErrorCode
from canbase_action_server.state_topics import DRIVER, MUX, ODOMETRY, SAFETY, STATE_TOPICS, States, without_contested
from canbase_config.state_age import JITTER_S, STATE_PERIOD_S, state_timeout_s
from canbase_runtime.chain_topics import CHAIN, Use
from canbase_runtime.received import NEVER, Received
from support.action_plant import Plant, Story, bench_robot, drive, good_inputs, replaced
from support.goal_queue_world import GoalQueueWorld, robot_with

ROBOT = bench_robot()
FIELDS = {"odometry": ODOMETRY, "driver": DRIVER, "safety": SAFETY, "mux": MUX}


def with_age(inputs: Inputs, name: str, age_s: float, now_s: float) -> Inputs:
    return replace(inputs, **{name: replace(getattr(inputs, name), received_at_s=now_s - age_s)})


def test_every_state_is_a_topic() -> None:
    assert tuple(FIELDS.values()) == STATE_TOPICS
    assert [topic.topic for topic in STATE_TOPICS] == [
        "odom", "motor_driver/status", "safety_filter/state", "velocity_mux/state",
    ]  # fmt: skip
    assert [topic.row for topic in STATE_TOPICS] == [row for row in CHAIN if row.use is Use.STATE]


def test_a_state_may_miss_one_message_and_be_late_and_not_miss_two_in_time() -> None:
    assert pytest.approx(state_timeout_s()) == 2.0 * STATE_PERIOD_S + JITTER_S
    assert 2.0 * STATE_PERIOD_S < state_timeout_s() <= 3.0 * STATE_PERIOD_S + 1e-9
    assert MUX.timeout_s(ROBOT) == SAFETY.timeout_s(ROBOT) == pytest.approx(0.3)


@pytest.mark.parametrize(("status_hz", "timeout_s"), [(50.0, 0.14), (10.0, 0.3), (5.0, 0.5), (1.0, 2.1)])
def test_the_status_of_the_driver_has_the_timeout_of_its_own_period(status_hz: float, timeout_s: float) -> None:
    robot = ROBOT.model_copy(update={"rates": ROBOT.rates.model_copy(update={"status_hz": status_hz})})
    assert DRIVER.timeout_s(robot) == pytest.approx(timeout_s)


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("over_s", [-1e-3, -1e-9, 1e-9, 1e-3, 1.0])
def test_a_state_counts_until_its_timeout_and_not_longer(name: str, over_s: float) -> None:
    age_s = FIELDS[name].timeout_s(ROBOT) + over_s
    inputs = with_age(good_inputs(Plant().odometry(10.0)), name, age_s, 10.0)
    assert (getattr(States.at(ROBOT, inputs, 10.0), name) is None) is (over_s > 0.0)
    silence = FIELDS[name].silence(ROBOT, inputs, 10.0)
    assert (silence is not None) is (over_s > 0.0)
    if silence is not None:
        assert f"no message on {FIELDS[name].topic} for {age_s:.2f} s (timeout" in silence
        assert f"is {FIELDS[name].row.node} running?" in silence


def test_what_was_never_received_is_named_so() -> None:
    assert SAFETY.silence(ROBOT, Inputs(), 10.0) == (
        "nothing received on safety_filter/state yet; is safety_filter running?"
    )


def lose(world: GoalQueueWorld, name: str) -> float:
    """Its last message is from now; the moment at which it counts no more [s]."""
    last = getattr(world.inputs, name)
    world.change = lambda inputs: replace(inputs, **{name: last})
    return world.now_s + FIELDS[name].timeout_s(ROBOT)


PHASES = {"speeding up": 0.1, "cruising": 2.0, "braking before the goal": 2.75, "at the goal": 3.2}
"""When the state is lost, of a goal of 1 m at 0.4 m/s that takes 3.3 s."""


@pytest.mark.parametrize(("name", "phase"), list(product(FIELDS, PHASES)))
def test_a_goal_ends_wherever_a_state_is_lost_or_had_ended_before(name: str, phase: str) -> None:
    world = GoalQueueWorld(robot_with("queue"))
    key, second = world.ask_way(1.0), world.ask_way(-1.0)
    world.run(PHASES[phase])
    assert world.goals[key].ends == []
    lost_s = lose(world, name)
    world.run(10.0, lambda: not world.goal_queue.busy)
    (end,) = world.goals[key].ends
    if end.code is ErrorCode.OK:
        assert world.goals[key].ended <= lost_s + 0.02, "a goal was reached that could not be known to be"
    else:
        assert end.code is FIELDS[name].code
    assert world.code(second) is FIELDS[name].code
    stood_m = world.x_m
    world.run(3.0)
    assert world.x_m == stood_m
    assert world.now_s < lost_s + 4.0 + 3.0


@pytest.mark.parametrize("name", FIELDS)
def test_a_state_that_is_lost_during_a_cancel_is_the_cause(name: str) -> None:
    world = GoalQueueWorld(robot_with("queue"))
    key = world.ask_way(3.0)
    world.run(1.5)
    lose(world, name)
    world.run(0.12)
    world.cancel(key)
    world.run(10.0, lambda: not world.goal_queue.busy)
    assert world.code(key) is FIELDS[name].code


@pytest.mark.parametrize("name", FIELDS)
def test_a_goal_that_waits_for_its_client_never_starts_when_a_state_is_lost(name: str) -> None:
    robot = robot_with("reject")
    robot = robot.model_copy(update={"action": robot.action.model_copy(update={"require_client_lease": True})})
    queue, now_s = GoalQueue(robot), 10.0
    inputs = good_inputs(Plant().odometry(now_s))
    assert queue.refusal(DriveRequest(1.0, 0.3), inputs, now_s) is None
    queue.admit("key", DriveRequest(1.0, 0.3), now_s)
    now_s += FIELDS[name].timeout_s(robot) + 0.01
    fresh = replace(good_inputs(Plant().odometry(now_s)), **{name: getattr(inputs, name)})
    queue.keepalive("key", now_s)
    cycle = queue.tick(fresh, now_s)
    (end,) = cycle.ends
    assert (end.outcome.code, cycle.began, cycle.twist) == (FIELDS[name].code, None, None)
    assert "it never started" in end.outcome.message


def test_a_takeover_that_shows_while_the_goal_stops_for_a_lost_state_hands_the_base_over() -> None:
    def taken(story: Story) -> None:
        story.silent.discard("mux")
        story.inputs = replaced(story.inputs, story.now_s, mux=Mux("joystick"))

    story = drive(Plant(), 3.0, 0.3, at={2.0: lambda s: s.silent.add("mux"), 2.4: taken})
    end = story.run()
    assert end.code is ErrorCode.TAKEN_OVER
    assert "joystick has taken over" in end.message
    assert "belongs to another source now" in end.message


def test_a_state_that_returns_does_not_revive_the_goal() -> None:
    at: dict[float, Callable[[Story], None]] = {
        2.0: lambda s: s.silent.add("mux"),
        2.4: lambda s: s.silent.discard("mux"),
    }
    story = drive(Plant(), 3.0, 0.3, at=at)
    end = story.run()
    assert end.code is ErrorCode.TAKEN_OVER
    assert end.stands
    assert all(twist == STOP for at_s, twist in story.orders if at_s > 2.33)
    assert math.isclose(story.ended_at, 2.8, abs_tol=0.1)


@pytest.mark.parametrize("name", ["driver", "safety", "mux"])
@pytest.mark.parametrize(
    "request_",
    [
        RotateRequest(6.0, 1.0),
        spin(ROBOT, 6.0, 30.0),
        back_up(ROBOT, Target(2.0), 0.3, 30.0),
        drive_on_heading(ROBOT, Target(2.0), 0.3, 30.0),
    ],
)
def test_every_action_depends_on_the_same_states(request_: Request, name: str) -> None:
    story = Story(Plant(), request_, at={2.0: lambda s: s.silent.add(name)})
    end = story.run()
    assert end.code is FIELDS[name].code
    assert all(twist == STOP for at_s, twist in story.orders if at_s > 2.33)
    assert end.stands


BAG = "/rosbag2_player publishes on /{}: only /{} should; no goal runs meanwhile"


def contest(world: GoalQueueWorld, name: str, reported_s: float) -> None:
    """velocity_mux reports a second publisher of this state at that time."""
    row = FIELDS[name].row
    report: Received[Mapping[str, str]] = Received({row.topic: BAG.format(row.topic, row.node)}, reported_s)
    world.change = lambda inputs: replace(inputs, contested=report)


@pytest.mark.parametrize(("name", "phase"), list(product(FIELDS, PHASES)))
def test_a_second_publisher_of_a_state_ends_the_goal_at_once_and_none_starts(name: str, phase: str) -> None:
    world = GoalQueueWorld(robot_with("queue"))
    key, second = world.ask_way(1.0), world.ask_way(-1.0)
    world.run(PHASES[phase])
    assert world.goals[key].ends == []
    contest(world, name, math.inf)  # again and again, as long as it is there
    world.run(10.0, lambda: not world.goal_queue.busy)
    (end,) = world.goals[key].ends
    assert end.code in (FIELDS[name].code, ErrorCode.OK)
    assert (end.code is ErrorCode.OK) <= (phase == "at the goal")
    if end.code is not ErrorCode.OK:
        assert BAG.format(FIELDS[name].topic, FIELDS[name].row.node) in end.message
    assert world.code(second) is FIELDS[name].code
    stood_m = world.x_m
    reason = world.goal_queue.refusal(DriveRequest(1.0, 0.3), world.inputs, world.now_s)
    assert reason is not None
    assert BAG.format(FIELDS[name].topic, FIELDS[name].row.node) in reason
    world.run(3.0)
    assert world.x_m == stood_m


def test_a_state_of_two_publishers_does_not_confirm_standstill() -> None:
    inputs = good_inputs(Plant().odometry(10.0))
    both: Mapping[str, str] = {ODOMETRY.topic: "x", DRIVER.topic: "y"}
    known = without_contested(replace(inputs, contested=Received(both, 10.0)), 10.0)
    assert (known.odometry, known.driver) == (NEVER, NEVER)
    assert (known.safety, known.mux) == (inputs.safety, inputs.mux)


@pytest.mark.parametrize(("age_s", "counts"), [(0.0, True), (0.3 - 1e-9, True), (0.3 + 1e-9, False)])
def test_a_report_of_a_second_publisher_counts_as_long_as_a_state_of_the_mux(age_s: float, counts: bool) -> None:
    inputs = replace(good_inputs(Plant().odometry(10.0)), contested=Received({MUX.topic: "x"}, 10.0 - age_s))
    assert (without_contested(inputs, 10.0).mux is NEVER) is counts


def test_publishers_of_other_topics_and_of_other_types_contest_nothing() -> None:
    kinds = {row.topic: row.type for row in CHAIN}
    rows = [
        ForeignPublisher(topic="/r1/odom", node="/bag", type=kinds["odom"], problem="only /r1/motor_driver should"),
        ForeignPublisher(topic="/odom", node="/bag", type=kinds["odom"], problem="only /motor_driver should"),
        ForeignPublisher(topic="/r1/motor_driver/status", node="/bag", type="std_msgs/msg/Bool", problem="of type"),
        ForeignPublisher(topic="/r1/cmd_vel", node="/bag", type=kinds["cmd_vel"], problem="only"),
    ]
    states = {f"/r1/{row.topic}": row for row in CHAIN if row.use is Use.STATE}
    assert contested_in(MuxState(foreign=rows), states) == {
        "odom": "/bag publishes on /r1/odom: only /r1/motor_driver should"
    }
