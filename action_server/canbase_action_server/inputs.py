"""What the goal receives from the rest of the robot, as plain data. All times are local monotonic receive times [s].

The node fills these from its topics. `state_topics.py`: how old each may be, and what it means when it is missing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from canbase_action_server.along_track import BasePose
from canbase_runtime.driver_state import DriverState
from canbase_runtime.received import NEVER, Received
from canbase_runtime.stop_cause import StopCause
from canbase_runtime.watchdog_view import WatchdogView


@dataclass(frozen=True, slots=True)
class Odometry:
    """One message of odom."""

    received: float
    """The motion is measured between these times; `Received` decides whether it still counts."""
    pose: BasePose
    linear_mps: float
    angular_radps: float

    def finite(self) -> bool:
        """No field is NaN or infinite."""
        values = (self.pose.x_m, self.pose.y_m, self.pose.yaw_rad, self.linear_mps, self.angular_radps)
        return all(math.isfinite(value) for value in values)


@dataclass(frozen=True, slots=True)
class Safety:
    """One message of safety_filter/state."""

    stops: bool
    cause: StopCause
    detail: str
    estop: bool


@dataclass(frozen=True, slots=True)
class Driver:
    """One message of motor_driver/status."""

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

    active: str
    held_back: str = ""
    """Why cmd_vel_action is locked now, for every publisher; empty: it is not."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """Everything at one moment."""

    odometry: Received[Odometry] = NEVER
    safety: Received[Safety] = NEVER
    driver: Received[Driver] = NEVER
    mux: Received[Mux] = NEVER
    contested: Received[Mapping[str, str]] = NEVER
    """The last report of velocity_mux that names second publishers: topic, and a sentence with both nodes."""
    cancel_requested: bool = False
    preempted: bool = False
    """A newer goal waits for the base."""
    client_lost: bool = False
    """The client that must stay alive for this goal publishes its lease no longer."""
    shutdown: bool = False
