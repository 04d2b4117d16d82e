"""The request of a client: the numbers of a goal, their valid ranges, and the motion that they mean."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from canbase_action_server.inputs import Odometry
from canbase_action_server.limits import lever_m, profile_limits, turn_limits
from canbase_action_server.motion import Motion
from canbase_action_server.straight import StraightMotion
from canbase_action_server.turn import TurnMotion
from canbase_config.robot import Robot


class Request(Protocol):
    """A goal of any action of this server."""

    def range_reason(self, robot: Robot) -> str | None:
        """Why its numbers are refused; None: they are good."""

    def motion(self, robot: Robot, start: Odometry) -> Motion:
        """The motion from `start` on."""


@dataclass(frozen=True, slots=True)
class DriveRequest:
    """Goal of drive_distance; the meaning of the fields is in DriveDistance.action."""

    distance_m: float
    max_speed_mps: float

    def range_reason(self, robot: Robot) -> str | None:
        """Why its numbers are refused; None: they are good."""
        action = robot.action
        return _outside("|distance_m|", abs(self.distance_m), action.min_distance_m, action.max_distance_m) or _outside(
            "max_speed_mps", self.max_speed_mps, action.min_speed_mps, action.max_speed_mps
        )

    def motion(self, robot: Robot, start: Odometry) -> Motion:
        """Straight on."""
        return StraightMotion(start, self.distance_m, profile_limits(robot, self.max_speed_mps))


@dataclass(frozen=True, slots=True)
class RotateRequest:
    """Goal of rotate_angle; the meaning of the fields is in RotateAngle.action."""

    angle_rad: float
    max_speed_radps: float

    def range_reason(self, robot: Robot) -> str | None:
        """Why its numbers are refused; None: they are good."""
        action = robot.action
        return _outside("|angle_rad|", abs(self.angle_rad), action.min_angle_rad, action.max_angle_rad) or _outside(
            "max_speed_radps", self.max_speed_radps, action.min_speed_radps, action.max_speed_radps
        )

    def motion(self, robot: Robot, start: Odometry) -> Motion:
        """In place."""
        return TurnMotion(start, self.angle_rad, lever_m(robot), turn_limits(robot, self.max_speed_radps))


def _outside(name: str, value: float, low: float, high: float) -> str | None:
    if not math.isfinite(value):
        return f"{name} is {value}; expected a finite number from {low} to {high}"
    # The interface carries float32: a limit that arrives rounded is still that limit.
    if not low * (1 - 1e-6) <= value <= high * (1 + 1e-6):
        return f"{name} is {value:.6g}, outside {low} to {high} (action.* in robot.yaml)"
    return None
