"""Each error code of drive_distance where its cause begins, with all real cores in virtual time: drive, bus, scanner,
button, operator. A code comes after the stop, and the base stays at rest.

t  0  goal of 1 m at 0.3 m/s ── 1.5  the cause ── the base stands ── the code ── 1 s at rest
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import pytest

from canbase_action_server.outcome import ErrorCode, Status
from canbase_campaign.action_process import Goal
from canbase_campaign.faults import FAULTS
from canbase_campaign.outside import Surroundings
from canbase_campaign.robots import campaign_robot
from canbase_campaign.world import World
from canbase_velocity.speed_limit import SpeedLimit

GOAL_M, SPEED_MPS = 1.0, 0.3
RESTS_M = 0.0005
END_S = 8.0
LAST_M = 0.05
"""So far before its goal a base loses the force to brake: friction alone takes longer."""


class Story:
    """A robot that drives to a goal. `changes`: keys of its sections."""

    def __init__(self, changes: Mapping[str, Mapping[str, Any]] | None = None) -> None:
        robot = campaign_robot()
        sections = {name: getattr(robot, name).model_copy(update=keys) for name, keys in (changes or {}).items()}
        self.world = World(robot.model_copy(update=sections))
        self.around = Surroundings(self.world)
        self.base = self.world.drives.bench.base
        self.speeds_at_end: list[float] = []
        self.world.on_goal_end = lambda goal: self.speeds_at_end.append(self._fastest_mps())
        self.world.enable()
        self.world.action.send_goal(GOAL_M, SPEED_MPS)
        self.run(1.5)
        assert self.base.v_mps > 0.9 * SPEED_MPS

    def _fastest_mps(self) -> float:
        return max(abs(self.base.v_left_mps), abs(self.base.v_right_mps))

    def run(self, seconds: float) -> None:
        self.world.clock.run_until(self.world.clock.now_s + seconds)

    def suffer(self, name: str, **given: Any) -> None:
        """A fault of the campaign, which does not end."""
        FAULTS[name].begin(self.world, self.around, given)

    def end_of(self, number: int = 0) -> tuple[Status, ErrorCode]:
        """Of that goal; no wheel turned when its result came, and none turns after the last one."""
        goal: Goal = self.world.action.goals[number]
        end_s = self.world.clock.now_s + END_S
        while not goal.ends and self.world.clock.now_s < end_s:
            self.run(0.01)
        (end,) = goal.ends
        assert self.speeds_at_end[number] <= self.world.robot.base.standstill_mps
        if number == len(self.world.action.goals) - 1:
            before_m = self.base.path_m
            self.run(1.0)
            assert self.base.path_m - before_m < RESTS_M
        return end.code.status, end.code


def _slower(story: Story) -> None:
    """So slow that the goal would take four times as long."""
    story.world.velocity.filter.on_speed_limit(SpeedLimit(SPEED_MPS / 4.0, 1.0), "a test")


CAUSES: Mapping[ErrorCode, Callable[[Story], None]] = {
    ErrorCode.BLOCKED: lambda story: story.around.put_wall(0.05),
    ErrorCode.ODOMETRY_LOST: lambda story: story.suffer("odometry_lost"),
    ErrorCode.ESTOP: lambda story: story.around.press(True),
    ErrorCode.TIMEOUT: _slower,
    ErrorCode.DRIVE_FAULT: lambda story: story.suffer("drive_fault", wheel=0),
    ErrorCode.WATCHDOG: lambda story: story.suffer("frozen_encoder", wheel=0),
    ErrorCode.SCAN_LOST: lambda story: story.suffer("scan_stale", share=1.0),
    ErrorCode.SHUTDOWN: lambda story: story.world.action.end(),
}


@pytest.mark.parametrize("code", CAUSES, ids=lambda code: code.name)
def test_what_goes_wrong_aborts_the_goal_with_its_own_code_after_the_stop(code: ErrorCode) -> None:
    story = Story()
    CAUSES[code](story)
    assert story.end_of() == (Status.ABORTED, code)


def test_a_stop_of_the_driver_on_request_is_a_drive_fault() -> None:
    story = Story()
    story.world.driver.stop()
    assert story.end_of() == (Status.ABORTED, ErrorCode.DRIVE_FAULT)


def test_ok() -> None:
    assert Story().end_of() == (Status.SUCCEEDED, ErrorCode.OK)


def test_canceled() -> None:
    story = Story()
    story.world.action.cancel()
    assert story.end_of() == (Status.CANCELED, ErrorCode.CANCELED)


def test_overshoot_of_a_base_that_cannot_brake() -> None:
    story = Story({
        "action": {"tolerance_m": 0.002},
        "watchdog": {"motion_tolerance_mps": 0.2},  # it would stop the base before that overshoots
    })  # fmt: skip
    while story.base.travel_m < GOAL_M - LAST_M:
        story.run(0.01)
    for wheel in (0, 1):
        story.suffer("motor_weak", wheel=wheel, share=0.0)
    assert story.end_of() == (Status.ABORTED, ErrorCode.OVERSHOOT)


def test_preempted_by_a_newer_goal_that_begins_after_the_stop() -> None:
    story = Story({"action": {"goal_policy": "preempt"}})
    story.world.action.send_goal(-0.1, 0.2)
    assert story.end_of(0) == (Status.ABORTED, ErrorCode.PREEMPTED)
    assert story.end_of(1) == (Status.SUCCEEDED, ErrorCode.OK)


def test_no_code_is_without_its_story() -> None:
    here = {ErrorCode.OK, ErrorCode.CANCELED, ErrorCode.OVERSHOOT, ErrorCode.PREEMPTED}
    elsewhere = {
        ErrorCode.TAKEN_OVER,  # test_goal_without_states.py
        ErrorCode.NO_PROGRESS,  # unit/action_server/test_goal.py; here the watchdog stops a wheel that does not follow
        ErrorCode.CLIENT_LOST,  # unit/action_server/test_client_lease.py, ros/test_client_lease.py
        ErrorCode.INVALID_GOAL,  # unit/action_server/test_nav2_goals.py
        ErrorCode.INTERNAL,  # unit/action_server/test_active_goal.py, ros/test_action_server.py
    }
    assert set(CAUSES) | here | elsewhere == set(ErrorCode)
