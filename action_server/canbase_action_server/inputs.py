"""What the goal sees of the rest of the robot, as plain data. All times are local monotonic receive times [s].

The node fills these from its topics; None means: nothing received yet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_action_server.along_track import Pose
from canbase_runtime.driver_state import DriverState
from canbase_runtime.stop_cause import StopCause
from canbase_runtime.watchdog_view import WatchdogView


@dataclass(frozen=True, slots=True)
class Odometry:
    """One message of odom."""

    received: float
    pose: Pose
    linear_mps: float
    angular_radps: float

    def finite(self) -> bool:
        """No field is NaN or infinite."""
        values = (self.pose.x_m, self.pose.y_m, self.pose.yaw_rad, self.linear_mps, self.angular_radps)
        return all(math.isfinite(value) for value in values)


@dataclass(frozen=True, slots=True)
class Safety:
    """One message of safety_filter/state."""

    received: float
    stops: bool
    cause: StopCause
    detail: str
    estop: bool


@dataclass(frozen=True, slots=True)
class Driver:
    """One message of motor_driver/status."""

    received: float
    state: DriverState
    cause: str
    detail: str
    watchdog: WatchdogView
    watchdog_cause: str
    standstill: bool
    hears_command: bool
    """cmd_vel reaches it; after a start the ROS network needs a moment for that."""
    pose_resets: int = 0
    """How often the pose of the odometry was reset since the driver's start: a distance across a reset is invalid."""


@dataclass(frozen=True, slots=True)
class Mux:
    """One message of velocity_mux/state: the name of the source that drives, empty for none."""

    received: float
    active: str
    held_back: str = ""
    """Why cmd_vel_action is locked now, for every publisher; empty: it is not."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """Everything at one moment."""

    odometry: Odometry | None = None
    safety: Safety | None = None
    driver: Driver | None = None
    mux: Mux | None = None
    cancel_requested: bool = False
    preempted: bool = False
    """A newer goal waits for the base."""
    client_lost: bool = False
    """The client that must stay alive for this goal publishes its lease no longer."""
    shutdown: bool = False


def age_s(received: float | None, now_s: float) -> float:
    """Time since `received`; infinite when nothing was received."""
    return math.inf if received is None else now_s - received
