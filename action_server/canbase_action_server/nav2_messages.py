"""The actions drive_on_heading, backup and spin of nav2_msgs: their messages, and what they mean to the machinery.

`disable_collision_checks`, a field of newer versions, is not read: the safety filter cannot be switched off.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from builtin_interfaces.msg import Duration
from nav2_msgs.action import BackUp, DriveOnHeading, Spin

from canbase_action_server.binding import DEFECT, Binding
from canbase_action_server.goal import Feedback
from canbase_action_server.motion_limits import lever_m
from canbase_action_server.nav2_request import BehaviorRequest, Target, back_up, drive_on_heading, spin
from canbase_action_server.outcome import ErrorCode, GoalOutcome
from canbase_config.robot import Robot

CODES = {
    ErrorCode.OK: "NONE",
    ErrorCode.CANCELED: "NONE",
    ErrorCode.TIMEOUT: "TIMEOUT",
    ErrorCode.NO_PROGRESS: "TIMEOUT",
    ErrorCode.ODOMETRY_LOST: "TF_ERROR",
    ErrorCode.BLOCKED: "COLLISION_AHEAD",
    ErrorCode.SCAN_LOST: "COLLISION_AHEAD",
    ErrorCode.INVALID_GOAL: "INVALID_INPUT",
}
"""By the names of Nav2's constants; every other code is UNKNOWN, and so is one that the action lacks (Spin has no
INVALID_INPUT)."""


def nav2_bindings(robot: Robot) -> list[Binding]:
    """For the server, under the names of Nav2's behavior_server."""
    return [
        _binding("drive_on_heading", DriveOnHeading, partial(_straight, drive_on_heading, robot), _distance),
        _binding("backup", BackUp, partial(_straight, back_up, robot), _backed),
        _binding("spin", Spin, partial(_turn, robot), partial(_angle, lever_m(robot))),
    ]


def error_code(kind: Any, code: ErrorCode) -> int:
    """What the result of `kind` has for this code."""
    return int(getattr(kind.Result, CODES.get(code, "UNKNOWN"), kind.Result.UNKNOWN))


def _binding(
    name: str, kind: Any, request: Callable[[Any], BehaviorRequest], feedback: Callable[[Feedback], Any]
) -> Binding:
    defect = kind.Result(error_code=error_code(kind, ErrorCode.INTERNAL), error_msg=DEFECT)
    return Binding(name, kind, request, feedback, partial(_result, kind), defect)


def _straight(behavior: Callable[..., BehaviorRequest], robot: Robot, goal: Any) -> BehaviorRequest:
    target = Target(goal.target.x, goal.target.y, goal.target.z)
    return behavior(robot, target, goal.speed, _seconds(goal.time_allowance))


def _turn(robot: Robot, goal: Any) -> BehaviorRequest:
    return spin(robot, goal.target_yaw, _seconds(goal.time_allowance))


def _distance(feedback: Feedback) -> Any:
    return DriveOnHeading.Feedback(distance_traveled=abs(feedback.traveled_m))


def _backed(feedback: Feedback) -> Any:
    return BackUp.Feedback(distance_traveled=abs(feedback.traveled_m))


def _angle(lever: float, feedback: Feedback) -> Any:
    return Spin.Feedback(angular_distance_traveled=feedback.traveled_m / lever)


def _result(kind: Any, outcome: GoalOutcome) -> Any:
    text = outcome.message if outcome.code is ErrorCode.OK else f"{outcome.code.name}: {outcome.message}"
    elapsed = _duration(outcome.duration_s)
    return kind.Result(error_code=error_code(kind, outcome.code), error_msg=text, total_elapsed_time=elapsed)


def _seconds(duration: Duration) -> float:
    return float(duration.sec + duration.nanosec * 1e-9)


def _duration(seconds: float) -> Duration:
    whole = int(seconds)
    return Duration(sec=whole, nanosec=int((seconds - whole) * 1e9))
