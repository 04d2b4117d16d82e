"""A client of drive_distance for applications. Its outcomes: `goal_client.py`; its errors: `goal_errors.py`.

drive = DriveClient(node).send(1.0, 0.2)      # raises NoServerError, NoResponseError, RejectedError
result = drive.wait()                         # read result.status first; raises ServerLostError, FeedbackLostError
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from canbase.action import DriveDistance
from rclpy.executors import Executor
from rclpy.node import Node

from canbase_action_server.feedback_watch import FEEDBACK_TIMEOUT_S
from canbase_action_server.goal_client import GoalClient, SentGoal, never
from canbase_action_server.goal_errors import (
    DriveError,
    FeedbackLostError,
    InterruptedDriveError,
    NoResponseError,
    NoServerError,
    RejectedError,
    ServerLostError,
)
from canbase_action_server.outcome import ErrorCode, Status

__all__ = [
    "Drive",
    "DriveClient",
    "DriveError",
    "DriveFeedback",
    "DriveResult",
    "FeedbackLostError",
    "InterruptedDriveError",
    "NoResponseError",
    "NoServerError",
    "RejectedError",
    "ServerLostError",
]


@dataclass(frozen=True, slots=True)
class DriveResult:
    """The end of a goal. Read `status` first."""

    status: Status
    code: ErrorCode
    traveled_m: float
    overshoot_m: float
    message: str


@dataclass(frozen=True, slots=True)
class DriveFeedback:
    """Where the base is on its way [m]."""

    traveled_m: float
    remaining_m: float


Drive = SentGoal[DriveResult]
"""One accepted goal."""


class DriveClient(GoalClient[DriveResult, DriveFeedback]):
    """Sends goals as GoalClient does."""

    def __init__(
        self,
        node: Node,
        executor: Executor | None = None,
        action: str = "drive_distance",
        feedback_timeout_s: float = FEEDBACK_TIMEOUT_S,
    ) -> None:
        super().__init__(node, DriveDistance, action, executor, _feedback, _result, feedback_timeout_s)

    def send(
        self,
        distance_m: float,
        max_speed_mps: float,
        *,
        on_feedback: Callable[[DriveFeedback], None] | None = None,
        discovery_timeout_s: float = 5.0,
        response_timeout_s: float = 5.0,
        interrupted: Callable[[], bool] = never,
    ) -> Drive:
        """Find the server, send the goal once, wait for its acceptance. Raises the subclasses of DriveError."""
        goal = DriveDistance.Goal(distance_m=float(distance_m), max_speed_mps=float(max_speed_mps))
        return self.send_goal(goal, on_feedback, discovery_timeout_s, response_timeout_s, interrupted)


def _feedback(message: Any) -> DriveFeedback:
    return DriveFeedback(message.traveled_m, message.remaining_m)


def _result(status: Status, message: Any) -> DriveResult:
    return DriveResult(status, ErrorCode(message.error_code), message.traveled_m, message.overshoot_m, message.message)
