"""A driver of two healthy drives at one moment, and the same with something else about it."""

import dataclasses
import math
from typing import Any

from canbase_driver.causes import Cause
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.cia402 import DriveState
from canbase_driver.snapshot import DriverSnapshot, DriveSnapshot
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
    cause=Cause.NONE,
    detail="",
    clears_on="",
    watchdog=WatchdogView.OK,
    watchdog_cause="none",
    watchdog_age_s=0.03,
    watchdog_lease_age_s=0.02,
    standstill=False,
    command_age_s=0.015,
    command_fresh=True,
    commands_refused=1,
    cycles=12_345,
    overruns=2,
    cycle_lateness_max_s=0.0004,
    frames_dropped=3,
    send_errors=4,
    drives=(LEFT, RIGHT),
    x_m=1.5,
    y_m=-0.5,
    yaw_rad=math.pi / 3.0,
    linear_mps=0.4,
    angular_radps=-0.2,
    pose_covariance=tuple(float(k) for k in range(36)),
    twist_covariance=tuple(float(100 + k) for k in range(36)),
    odometry_valid=True,
)


def with_left(**changes: Any) -> DriverSnapshot:
    """The snapshot with another left drive."""
    return dataclasses.replace(SNAPSHOT, drives=(dataclasses.replace(LEFT, **changes), RIGHT))


def with_driver(**changes: Any) -> DriverSnapshot:
    """The snapshot with another driver."""
    return dataclasses.replace(SNAPSHOT, **changes)
