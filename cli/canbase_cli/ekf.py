"""`canbase print ekf`: parameters of robot_localization for the base of a robot.yaml."""

from __future__ import annotations

from typing import Annotated

import typer

from canbase_cli.options import ConfigOption, RobotFile, one_of
from canbase_runtime.terminal import load_config


def ekf(
    file: RobotFile = None,
    config: ConfigOption = None,
    imu: Annotated[str, typer.Option("--imu", metavar="TOPIC", help="sensor_msgs/Imu, in its own frame.")] = "imu",
) -> None:
    """Print the parameters of robot_localization's ekf_node: odom and the yaw rate of an IMU become one pose.

    For example: canbase print ekf robot.yaml > ekf.yaml

    The filter then publishes odom_frame → base_frame, so robot.yaml needs odometry.publish_tf: false. What is missing
    is reported on stderr. docs/odometry.md explains the parameters.

    Exit codes: 0 printed, 2 the robot.yaml cannot be used.
    """
    from canbase_config.robot_localization import ekf as parameters
    from canbase_config.robot_localization import note

    robot = load_config(one_of(file, config), quiet=True).robot
    if missing := note(robot):
        typer.echo(f"note: {missing}", err=True)
    typer.echo(parameters(robot, imu), nl=False)
