"""A client of rotate_angle for applications. Its outcomes: `goal_client.py`; its errors: `goal_errors.py`.

turn = RotateClient(node).send(math.pi, 0.5)  # raises NoServerError, NoResponseError, RejectedError
result = turn.wait()                          # read result.status first; raises ServerLostError, FeedbackLostError
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from canbase.action import RotateAngle
from rclpy.executors import Executor
from rclpy.node import Node

from canbase_action_server.feedback_watch import FEEDBACK_TIMEOUT_S
from canbase_action_server.goal_client import GoalClient, SentGoal, never
from canbase_action_server.outcome import ErrorCode, Status


@dataclass(frozen=True, slots=True)
class RotateResult:
    """The end of a goal. Read `status` first."""

    status: Status
    code: ErrorCode
    turned_rad: float
    overshoot_rad: float
    message: str


@dataclass(frozen=True, slots=True)
class RotateFeedback:
    """How far the base has turned [rad]."""

    turned_rad: float
    remaining_rad: float


Turn = SentGoal[RotateResult]
"""One accepted goal."""


class RotateClient(GoalClient[RotateResult, RotateFeedback]):
    """Sends goals as GoalClient does."""

    def __init__(
        self,
        node: Node,
        executor: Executor | None = None,
        action: str = "rotate_angle",
        feedback_timeout_s: float = FEEDBACK_TIMEOUT_S,
    ) -> None:
        super().__init__(node, RotateAngle, action, executor, _feedback, _result, feedback_timeout_s)

    def send(
        self,
        angle_rad: float,
        max_speed_radps: float,
        *,
        on_feedback: Callable[[RotateFeedback], None] | None = None,
        discovery_timeout_s: float = 5.0,
        response_timeout_s: float = 5.0,
        interrupted: Callable[[], bool] = never,
    ) -> Turn:
        """Find the server, send the goal once, wait for its acceptance. Raises the subclasses of DriveError."""
        goal = RotateAngle.Goal(angle_rad=float(angle_rad), max_speed_radps=float(max_speed_radps))
        return self.send_goal(goal, on_feedback, discovery_timeout_s, response_timeout_s, interrupted)


def _feedback(message: Any) -> RotateFeedback:
    return RotateFeedback(message.turned_rad, message.remaining_rad)


def _result(status: Status, message: Any) -> RotateResult:
    return RotateResult(
        status, ErrorCode(message.error_code), message.turned_rad, message.overshoot_rad, message.message
    )
