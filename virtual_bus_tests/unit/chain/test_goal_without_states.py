"""A goal whose states get lost, with all real cores in virtual time: it ends, the base stops, and nothing drives on.

t   0  goal of 3 m at 0.3 m/s ── 1.5  a state is lost, and something holds the base ── 3.3  it lets go ── 6.3
"""

from __future__ import annotations

from collections.abc import Callable

import pytest

from canbase_action_server.outcome import ErrorCode
from canbase_campaign.outside import Surroundings
from canbase_campaign.world import World
from canbase_velocity.twist import ZERO

RESTS_M = 0.002
GOAL_M, SPEED_MPS = 3.0, 0.3
HELD_S = 1.8
TIMEOUT_S = 0.3
"""Of the states: two periods of 0.1 s and 0.1 s."""
STOPS_S = 0.6
"""From 0.3 m/s: 0.3 s of braking, settling included."""


class Goal:
    """A robot that drives to a goal."""

    def __init__(self) -> None:
        self.world = World()
        self.around = Surroundings(self.world)
        self.world.enable()
        self.world.action.send_goal(GOAL_M, SPEED_MPS)
        assert self.run(1.5) > 0.2
        (self.goal,) = self.world.action.goals

    def run(self, seconds: float) -> float:
        """Let time pass; how far the base went meanwhile [m]."""
        base = self.world.drives.bench.base
        before_m = base.path_m
        self.world.clock.run_until(self.world.clock.now_s + seconds)
        return base.path_m - before_m

    def lose(self, topic: str) -> None:
        self.world.topics.loss[topic] = 1.0

    def joystick(self, seconds: float) -> None:
        """An operator holds the base at zero with the joystick."""
        for tick in range(round(seconds / 0.05)):
            self.world.clock.after(tick * 0.05, self.world.topics.publish, "cmd_vel_joy", ZERO)

    def lock(self, seconds: float) -> None:
        """A lock closes, and opens again."""
        for tick in range(round(seconds / 0.05)):
            self.world.clock.after(tick * 0.05, self.world.topics.publish, "lock", True)
        self.world.clock.after(seconds, self.world.topics.publish, "lock", False)


HOLDS: dict[str, Callable[[Goal, float], None]] = {"joystick": Goal.joystick, "lock": Goal.lock}


@pytest.mark.parametrize("held", HOLDS)
@pytest.mark.parametrize("lost_first_s", [0.0, 0.2])
def test_a_base_that_was_held_while_the_state_of_the_mux_was_lost_does_not_drive_on(
    held: str, lost_first_s: float
) -> None:
    story = Goal()
    story.lose("velocity_mux/state")
    story.run(lost_first_s)
    HOLDS[held](story, HELD_S)
    assert story.run(HELD_S) < 0.2
    assert story.run(3.0) < RESTS_M, "it drove on when it was released"
    (end,) = story.goal.ends
    assert end.code is ErrorCode.TAKEN_OVER
    assert "no message on velocity_mux/state for 0.3" in end.message
    assert "(timeout 0.3 s)" in end.message
    assert "canbase doctor" in end.message


def test_a_joystick_that_is_seen_ends_the_goal_at_once() -> None:
    story = Goal()
    story.joystick(2.0)
    story.run(0.1)
    assert [end.code for end in story.goal.ends] == [ErrorCode.TAKEN_OVER]
    story.run(2.0)
    assert story.run(3.0) < RESTS_M


LOST = {
    "odom": ErrorCode.ODOMETRY_LOST,
    "motor_driver/status": ErrorCode.DRIVE_FAULT,
    "safety_filter/state": ErrorCode.ESTOP,
    "velocity_mux/state": ErrorCode.TAKEN_OVER,
}


@pytest.mark.parametrize(("topic", "code"), LOST.items())
def test_a_goal_whose_state_is_lost_ends_and_the_base_stops(topic: str, code: ErrorCode) -> None:
    story = Goal()
    story.lose(topic)
    began_s = story.world.clock.now_s
    story.run(TIMEOUT_S + 0.1 + STOPS_S)
    (end,) = story.goal.ends
    assert end.code is code
    assert topic in end.message or "no odometry" in end.message
    assert story.goal.ended_at - began_s < TIMEOUT_S + 0.05 + STOPS_S
    assert story.run(3.0) < RESTS_M


@pytest.mark.parametrize("topic", LOST)
def test_one_lost_message_ends_no_goal(topic: str) -> None:
    """Each state misses one message a second, as on a bad network."""
    story = Goal()
    for second in range(4):
        story.world.clock.after(second + 0.01, story.lose, topic)
        story.world.clock.after(second + 0.11, story.world.topics.loss.pop, topic)
    story.run(4.0)
    assert story.goal.ends == []
