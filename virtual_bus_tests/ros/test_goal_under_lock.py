"""Goals and the locks of the mux on a whole robot: none starts under a lock, and nothing moves when the lock opens."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from std_msgs.msg import Bool

from canbase_action_server.client import RejectedError
from canbase_action_server.outcome import ErrorCode
from support.ros_harness import Repeater, merged
from support.running_robot import PATIENT, RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

LOCKED = merged(PATIENT, {"mux": {"locks": {"pause": {"topic": "pause", "priority": 45, "required": False}}}})
"""Above the goals, below navigation and joystick."""


class Paused:
    """A robot and the button that locks it."""

    def __init__(self, robot: RunningRobot) -> None:
        self.robot = robot
        self.button: Repeater[Bool] = robot.node.repeat(Bool, "pause", 10.0)
        robot.node.wait_for_subscriber(self.button.publisher)

    def hold(self, locked: bool) -> None:
        self.button.message = Bool(data=locked)
        self.robot.node.spin_for(0.5)


@pytest.fixture(scope="module")
def paused() -> Iterator[Paused]:
    with own_domain() as domain, robot_on(domain, changes=LOCKED) as robot:
        yield Paused(robot)


def test_a_goal_under_a_lock_is_rejected(paused: Paused) -> None:
    paused.hold(True)
    with pytest.raises(RejectedError, match="velocity_mux holds action back: locked: pause holds"):
        paused.robot.client.send(0.5, 0.3)
    drive = paused.robot.command("drive", "0.5")
    assert paused.robot.exit_code(drive) == 5
    assert "velocity_mux holds action back: locked: pause holds; unlock it first" in drive.log()
    paused.hold(False)
    assert paused.robot.driven(0.05)


def test_a_goal_whose_lock_closes_ends_blocked_and_nothing_moves_when_it_opens(paused: Paused) -> None:
    paused.hold(False)
    goal = paused.robot.goal(2.0, 0.3)
    paused.robot.wait_speed(0.25)
    paused.hold(True)
    result = goal.wait(5.0)
    assert result is not None
    assert result.code is ErrorCode.BLOCKED
    assert "locked: pause holds" in result.message
    paused.robot.wait_standing()
    opened_s = time.monotonic()
    paused.hold(False)
    assert paused.robot.moved_since(opened_s, 3.0) < RESTS_M
