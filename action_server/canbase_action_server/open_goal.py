"""One accepted goal as ROS sees it: its handle, and the outcome that the execute callback waits for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.action.server import ServerGoalHandle
from rclpy.task import Future

from canbase_action_server.binding import Binding
from canbase_action_server.goal import Feedback
from canbase_action_server.outcome import Outcome, Status
from canbase_action_server.rejection import as_texts


def uuid_of(handle: ServerGoalHandle) -> str:
    """UUID of a goal in hex."""
    return bytes(handle.goal_id.uuid).hex()


def exact(goal: Any) -> dict[str, float]:
    """The numbers of a goal by name, not rounded."""
    return {name: float(getattr(goal, name)) for name in goal.get_fields_and_field_types()}


def rejection(name: str, goal: Any, reason: str) -> DiagnosticStatus:
    """What `rejection.Reasons` looks for."""
    values = [KeyValue(key=key, value=text) for key, text in as_texts(exact(goal))]
    return DiagnosticStatus(level=DiagnosticStatus.WARN, name=f"{name}: goal rejected", message=reason, values=values)


def numbers(message: Any) -> dict[str, float]:
    """The numbers of a goal or a result by name, for the log."""
    values = {name: getattr(message, name) for name in message.get_fields_and_field_types()}
    return {name: round(value, 5) for name, value in values.items() if isinstance(value, float)}


@dataclass(slots=True)
class OpenGoal:
    """From its acceptance until its result is out."""

    handle: ServerGoalHandle
    binding: Binding
    accepted: float
    executing: bool = False
    outcome: Future = field(default_factory=Future)

    def execute(self) -> None:
        """Calls the execute callback soon; the goal is EXECUTING from now on. Once is enough."""
        if not self.executing:
            self.executing = True
            self.handle.execute()

    def tell(self, feedback: Feedback) -> None:
        """To the client."""
        self.handle.publish_feedback(self.binding.feedback(feedback))

    def end(self, outcome: Outcome) -> None:
        """Lets the execute callback go on. A goal that never ran passes through EXECUTING, as the protocol wants it."""
        self.execute()
        self.outcome.set_result(outcome)

    def finish(self, outcome: Outcome) -> Any:
        """Sets the final status; the result for the client."""
        match outcome.status:
            case Status.SUCCEEDED:
                self.handle.succeed()
            case Status.CANCELED:
                self.handle.canceled()
            case Status.ABORTED:
                self.handle.abort()
        return self.binding.result(outcome)
