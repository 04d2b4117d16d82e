"""The action rotate_angle: its messages, and what they mean to the machinery."""

from __future__ import annotations

from canbase.action import RotateAngle

from canbase_action_server.binding import DEFECT, Binding
from canbase_action_server.goal import Feedback
from canbase_action_server.goal_request import RotateRequest
from canbase_action_server.motion_limits import lever_m
from canbase_action_server.outcome import ErrorCode, GoalOutcome
from canbase_config.robot import Robot


def rotate_binding(robot: Robot) -> Binding:
    """For the server. The machinery counts the way of the wheels, the client radians."""
    lever = lever_m(robot)

    def feedback_out(feedback: Feedback) -> RotateAngle.Feedback:
        return RotateAngle.Feedback(turned_rad=feedback.traveled_m / lever, remaining_rad=feedback.remaining_m / lever)

    def result_out(outcome: GoalOutcome) -> RotateAngle.Result:
        return RotateAngle.Result(
            error_code=int(outcome.code),
            turned_rad=outcome.traveled_m / lever,
            overshoot_rad=outcome.overshoot_m / lever,
            message=outcome.message,
        )

    defect = RotateAngle.Result(error_code=int(ErrorCode.INTERNAL), message=DEFECT)
    return Binding("rotate_angle", RotateAngle, _request, feedback_out, result_out, defect)


def _request(goal: RotateAngle.Goal) -> RotateRequest:
    return RotateRequest(goal.angle_rad, goal.max_speed_radps)
