"""The commands that run one process of the stack each. Thin: read robot.yaml, hand it over, exit with its code."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from canbase_cli.options import (
    ConfigOption,
    NamespaceOption,
    UnusedNamespaceOption,
    load_config,
    ros_arguments,
    ros_needed,
)
from canbase_cli.priority import raise_priority


def driver(ctx: typer.Context, config: ConfigOption = None, namespace: NamespaceOption = "") -> None:
    """Run the motor driver: brings the drives up, turns cmd_vel into setpoints, publishes odom.

    What stands behind --ros-args goes to rclpy.
    """
    robot = load_config(config).robot
    with ros_needed():
        from canbase_driver.main import run
    raise_priority("driver")
    raise typer.Exit(run(robot, ros_arguments(ctx, namespace)))


def velocity(ctx: typer.Context, config: ConfigOption = None, namespace: NamespaceOption = "") -> None:
    """Run velocity mux and safety filter: who may drive, and how fast.

    What stands behind --ros-args goes to rclpy.
    """
    robot = load_config(config).robot
    with ros_needed():
        from canbase_velocity.main import run
    raise_priority("velocity")
    raise typer.Exit(run(robot, ros_arguments(ctx, namespace)))


def action_server(ctx: typer.Context, config: ConfigOption = None, namespace: NamespaceOption = "") -> None:
    """Run the server of the action drive_distance.

    What stands behind --ros-args goes to rclpy.
    """
    robot = load_config(config).robot
    with ros_needed():
        from canbase_action_server.main import run
    raise_priority("action-server")
    raise typer.Exit(run(robot, ros_arguments(ctx, namespace)))


def sim(
    config: ConfigOption = None,
    namespace: UnusedNamespaceOption = "",
    control: Annotated[
        Path | None, typer.Option("--control", metavar="PATH", help="Unix socket to steer the simulation by.")
    ] = None,
) -> None:
    """Run simulated drives on the robot's bus, in place of the real ones."""
    from canbase_bench.main import run

    robot = load_config(config).robot
    raise_priority("sim")
    raise typer.Exit(run(robot, None if control is None else str(control)))


def watchdog(config: ConfigOption = None, namespace: UnusedNamespaceOption = "") -> None:
    """Run the watchdog: stops the drives when lease, driver or a drive goes silent or wrong.

    It replaces this process by one that has only Python's standard library and python-can in it.
    """
    from canbase_config.derive import watchdog_config

    told = watchdog_config(load_config(config).robot).to_json()
    # The ROS wheels' start-up hook would start every Python of their environment a second time.
    environment = os.environ | {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}
    os.execve(sys.executable, [sys.executable, "-m", "canbase_watchdog", "--config-json", told], environment)
