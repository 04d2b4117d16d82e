"""The action drive_distance: its messages, and what they mean to the machinery."""

from __future__ import annotations

from canbase.action import DriveDistance

from canbase_action_server.binding import DEFECT, Binding
from canbase_action_server.goal import Feedback
from canbase_action_server.goal_request import DriveRequest
from canbase_action_server.outcome import ErrorCode, GoalOutcome


def drive_binding() -> Binding:
    """For the server."""
    defect = DriveDistance.Result(error_code=int(ErrorCode.INTERNAL), message=DEFECT)
    return Binding("drive_distance", DriveDistance, _request, _feedback, _result, defect)


def _request(goal: DriveDistance.Goal) -> DriveRequest:
    return DriveRequest(goal.distance_m, goal.max_speed_mps)


def _feedback(feedback: Feedback) -> DriveDistance.Feedback:
    return DriveDistance.Feedback(traveled_m=feedback.traveled_m, remaining_m=feedback.remaining_m)


def _result(outcome: GoalOutcome) -> DriveDistance.Result:
    return DriveDistance.Result(
        error_code=int(outcome.code),
        traveled_m=outcome.traveled_m,
        overshoot_m=outcome.overshoot_m,
        message=outcome.message,
    )
