"""One accepted goal as ROS sees it: its handle, and the outcome that it ends with."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from action_msgs.msg import GoalInfo
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.action.server import GoalEvent, ServerGoalHandle

from canbase_action_server.binding import Binding
from canbase_action_server.goal import Feedback
from canbase_action_server.outcome import GoalOutcome, Status
from canbase_action_server.rejection import as_texts


def uuid_of(handle: ServerGoalHandle) -> str:
    """UUID of a goal in hex."""
    return bytes(handle.goal_id.uuid).hex()


def exact(goal: Any) -> dict[str, float]:
    """The numbers of a goal by name, not rounded; those of a message in it as "target.x"."""
    values: dict[str, float] = {}
    for name in goal.get_fields_and_field_types():
        value = getattr(goal, name)
        inner = exact(value) if hasattr(value, "get_fields_and_field_types") else None
        values |= {name: float(value)} if inner is None else {f"{name}.{key}": each for key, each in inner.items()}
    return values


def rejection(name: str, goal: Any, reason: str) -> DiagnosticStatus:
    """What `rejection.Reasons` looks for."""
    values = [KeyValue(key=key, value=text) for key, text in as_texts(exact(goal))]
    return DiagnosticStatus(level=DiagnosticStatus.WARN, name=f"{name}: goal rejected", message=reason, values=values)


def goal_numbers(goal: Any) -> dict[str, float]:
    """As `exact`, rounded for the log."""
    return {name: round(value, 5) for name, value in exact(goal).items()}


def measured_numbers(message: Any) -> dict[str, float]:
    """The measured numbers of a result or a feedback by name, for the log."""
    values = {name: getattr(message, name) for name in message.get_fields_and_field_types()}
    return {name: round(value, 5) for name, value in values.items() if isinstance(value, float)}


FEEDBACK_LOG_S = 1.0
"""Shortest time between two lines of feedback in the log; the client gets `action.feedback_hz`."""


@dataclass(slots=True)
class OpenGoal:
    """From its acceptance until its result is out."""

    handle: ServerGoalHandle
    binding: Binding
    accepted: float
    executing: bool = False
    outcome: GoalOutcome | None = None
    feedback: dict[str, float] = field(default_factory=dict)
    """The numbers of the last feedback, for the log."""
    feedback_logged: float = 0.0
    """When a line of the log had them last, or the motion began."""

    @property
    def info(self) -> GoalInfo:
        """Its UUID and the time of its acceptance, as the client got them. rclpy has no public name for the time."""
        return self.handle._goal_info

    @property
    def accepted_ns(self) -> int:
        """When ROS accepted it [ns since 1970]."""
        stamp: Time = self.info.stamp
        return int(stamp.sec * 1_000_000_000 + stamp.nanosec)

    def request_cancel(self) -> bool:
        """As the cancel of a client: from now on it is CANCELING. False: it was already."""
        if self.handle.is_cancel_requested:
            return False
        self.handle._update_state(GoalEvent.CANCEL_GOAL)
        return True

    def begin(self, now_s: float) -> None:
        """The goal has the base."""
        self.execute()
        self.feedback_logged = now_s

    def execute(self) -> None:
        """The goal is EXECUTING from now on. Once is enough.

        rclpy ties this state to the start of the execute callback, which then has to wait for the end of the goal. A
        callback that waits is polled by the executor all the time, so it is called at the end (`end`).
        """
        if not self.executing:
            self.executing = True
            if not self.handle.is_cancel_requested:
                self.handle._update_state(GoalEvent.EXECUTE)

    def tell(self, feedback: Feedback) -> None:
        """To the client."""
        message = self.binding.feedback(feedback)
        self.handle.publish_feedback(message)
        self.feedback = measured_numbers(message)

    def log_is_due(self, now_s: float) -> bool:
        """Its feedback belongs into the log now. A goal that waits has none there: nothing changes."""
        if not self.executing or now_s - self.feedback_logged < FEEDBACK_LOG_S:
            return False
        self.feedback_logged = now_s
        return True

    def end(self, outcome: GoalOutcome) -> None:
        """Has the execute callback called. A goal that never ran passes through EXECUTING, as the protocol wants it."""
        self.execute()
        self.outcome = outcome
        self.handle._action_server.notify_execute(self.handle, None)

    def result(self) -> Any:
        """The message for the client, after `end`."""
        assert self.outcome is not None
        return self.binding.result(self.outcome)

    def finish(self) -> Any:
        """Sets the final status; the result for the client, which is made before that."""
        assert self.outcome is not None
        result = self.result()
        match self.outcome.status:
            case Status.SUCCEEDED:
                self.handle.succeed()
            case Status.CANCELED:
                self.handle.canceled()
            case Status.ABORTED:
                self.handle.abort()
        return result
