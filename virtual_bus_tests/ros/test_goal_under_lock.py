"""Goals on a whole robot: none starts under a lock of the mux, or while a state has a second publisher.

Nothing moves when the lock opens, or when that publisher ends.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
from canbase.msg import DriverStatus, MuxState, SafetyState
from nav_msgs.msg import Odometry
from std_msgs.msg import Bool

from canbase_action_server.client import RejectedError
from canbase_action_server.outcome import ErrorCode
from canbase_config.state_age import STATE_PERIOD_S, state_timeout_s
from canbase_velocity.mux_node import GRAPH_PERIOD_S
from support.ros_harness import Repeater, TestNode, merged
from support.running_robot import PATIENT, RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

LOCKED = merged(PATIENT, {"mux": {"locks": {"pause": {"topic": "pause", "priority": 45, "required": False}}}})
"""Above the goals, below navigation and joystick."""


NOTICED_S = GRAPH_PERIOD_S + STATE_PERIOD_S
"""From a second publisher in the ROS graph to the goal that stops, but for one control cycle."""
ENDS_S = NOTICED_S + 0.3 / 0.8 + 0.6
"""To its end: braking from 0.3 m/s, and standstill that the encoders have shown."""
LOADED_S = 2.0
"""For DDS, which discovers the second publisher, and for a loaded computer."""


class Paused:
    """A robot and the button that locks it."""

    def __init__(self, robot: RunningRobot, domain: int) -> None:
        self.robot, self.domain = robot, domain
        self.button: Repeater[Bool] = robot.node.repeat(Bool, "pause", 10.0)
        robot.node.wait_for_subscriber(self.button.publisher)

    def hold(self, locked: bool) -> None:
        self.button.message = Bool(data=locked)
        self.robot.node.spin_for(0.5)


@pytest.fixture(scope="module")
def paused() -> Iterator[Paused]:
    with own_domain() as domain, robot_on(domain, changes=LOCKED) as robot:
        yield Paused(robot, domain)


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


@pytest.mark.parametrize(
    ("topic", "kind", "code", "node"),
    [
        ("odom", Odometry, ErrorCode.ODOMETRY_LOST, "motor_driver"),
        ("motor_driver/status", DriverStatus, ErrorCode.DRIVE_FAULT, "motor_driver"),
        ("safety_filter/state", SafetyState, ErrorCode.ESTOP, "safety_filter"),
        ("velocity_mux/state", MuxState, ErrorCode.TAKEN_OVER, "velocity_mux"),
    ],
)
def test_a_second_publisher_of_a_state_ends_the_goal_and_none_starts(
    paused: Paused, topic: str, kind: type[Any], code: ErrorCode, node: str
) -> None:
    robot, why = paused.robot, f"/player publishes on /{topic}: only /{node} should"
    goal = robot.goal(4.0, 0.3)
    robot.wait_speed(0.25)
    with TestNode("player", domain_id=paused.domain) as player:
        replayed = player.repeat(kind, topic, 50.0)
        replayed.message = kind() if kind is MuxState else None  # five times as often as the mux: reports no publisher
        added_s = time.monotonic()
        while (result := goal.wait(0.05)) is None and time.monotonic() < added_s + ENDS_S + LOADED_S:
            player.spin_for(0.02)
        assert result is not None
        assert result.code is code
        assert why in result.message
        robot.wait_standing()
        asked_s = time.monotonic()
        while time.monotonic() < asked_s + 2.0 * state_timeout_s():
            player.spin_for(0.02)
            with pytest.raises(RejectedError, match=why):
                robot.client.send(0.5, 0.3)
    ended_s = time.monotonic()
    assert robot.moved_since(ended_s, 1.0) < RESTS_M
    assert robot.driven(0.05)
