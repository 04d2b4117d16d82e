"""The request of a client: the numbers of a goal, their valid ranges, and the motion that they mean."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from canbase_action_server.inputs import Odometry
from canbase_action_server.motion import Motion
from canbase_action_server.motion_limits import lever_m, profile_limits, turn_limits
from canbase_action_server.straight import StraightMotion
from canbase_action_server.turn import TurnMotion
from canbase_config.action import Action
from canbase_config.robot import Robot


@dataclass(frozen=True, slots=True)
class Terms:
    """What holds for a goal besides its motion. The defaults are those of canbase's own actions."""

    time_allowance_s: float = math.inf
    """From the start of its motion: not finished after that, TIMEOUT. The overall time of robot.yaml holds as well."""
    release_s: float = 0.0
    """It waits for so long until a program (not an operator) that commands the base stops to do so."""
    reports_invalid: bool = False
    """With invalid numbers it is accepted, and ends with INVALID_GOAL; else it is rejected."""


class Request(Protocol):
    """A goal of any action of this server."""

    @property
    def terms(self) -> Terms:
        """What holds for it besides its motion."""

    def range_reason(self, robot: Robot) -> str | None:
        """Why its numbers are refused; None: they are good."""

    def motion(self, robot: Robot, start: Odometry) -> Motion:
        """The motion from `start` on."""


@dataclass(frozen=True, slots=True)
class DriveRequest:
    """Goal of drive_distance; the meaning of the fields is in DriveDistance.action."""

    distance_m: float
    max_speed_mps: float

    @property
    def terms(self) -> Terms:
        """The defaults."""
        return Terms()

    def range_reason(self, robot: Robot) -> str | None:
        """Why its numbers are refused; None: they are good."""
        action = robot.action
        return _outside(action, "|distance_m|", abs(self.distance_m), "distance_m") or _outside(
            action, "max_speed_mps", self.max_speed_mps, "speed_mps"
        )

    def motion(self, robot: Robot, start: Odometry) -> Motion:
        """Straight on."""
        return StraightMotion(start, self.distance_m, profile_limits(robot, self.max_speed_mps))


@dataclass(frozen=True, slots=True)
class RotateRequest:
    """Goal of rotate_angle; the meaning of the fields is in RotateAngle.action."""

    angle_rad: float
    max_speed_radps: float

    @property
    def terms(self) -> Terms:
        """The defaults."""
        return Terms()

    def range_reason(self, robot: Robot) -> str | None:
        """Why its numbers are refused; None: they are good."""
        action = robot.action
        return _outside(action, "|angle_rad|", abs(self.angle_rad), "angle_rad") or _outside(
            action, "max_speed_radps", self.max_speed_radps, "speed_radps"
        )

    def motion(self, robot: Robot, start: Odometry) -> Motion:
        """In place."""
        return TurnMotion(start, self.angle_rad, lever_m(robot), turn_limits(robot, self.max_speed_radps))


def _outside(action: Action, name: str, value: float, key: str) -> str | None:
    """`key` without min_ and max_. The interface carries float32: a limit that arrives rounded is still that limit."""
    low, high = getattr(action, f"min_{key}"), getattr(action, f"max_{key}")
    if not math.isfinite(value):
        return f"{name} is {value}; expected a finite number from {low} to {high}"
    if low * (1 - 1e-6) <= value <= high * (1 + 1e-6):
        return None
    limit = f"action.min_{key}" if value < low else f"action.max_{key}"
    return f"{name} is {value:.6g}, outside {low} to {high} ({limit} of robot.yaml)"
