"""What motions and their stops keep to on this robot: the numbers of robot.yaml as profile and standstill want them."""

from __future__ import annotations

from canbase_action_server.profile import ProfileLimits
from canbase_action_server.standstill import StandstillLimits
from canbase_action_server.state_topics import DRIVER, ODOMETRY
from canbase_config.robot import Robot
from canbase_config.stopping import standstill_s

DRIVES_LAG_S = 0.03
"""Typical time constant of a velocity-controlled drive."""


def chain_latency_s(robot: Robot) -> float:
    """From a velocity order to the wheels' motion: mux and filter, 1.5 cycles of the driver, lag of the drives."""
    return 0.5 / robot.rates.command_hz + 1.5 / robot.rates.control_hz + DRIVES_LAG_S


def profile_limits(robot: Robot, max_speed_mps: float) -> ProfileLimits:
    """For a straight motion with this max_speed_mps."""
    return ProfileLimits(
        speed_mps=min(max_speed_mps, robot.limits.linear_mps),
        acceleration_mps2=robot.limits.acceleration_mps2,
        deceleration_mps2=robot.limits.deceleration_mps2,
        jerk_mps3=robot.limits.jerk_mps3,
        crawl_mps=0.5 * robot.action.min_speed_mps,
        chain_latency_s=chain_latency_s(robot),
    )


def lever_m(robot: Robot) -> float:
    """Radius of the circle on which the wheels go when the base turns in place [m]: metres of way per radian."""
    return robot.base.track_m / 2.0


def turn_limits(robot: Robot, max_speed_radps: float) -> ProfileLimits:
    """For a turn in place with this max_speed_radps, as the wheels on their circle see it."""
    lever, limits = lever_m(robot), robot.limits
    return ProfileLimits(
        speed_mps=lever * min(max_speed_radps, limits.angular_radps),
        acceleration_mps2=lever * limits.angular_acceleration_radps2,
        deceleration_mps2=lever * limits.angular_deceleration_radps2,
        jerk_mps3=limits.jerk_mps3,
        crawl_mps=0.5 * lever * robot.action.min_speed_radps,
        chain_latency_s=chain_latency_s(robot),
    )


def standstill_limits(robot: Robot, deceleration_mps2: float) -> StandstillLimits:
    """When this robot stands after a motion that brakes with `deceleration_mps2`."""
    return StandstillLimits(
        linear_mps=robot.base.standstill_mps,
        angular_radps=2.0 * robot.base.standstill_mps / robot.base.track_m,
        noise_mps=robot.watchdog.motion_tolerance_mps,
        noise_radps=2.0 * robot.watchdog.motion_tolerance_mps / robot.base.track_m,
        odometry_timeout_s=ODOMETRY.timeout_s(robot),
        driver_timeout_s=DRIVER.timeout_s(robot),
        deceleration_mps2=deceleration_mps2,
        give_up_s=standstill_s(robot),
    )
