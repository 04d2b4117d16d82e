"""Requests of `canbase doctor` to the action server: none of them changes anything.

The cancel is for a goal id that no goal has: the server has to look for it, and finds none. One question is on its way
at a time, so that each is timed alone.
"""

from __future__ import annotations

import math
import time
import uuid
from collections.abc import Mapping
from typing import Any, Final

from action_msgs.srv import CancelGoal
from canbase.action import DriveDistance, RotateAngle
from rcl_interfaces.srv import ListParameters
from rclpy.client import Client
from rclpy.node import Node
from unique_identifier_msgs.msg import UUID

from canbase_config.action import BEHAVIORS
from canbase_config.robot import Robot
from canbase_doctor.evidence import Answers, Goal

SERVER: Final = "drive_distance_server"
TYPES: Final[dict[str, Any]] = {"drive_distance": DriveDistance, "rotate_angle": RotateAngle}
LOST_S: Final = 1.0
"""An answer that takes longer is none."""
MOST_RESULTS: Final = 5


def action_types(robot: Robot) -> dict[str, Any]:
    """Of the actions that this robot serves. Where nav2_msgs is missing, it cannot serve those of Nav2."""
    if not robot.action.nav2_behaviors:
        return TYPES
    try:
        from nav2_msgs import action as nav2
    except ModuleNotFoundError:
        return TYPES
    return TYPES | dict(zip(BEHAVIORS, (nav2.DriveOnHeading, nav2.BackUp, nav2.Spin), strict=True))


class Series:
    """Calls one service again and again; the first answer, which waits for discovery, does not count."""

    def __init__(self, client: Client, request: Any) -> None:
        self._client, self._request = client, request
        self._asked_s = 0.0
        self._answer: Any = None
        self._times_s: list[float] = []
        self.first_answer_s = math.inf
        """When the first answer came; infinite before."""

    def step(self, now_s: float) -> bool:
        """Calls, or looks for the answer; True: no call is pending any more."""
        if self._answer is None:
            if not self._client.service_is_ready():
                return True
            self._asked_s, self._answer = now_s, self._client.call_async(self._request)
            return False
        if not self._answer.done() and now_s - self._asked_s < LOST_S:
            return False
        if self._answer.done():
            self.first_answer_s = min(self.first_answer_s, now_s)
        self._times_s.append(now_s - self._asked_s if self._answer.done() else math.inf)
        self._answer = None
        return True

    def times_s(self) -> tuple[float, ...]:
        """Of the answers, oldest first."""
        return tuple(self._times_s[1:])


class Prober:
    """Makes all calls, one after the other."""

    def __init__(self, node: Node, types: Mapping[str, Any]) -> None:
        """`types`: of the actions, by name."""
        self._node, self._types = node, types
        nobody = CancelGoal.Request()
        nobody.goal_info.goal_id = UUID(uuid=list(uuid.uuid4().bytes))  # all zeros would mean: cancel every goal
        self._question = Series(
            node.create_client(ListParameters, f"{SERVER}/list_parameters"), ListParameters.Request()
        )
        self._cancel = Series(node.create_client(CancelGoal, "drive_distance/_action/cancel_goal"), nobody)
        self._series = [self._question, self._cancel]
        self._results: dict[str, Any] = {}
        self._clients = {
            action: node.create_client(kind.Impl.GetResultService, f"{action}/_action/get_result")
            for action, kind in types.items()
        }

    @property
    def first_answer_s(self) -> float:
        """When the server had answered both kinds of questions; infinite before."""
        return max(series.first_answer_s for series in self._series)

    def step(self, goals: tuple[Goal, ...]) -> None:
        """To be called as often as possible."""
        if self._series[0].step(time.monotonic()):
            self._series.reverse()
        for goal in goals[-MOST_RESULTS:]:
            client = self._clients[goal.action]
            if goal.ended and goal.uuid not in self._results and client.service_is_ready():
                request = self._types[goal.action].Impl.GetResultService.Request()
                request.goal_id = UUID(uuid=list(bytes.fromhex(goal.uuid)))
                self._results[goal.uuid] = client.call_async(request)

    def answers(self) -> Answers:
        """So far."""
        results = {
            name: asked.done() and asked.result().status > Goal.CANCELING for name, asked in self._results.items()
        }
        return Answers(self._question.times_s(), self._cancel.times_s(), results)
