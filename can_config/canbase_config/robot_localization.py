"""The parameters of robot_localization's EKF for the base of a robot.yaml: wheel odometry and the yaw rate of an IMU.

Pure. Names and meanings as in robot_localization 3.6.0, `src/ros_filter.cpp` and `params/ekf.yaml`; a test holds the
names against that source. docs/odometry.md explains the choice.
"""

from __future__ import annotations

import json
from typing import Final

from canbase_config.robot import Robot

STATE: Final = ("x", "y", "z", "roll", "pitch", "yaw", "vx", "vy", "vz", "vroll", "vpitch", "vyaw", "ax", "ay", "az")
"""The order of robot_localization's vectors."""
FROM_ODOM: Final = ("vx", "vy", "vyaw")
"""Velocities alone: pose and twist of odom come from the same wheels, and both would count them twice. vy is measured
as 0: wheels do not roll sideways."""
FROM_IMU: Final = ("vyaw",)
"""Its gyroscope. Accelerations of a base are smaller than those of an IMU that is mounted at an angle."""
STILL: Final = 1e-6
"""Process noise per second of what the motion model has right: the pose follows from the velocities."""


def ekf(robot: Robot, imu_topic: str) -> str:
    """The file for `ros2 run robot_localization ekf_node --ros-args --params-file`. Units: Hz, s, m, rad."""
    limits, base, rate_hz = robot.limits, robot.base, robot.rates.odometry_hz
    linear_mps2 = max(limits.acceleration_mps2, limits.emergency_deceleration_mps2)
    angular_radps2 = max(limits.angular_acceleration_radps2, limits.angular_deceleration_radps2)
    noise = {"vx": linear_mps2**2 / rate_hz, "vyaw": angular_radps2**2 / rate_hz}
    return _TEMPLATE.format(
        robot=robot.name,
        rate_hz=float(rate_hz),
        timeout_s=float(robot.timeouts.odometry_s),
        odom_frame=json.dumps(base.odom_frame),
        base_frame=json.dumps(base.base_frame),
        imu=json.dumps(imu_topic),
        odom_config=_vector([_bool(name in FROM_ODOM) for name in STATE]),
        imu_config=_vector([_bool(name in FROM_IMU) for name in STATE]),
        noise=_vector([f"{noise.get(name, STILL):.6f}" for name in STATE]),
    )


def note(robot: Robot) -> str:
    """What robot.yaml needs for it; empty: nothing."""
    if not robot.odometry.publish_tf:
        return ""
    transform = f"{robot.base.odom_frame} → {robot.base.base_frame}"
    return (
        f"the filter publishes {transform}, and so does motor_driver: set odometry.publish_tf: false in robot.yaml, "
        "or both poses alternate"
    )


def _bool(value: bool) -> str:
    return "true" if value else "false"


def _vector(values: list[str]) -> str:
    """Fifteen values in rows of three, below their key."""
    rows = [", ".join(values[k : k + 3]) for k in range(0, len(values), 3)]
    return "\n      [" + ",\n       ".join(rows) + "]"


_TEMPLATE: Final = """\
# Parameters of robot_localization's ekf_node for the robot {robot}, printed by canbase print ekf from its robot.yaml.
# ros2 run robot_localization ekf_node --ros-args --params-file ekf.yaml
/**/ekf_filter_node:
  ros__parameters:
    frequency: {rate_hz}             # rates.odometry_hz
    sensor_timeout: {timeout_s}         # timeouts.odometry_s
    two_d_mode: true
    publish_tf: true            # robot.yaml has odometry.publish_tf: false
    odom_frame: {odom_frame}
    base_link_frame: {base_frame}
    world_frame: {odom_frame}

    # In each: x, y, z; roll, pitch, yaw; their velocities; accelerations.
    # Velocities alone: the pose of odom comes from the same wheels. vy is 0: wheels do not roll sideways.
    odom0: odom
    odom0_config:{odom_config}
    odom0_queue_size: 10

    # The gyroscope. The frame_id of its messages needs a static transform from the base frame.
    imu0: {imu}
    imu0_config:{imu_config}
    imu0_queue_size: 10

    # The diagonal, per second. Velocities change as fast as limits allow; the pose follows from them.
    process_noise_covariance:{noise}
"""
