"""What single processes need of a robot, worked out from it once: raw units become metres and seconds here."""

from __future__ import annotations

import math

from canbase_config.robot import Drive, Robot
from canbase_config.units import motor_rev_per_s
from canbase_config.watchdog import WatchdogConfig, WatchedDrive


def mps_per_bit(drive: Drive, wheel_radius_m: float) -> float:
    """Speed of the wheel's rim [m/s] for one bit of the drive's 60FFh and 606Ch; the sign makes forward positive."""
    wheel_rev_per_s = motor_rev_per_s(drive.velocity_unit, drive.counts_per_motor_rev) / drive.gear_ratio
    return drive.direction * wheel_rev_per_s * 2.0 * math.pi * wheel_radius_m


def max_wheel_mps(robot: Robot) -> float:
    """The fastest that a wheel's rim may turn [m/s]: full speed ahead on the outside of the tightest turn."""
    return robot.limits.linear_mps + robot.limits.angular_radps * robot.base.track_m / 2.0


def watchdog_config(robot: Robot) -> WatchdogConfig:
    """Everything that the watchdog process is told about the robot."""
    return WatchdogConfig(
        bus_arguments=robot.bus.arguments(),
        drives=tuple(_watched(drive, robot.base.wheel_radius_m) for drive in robot.drives),
        track_m=robot.base.track_m,
        lease_socket=robot.lease.socket,
        lease_timeout_s=robot.timeouts.lease_s,
        drive_heartbeat_s=robot.timeouts.drive_heartbeat_s,
        feedback_timeout_s=robot.timeouts.feedback_s,
        standstill_mps=robot.base.standstill_mps,
        deceleration_mps2=robot.limits.deceleration_mps2,
        acceleration_mps2=robot.limits.acceleration_mps2,
        max_wheel_mps=max_wheel_mps(robot),
    )


def _watched(drive: Drive, wheel_radius_m: float) -> WatchedDrive:
    return WatchedDrive(drive.joint, drive.node_id, drive.axis, drive.side, mps_per_bit(drive, wheel_radius_m))
