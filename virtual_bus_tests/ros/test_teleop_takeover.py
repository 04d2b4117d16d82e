"""Somebody takes the joystick while a goal drives: the goal ends at once, and letting go brings nothing back."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from canbase.msg import MuxState
from geometry_msgs.msg import TwistStamped

from canbase_action_server.outcome import ErrorCode, Status
from support.running_robot import LATCHED, RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]
AT_ONCE_S = 0.3
"""Of a loaded computer; what it really takes is printed."""


@pytest.fixture(scope="module")
def robot() -> Iterator[RunningRobot]:
    with own_domain() as domain, robot_on(domain) as running:
        yield running


def test_the_joystick_ends_the_goal_at_once_and_its_release_leaves_the_base_standing(robot: RunningRobot) -> None:
    states = robot.node.record(MuxState, "velocity_mux/state", LATCHED)
    joystick = robot.node.source()
    goal = robot.goal(3.0, 0.4)
    robot.wait_speed(0.35)

    taken_s = time.monotonic()
    back = TwistStamped()
    back.twist.linear.x = -0.1
    joystick.message = back
    robot.node.wait_for(lambda: goal.result is not None, 5.0, "the end of the goal")
    ended_s = time.monotonic()

    assert goal.result is not None
    assert (goal.result.status, goal.result.code) == (Status.ABORTED, ErrorCode.TAKEN_OVER)
    assert "joystick" in goal.result.message
    print(f"goal ended {1e3 * (ended_s - taken_s):.0f} ms after the joystick began to be asked at 50 Hz")
    assert ended_s - taken_s < AT_ONCE_S
    assert states.messages[-1].active == "joystick"
    robot.node.wait_for(lambda: robot.truth().linear_mps < -0.08, 10.0, "the base follows the joystick")

    joystick.message = None  # let go without a last zero, as when its radio dies
    robot.wait_standing()
    assert robot.moved_since(time.monotonic(), 1.0) < RESTS_M  # neither the joystick's command nor the goal comes back
    assert states.messages[-1].active == ""
    assert robot.driven(0.05)  # a new goal drives
