"""What single processes need of a robot, worked out from it once, in metres and seconds."""

from __future__ import annotations

import math

from canbase_config.drive import Drive
from canbase_config.profile import Profile
from canbase_config.robot import Robot
from canbase_config.stopping import (
    BRAKING_SHARE,
    SLOPE_S,
    SLOPE_SHARE,
    coasting_s,
    emergency_wait_s,
    hardest_braking_mps2,
    hardest_stop_mps2,
    jerk_adds_s,
    max_wheel_mps,
    order_wait_s,
    slowest_ramp_mps2,
)
from canbase_config.units import m_per_count, mps_per_bit, velocity_scale
from canbase_config.watchdog import RelayLine, WatchdogConfig, WatchedDrive, WatchedLayout

NOMINAL_HZ, LEAST_SAMPLES = 100.0, 2
"""Samples in a row stand for a time, which a slow cycle must not draw out. One bad sample alone may be an outlier."""
BRAKING_SAMPLES = 3


def speed_noise_mps(robot: Robot) -> float:
    """How far one value of 606Ch may be from the speed of the rim [m/s]: base.standstill_mps, or one coarse bit."""
    base = robot.base
    bits = (mps_per_bit(drive, base.radius_m(drive.side)) * velocity_scale(drive) for drive in robot.drives)
    return max(base.standstill_mps, *map(abs, bits))


def slope_window_s(robot: Robot) -> float:
    """Two speeds this far apart in time distinguish a slope of SLOPE_SHARE from noise, up and down [s]."""
    return max(SLOPE_S, 4.0 * speed_noise_mps(robot) / (SLOPE_SHARE * robot.limits.deceleration_mps2))


def samples(robot: Robot, count: int) -> int:
    """The number of samples in a row that takes as long as `count` at NOMINAL_HZ: at least two, at most `count`."""
    return min(count, max(LEAST_SAMPLES, math.ceil(count * robot.rates.control_hz / NOMINAL_HZ)))


def order_hold_s(robot: Robot) -> float:
    """How long the driver may follow an order that another one has replaced [s]: the jerk limit draws it out."""
    return order_wait_s(robot) + jerk_adds_s(robot.limits)


def watchdog_config(robot: Robot) -> WatchdogConfig:
    """The whole configuration of the watchdog process."""
    limits, timeouts, watchdog = robot.limits, robot.timeouts, robot.watchdog
    return WatchdogConfig(
        bus_arguments=robot.bus_arguments(),
        drives=tuple(
            watched_drive(drive, robot.base.radius_m(drive.side), hardest_braking_mps2(robot, drive))
            for drive in robot.drives
        ),
        track_m=robot.base.track_m,
        control_hz=robot.rates.control_hz,
        lease_socket=robot.lease.socket,
        lease_timeout_s=timeouts.lease_s,
        lease_uid=robot.lease.uid,
        drive_heartbeat_s=timeouts.drive_heartbeat_s,
        feedback_timeout_s=timeouts.feedback_s,
        loop_late_s=watchdog.loop_late_s,
        bus_failed_s=watchdog.bus_failed_s,
        standstill_mps=robot.base.standstill_mps,
        linear_mps=limits.linear_mps,
        angular_radps=limits.angular_radps,
        acceleration_mps2=limits.acceleration_mps2,
        deceleration_mps2=limits.deceleration_mps2,
        emergency_deceleration_mps2=limits.emergency_deceleration_mps2,
        angular_acceleration_radps2=limits.angular_acceleration_radps2,
        angular_deceleration_radps2=limits.angular_deceleration_radps2,
        max_wheel_mps=max_wheel_mps(robot),
        order_hold_s=order_hold_s(robot),
        order_wait_s=order_wait_s(robot),
        emergency_wait_s=emergency_wait_s(robot),
        jerk_mps3=limits.jerk_mps3,
        drive_lag_s=watchdog.drive_lag_s,
        target_tolerance_mps=watchdog.target_tolerance_mps,
        target_tolerance_share=watchdog.target_tolerance_share,
        motion_tolerance_mps=watchdog.motion_tolerance_mps,
        motion_tolerance_share=watchdog.motion_tolerance_share,
        feedback_samples=samples(robot, watchdog.feedback_samples),
        jolts=watchdog.feedback_samples,
        braking_samples=samples(robot, BRAKING_SAMPLES),
        overspeed_factor=watchdog.overspeed_factor,
        travel_tolerance_m=watchdog.travel_tolerance_m,
        braking_mps2=BRAKING_SHARE * limits.deceleration_mps2,
        coasting_s=coasting_s(watchdog.overspeed_factor * max_wheel_mps(robot)),
        motion_missing_s=watchdog.motion_missing_s,
        motion_missing_m=watchdog.motion_missing_m,
        stand_impulse_s=watchdog.stand_impulse_s,
        stand_answer_s=watchdog.stand_answer_s,
        stand_proof=watchdog.stand_proof == "let_go",
        jolt_mps2=watchdog.jolt_mps2,
        hardest_stop_mps2=hardest_stop_mps2(robot),
        slow_wheel_share=watchdog.slow_wheel_share,
        slow_wheel_s=watchdog.slow_wheel_s,
        slowest_ramp_mps2=watchdog.slowest_ramp_mps2 or slowest_ramp_mps2(robot),
        twist_tolerance_mps=watchdog.twist_tolerance_mps,
        twist_tolerance_share=watchdog.twist_tolerance_share,
        twist_s=watchdog.twist_s,
        relay=RelayLine(watchdog.relay.chip, watchdog.relay.line) if watchdog.relay else None,
        robot=robot.name,
        recording_folder=robot.black_box.folder,
        recording_s=robot.black_box.seconds,
        recordings=robot.black_box.files,
    )


def watched_drive(drive: Drive, wheel_radius_m: float, hardest_mps2: float) -> WatchedDrive:
    """The watchdog's configuration of one axis; `hardest_mps2`: stopping.hardest_braking_mps2 of it."""
    return WatchedDrive(
        joint=drive.joint,
        node_id=drive.node_id,
        axis=drive.axis,
        side=drive.side,
        mps_per_bit=mps_per_bit(drive, wheel_radius_m),
        m_per_count=m_per_count(drive, wheel_radius_m),
        velocity_scale=velocity_scale(drive),
        answers_sync=drive.kind.pdo.synchronous,
        layout=_layout(drive.kind),
        hardest_braking_mps2=hardest_mps2,
        guarded=drive.kind.self_stop.node_guarding,
    )


def _layout(profile: Profile) -> WatchedLayout:
    layout = profile.layout
    return WatchedLayout(
        sub_index=layout.second_axis == "sub_index",
        shared_controlword=layout.controlword == "shared",
        packed_statusword=layout.statusword == "packed",
        target_bits=layout.target_bits,
        velocity_bits=layout.velocity_bits,
        vl=profile.is_vl,
    )
