"""The goals of Nav2's behaviours DriveOnHeading, BackUp and Spin, as motions of this server. Knows no ROS.

Rules, after nav2_behaviors (branches jazzy and main): DriveOnHeading wants one sign for distance and speed, and BackUp
goes backward whatever the signs are; both refuse y and z. A time allowance of 0 or less is none. What differs here: a
speed above `action.max_speed_mps` is driven at that limit, and a goal without a distance or angle is invalid, where
Nav2 reports success.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_action_server.goal_request import DriveRequest, RotateRequest, Terms
from canbase_action_server.inputs import Odometry
from canbase_action_server.motion import Motion
from canbase_config.robot import Robot

RELEASE_S = 3.0
"""A behaviour follows directly on a goal of the controller. Its last commands keep the base for up to 1.5 s by default:
velocity_smoother's velocity_timeout of 1.0 s, then timeout_s of the mux's source."""


@dataclass(frozen=True, slots=True)
class Target:
    """Where DriveOnHeading and BackUp go, relative to the base [m]."""

    x_m: float
    y_m: float = 0.0
    z_m: float = 0.0


@dataclass(frozen=True, slots=True)
class BehaviorRequest:
    """One goal. `misfit`: why Nav2's own rules refuse it; None: they do not."""

    motion_request: DriveRequest | RotateRequest
    time_allowance_s: float
    misfit: str | None = None

    @property
    def terms(self) -> Terms:
        """As behaviour trees expect them."""
        allowance_s = self.time_allowance_s if self.time_allowance_s > 0.0 else math.inf
        return Terms(allowance_s, RELEASE_S, reports_invalid=True)

    def range_reason(self, robot: Robot) -> str | None:
        """Why its numbers are refused; None: they are good."""
        return self.misfit or self.motion_request.range_reason(robot)

    def motion(self, robot: Robot, start: Odometry) -> Motion:
        """The motion from `start` on."""
        return self.motion_request.motion(robot, start)


def drive_on_heading(robot: Robot, target: Target, speed_mps: float, time_allowance_s: float) -> BehaviorRequest:
    """Along the heading; `speed_mps` has the sign of `target.x_m`."""
    misfit = _sideways(target)
    if misfit is None and (target.x_m > 0.0) != (speed_mps > 0.0):
        misfit = f"target.x is {target.x_m:.6g} and speed is {speed_mps:.6g}; both need the same sign"
    return BehaviorRequest(DriveRequest(target.x_m, _at_most(robot, speed_mps)), time_allowance_s, misfit)


def back_up(robot: Robot, target: Target, speed_mps: float, time_allowance_s: float) -> BehaviorRequest:
    """Backward by the magnitude of `target.x_m`."""
    request = DriveRequest(-abs(target.x_m), _at_most(robot, speed_mps))
    return BehaviorRequest(request, time_allowance_s, _sideways(target))


def spin(robot: Robot, angle_rad: float, time_allowance_s: float) -> BehaviorRequest:
    """In place, counter-clockwise positive, at `action.spin_speed_radps`."""
    speed_radps = min(robot.action.spin_speed_radps, robot.action.max_speed_radps)
    return BehaviorRequest(RotateRequest(angle_rad, speed_radps), time_allowance_s)


def _sideways(target: Target) -> str | None:
    if target.y_m == 0.0 and target.z_m == 0.0:
        return None
    return f"target.y is {target.y_m:.6g} and target.z is {target.z_m:.6g}; the base drives along x alone: both need 0"


def _at_most(robot: Robot, speed_mps: float) -> float:
    """Its magnitude, within the robot's limit; what is no number stays so, and is refused."""
    return min(abs(speed_mps), robot.action.max_speed_mps) if math.isfinite(speed_mps) else speed_mps
