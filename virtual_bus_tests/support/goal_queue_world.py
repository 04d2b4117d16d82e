"""A goal queue before a simple base in virtual time; at every cycle it is seen that one goal at most orders motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

from canbase_action_server.along_track import BasePose
from canbase_action_server.goal import Feedback
from canbase_action_server.goal_queue import Cycle, GoalQueue
from canbase_action_server.goal_request import DriveRequest, Request
from canbase_action_server.inputs import Inputs, Odometry
from canbase_action_server.motion import STOP
from canbase_action_server.outcome import ErrorCode, GoalOutcome
from canbase_config.robot import Robot
from support.action_plant import GOOD_DRIVER, bench_robot, good_inputs, replaced, value

PERIOD_S = 0.02
Policy = Literal["reject", "queue", "preempt"]


def robot_with(policy: Policy, queue_length: int = 8) -> Robot:
    """The bench robot with another goal policy."""
    robot = bench_robot()
    action = robot.action.model_copy(update={"goal_policy": policy, "queue_length": queue_length})
    return robot.model_copy(update={"action": action})


@dataclass
class Told:
    """What became of one goal."""

    request: Request
    admitted: float
    canceled: bool = False
    began: float | None = None
    ends: list[GoalOutcome] = field(default_factory=list)
    ended: float = 0.0
    began_at: tuple[BasePose, float] = (BasePose(0.0, 0.0, 0.0), 0.0)
    """Where the base was when it began, and how far it had turned since the beginning of the world."""


class GoalQueueWorld:
    """GoalQueue and base. `change` is laid over the inputs of each cycle."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.goal_queue = GoalQueue(robot)
        self.now_s = 0.0
        self.x_m = self.y_m = self.turned_rad = 0.0
        self.mps = self.radps = 0.0
        self.goals: dict[str, Told] = {}
        self.refusals: list[str] = []
        self.feedback: dict[str, list[tuple[float, Feedback]]] = {}
        """Of each goal, with its time."""
        self.change: Callable[[Inputs], Inputs] = lambda inputs: inputs
        self._owner: str | None = None

    @property
    def inputs(self) -> Inputs:
        """Of this moment."""
        driver = replace(GOOD_DRIVER, standstill=self.mps == self.radps == 0.0)
        healthy = good_inputs(Odometry(self.now_s, self.pose, self.mps, self.radps))
        return self.change(replaced(healthy, self.now_s, driver=driver))

    @property
    def pose(self) -> BasePose:
        """Of the base, truly."""
        return BasePose(self.x_m, self.y_m, math.remainder(self.turned_rad, 2.0 * math.pi))

    def ask(self, request: Request) -> str | None:
        """A client sends a goal: its key, None when it is refused."""
        reason = self.goal_queue.refusal(request, self.inputs, self.now_s)
        if reason is not None:
            self.refusals.append(reason)
            return None
        key = str(len(self.goals))
        self.goal_queue.admit(key, request, self.now_s)
        self.goals[key] = Told(request, self.now_s)
        return key

    def ask_way(self, distance_m: float, speed_mps: float = 0.4) -> str:
        """As `ask`, for a goal that must be accepted."""
        key = self.ask(DriveRequest(distance_m, speed_mps))
        assert key is not None, self.refusals
        return key

    def cancel(self, key: str) -> None:
        """A client cancels."""
        self.goals[key].canceled = self.goal_queue.cancel(key) or self.goals[key].canceled

    def run(self, duration_s: float, until: Callable[[], bool] = lambda: False) -> None:
        """Let time pass, until `until` at most."""
        for _ in range(round(duration_s / PERIOD_S)):
            if until():
                return
            self.now_s += PERIOD_S
            self._move(self.goal_queue.tick(self.inputs, self.now_s))

    def run_out(self, limit_s: float = 60.0) -> None:
        """Until no goal is left."""
        self.run(limit_s, lambda: not self.goal_queue.busy)
        assert not self.goal_queue.busy

    def code(self, key: str) -> ErrorCode:
        """How it ended, once."""
        (end,) = self.goals[key].ends
        return end.code

    def _move(self, cycle: Cycle) -> None:
        if cycle.began is not None:
            assert self._owner is None, "two goals own the base"
            assert self.goals[cycle.began].began is None, "a goal began twice"
            rim_mps = abs(self.radps) * self.robot.base.track_m / 2.0
            assert max(abs(self.mps), rim_mps) <= self.robot.base.standstill_mps, "a goal began on a base that moves"
            self.goals[cycle.began].began = self.now_s
            self.goals[cycle.began].began_at = self.pose, self.turned_rad
            self._owner = cycle.began
        if self._owner is None:
            assert cycle.twist in (None, STOP), "nobody owns the base, and it was ordered to move"
        waiting = {key for key, goal in self.goals.items() if goal.began is None}
        assert {key for key, _feedback in cycle.feedback} <= waiting | {self._owner}
        for key, feedback in cycle.feedback:
            self.feedback.setdefault(key, []).append((self.now_s, feedback))
        for end in cycle.ends:
            self.goals[end.key].ends.append(end.outcome)
            self.goals[end.key].ended = self.now_s
            if end.key == self._owner:
                self._owner = None
        limits, stops = self.robot.limits, value(self.inputs.safety).stops
        wanted = STOP if cycle.twist is None or stops else cycle.twist
        self.mps = _ramped(self.mps, wanted.linear_mps, limits.deceleration_mps2)
        self.radps = _ramped(self.radps, wanted.angular_radps, limits.angular_deceleration_radps2)
        self.turned_rad += self.radps * PERIOD_S
        self.x_m += self.mps * math.cos(self.turned_rad) * PERIOD_S
        self.y_m += self.mps * math.sin(self.turned_rad) * PERIOD_S


def _ramped(speed: float, wanted: float, slope: float) -> float:
    """One period later."""
    return speed + max(-slope * PERIOD_S, min(slope * PERIOD_S, wanted - speed))
