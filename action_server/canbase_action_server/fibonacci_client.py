"""A client of fibonacci on the machinery of `goal_client.py`: as DriveClient is one of drive_distance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from canbase.action import Fibonacci
from rclpy.executors import Executor
from rclpy.node import Node

from canbase_action_server.goal_client import GoalClient, SentGoal, never
from canbase_action_server.outcome import Status

FEEDBACK_TIMEOUT_S: Final = 30.0
"""Three times the longest period of the server."""


@dataclass(frozen=True, slots=True)
class Numbers:
    """The end of a goal. Read `status` first."""

    status: Status
    sequence: tuple[int, ...]


class FibonacciClient(GoalClient[Numbers, "tuple[int, ...]"]):
    """Sends goals as GoalClient does."""

    def __init__(
        self, node: Node, executor: Executor | None = None, feedback_timeout_s: float = FEEDBACK_TIMEOUT_S
    ) -> None:
        super().__init__(node, Fibonacci, "fibonacci", executor, _feedback, _result, feedback_timeout_s)

    def send(
        self,
        order: int,
        *,
        on_feedback: Callable[[tuple[int, ...]], None] | None = None,
        discovery_timeout_s: float = 5.0,
        interrupted: Callable[[], bool] = never,
    ) -> SentGoal[Numbers]:
        """Find the server, send the goal once, wait for its acceptance. Raises the subclasses of DriveError."""
        return self.send_goal(Fibonacci.Goal(order=order), on_feedback, discovery_timeout_s, interrupted=interrupted)


def _feedback(message: Any) -> tuple[int, ...]:
    return tuple(message.partial_sequence)


def _result(status: Status, message: Any) -> Numbers:
    return Numbers(status, tuple(message.sequence))
