"""A driver of two healthy drives at one moment, and the same with something else about it."""

import dataclasses
import math
from typing import Any

from canbase_driver.causes import Finding
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.cia402 import DriveState
from canbase_driver.drives.drive_snapshot import DriveSnapshot
from canbase_driver.drives.odometry_feed import OdometryReport
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.odometry import Pose2D
from canbase_driver.motion.velocity_command import CommandReport
from canbase_driver.snapshot import DriverSnapshot
from canbase_driver.supervision.bus_health import BusReport
from canbase_driver.supervision.cycle_stats import CycleReport
from canbase_driver.supervision.watchdog_link import WatchdogReport
from canbase_runtime.driver_state import DriverState
from canbase_runtime.watchdog_view import WatchdogView

LEFT = DriveSnapshot(
    joint="left_wheel_joint",
    node_id=1,
    axis=0,
    nmt_state=NmtState.OPERATIONAL,
    state=DriveState.OPERATION_ENABLED,
    statusword=0x0637,
    error_code=0,
    error_text="",
    target_radps=5.0,
    velocity_radps=4.9,
    position_rad=123.5,
    feedback_age_s=0.004,
    heartbeat_age_s=0.05,
    stops_by_itself=True,
)
RIGHT = dataclasses.replace(LEFT, joint="right_wheel_joint", node_id=2, axis=1, position_rad=-7.25)
SNAPSHOT = DriverSnapshot(
    time_s=1000.0,
    state=DriverState.ENABLED,
    finding=Finding(),
    standstill=False,
    watchdog=WatchdogReport(view=WatchdogView.OK, cause="none", age_s=0.03, rung=0, lease_age_s=0.02),
    command=CommandReport(age_s=0.015, fresh=True, refused=1),
    cycle=CycleReport(cycles=12_345, overruns=2, lateness_max_s=0.0004),
    bus=BusReport(dropped=3, send_errors=4),
    odometry=OdometryReport(
        pose=Pose2D(1.5, -0.5, math.pi / 3.0),
        twist=Twist2D(0.4, -0.2),
        pose_covariance=tuple(float(k) for k in range(36)),
        twist_covariance=tuple(float(100 + k) for k in range(36)),
        valid=True,
    ),
    drives=(LEFT, RIGHT),
)


def with_left(**changes: Any) -> DriverSnapshot:
    """The snapshot with another left drive."""
    return dataclasses.replace(SNAPSHOT, drives=(dataclasses.replace(LEFT, **changes), RIGHT))


def with_driver(**changes: Any) -> DriverSnapshot:
    """The snapshot with another driver. A dict changes fields of one of its reports."""
    return dataclasses.replace(SNAPSHOT, **{name: _changed(name, change) for name, change in changes.items()})


def _changed(name: str, change: Any) -> Any:
    return dataclasses.replace(getattr(SNAPSHOT, name), **change) if isinstance(change, dict) else change
