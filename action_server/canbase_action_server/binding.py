"""What ties one ROS action to the machinery that all actions of this server share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from canbase_action_server.goal import Feedback
from canbase_action_server.goal_request import Request
from canbase_action_server.outcome import GoalOutcome

DEFECT = "defect in the action server, see its log"


@dataclass(frozen=True, slots=True)
class Binding:
    """Name and type of an action, and how its messages are read and made."""

    name: str
    type: type
    request: Callable[[Any], Request]
    feedback: Callable[[Feedback], Any]
    result: Callable[[GoalOutcome], Any]
    defect: Any
    """The result of a goal whose own one cannot be made."""
