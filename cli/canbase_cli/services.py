"""The commands that run one process of the stack each. Thin: read robot.yaml, hand it over, exit with its code."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from canbase_base.latch_file import create_first
from canbase_base.latch_folder import latch_folder
from canbase_base.own_folder import replaced
from canbase_base.single_instance import TakenError, bus_name, check
from canbase_cli.child import CHILD
from canbase_cli.options import (
    ROS_USAGE,
    BenchOption,
    ConfigOption,
    NamespaceOption,
    RosCommand,
    UnusedNamespaceOption,
    check_unused_ros_arguments,
    named,
    right_start,
    ros_arguments,
    ros_needed,
)
from canbase_cli.raise_priority import raise_priority
from canbase_runtime.own_modules import module_command
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail, load_config
from canbase_runtime.which_robot import VARIABLE

if TYPE_CHECKING:
    from canbase_config.robot import Robot
    from canbase_driver.runtime.claim import Claim

_UNNAMED: Final = "name the robot: --config FILE, or CANBASE_ROBOT=FILE. A component runs for no robot that is found"
SERVICES: Final = ("driver", "velocity", "action-server", "watchdog", "sim")
"""Names of the commands here."""
WITHOUT_ROS: Final = {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}
"""The ROS wheels' start-up hook would start every Python of their environment a second time."""


StopFileOption = Annotated[
    Path | None,
    typer.Option("--stop-file", metavar="PATH", help="Write here what `python -m canbase_watchdog.post_stop` needs."),
]


def driver(
    ctx: typer.Context,
    config: ConfigOption = None,
    namespace: NamespaceOption = "",
    stop_file: StopFileOption = None,
    autostart: Annotated[
        bool,
        typer.Option("--autostart/--no-autostart", help="Start active; otherwise wait for lifecycle transitions."),
    ] = True,
) -> None:
    """Run the motor driver: brings the drives up, turns cmd_vel into setpoints, publishes odom.

    Arguments after --ros-args go to rclpy.
    """
    robot, arguments = _robot_named(config), ros_arguments(ctx, namespace)
    clear_first_records(robot)
    claim = _claim(robot)
    with ros_needed():
        from canbase_driver.runtime.main import run
    leave_stop_file(robot, stop_file)

    def before_the_first_frame() -> None:
        if stop_file is None:
            start_post_stop(robot)
        raise_priority("driver")

    with right_start():
        raise typer.Exit(run(robot, arguments, claim, autostart, before_the_first_frame))


def clear_first_records(robot: Robot, *, simulated: bool = False) -> None:
    """Records of stops of a robot on a virtual bus, or with simulated drives, that has never run for this user.

    Real drives begin latched: this user has no record of them, and another one, such as that of the services, may have
    a stop in his. Where the records cannot be made, the parts start latched and report the reason.
    """
    if robot.bus.is_virtual or simulated:
        with suppress(OSError):
            create_first(latch_folder(os.environ, Path.home(), robot.name), robot.name)


def _claim(robot: Robot) -> Claim:
    """Of the driver, before its node is imported; ends the command where it cannot be had."""
    from canbase_base.frame_socket import BusError
    from canbase_driver.runtime.claim import Claim

    try:
        return Claim(robot, latch_folder(os.environ, Path.home(), robot.name))
    except (BusError, TakenError) as error:
        fail(f"driver: {error}", FAILED)


def velocity(ctx: typer.Context, config: ConfigOption = None, namespace: NamespaceOption = "") -> None:
    """Run velocity mux and safety filter: select the velocity source, limit its speed.

    Arguments after --ros-args go to rclpy.
    """
    robot, arguments = _robot_named(config), ros_arguments(ctx, namespace)
    with ros_needed():
        from canbase_velocity.main import run
    with right_start():
        raise typer.Exit(run(robot, arguments, partial(raise_priority, "velocity")))


def action_server(ctx: typer.Context, config: ConfigOption = None, namespace: NamespaceOption = "") -> None:
    """Run the server of the actions drive_distance and rotate_angle, and of Nav2's behaviours (action.nav2_behaviors).

    Arguments after --ros-args go to rclpy.
    """
    robot, arguments = _robot_named(config), ros_arguments(ctx, namespace)
    with ros_needed():
        from canbase_action_server.main import run

        if robot.action.nav2_behaviors:
            import_module("canbase_action_server.nav2_messages")  # its messages may be missing
    with right_start():
        raise typer.Exit(run(robot, arguments, partial(raise_priority, "action-server")))


def sim(
    ctx: typer.Context,
    config: ConfigOption = None,
    bench: BenchOption = False,
    namespace: UnusedNamespaceOption = "",
    control: Annotated[
        Path | None, typer.Option("--control", metavar="PATH", help="Unix socket that controls the simulation.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print warnings only.")] = False,
    factory_fresh: Annotated[
        bool, typer.Option("--factory-fresh", help="Every drive has node id 1 and 125 kbit/s: for canbase bus adopt.")
    ] = False,
) -> None:
    """Run simulated drives on the robot's bus, in place of the real ones."""
    from canbase_sim.main import run

    robot = _robot_named(config, bench=bench)
    check_unused_ros_arguments(ctx)
    raise_priority("sim")
    path = None if control is None else str(control)
    raise typer.Exit(run(robot, path, quiet=quiet, factory_fresh=factory_fresh))


def watchdog(
    ctx: typer.Context,
    config: ConfigOption = None,
    namespace: UnusedNamespaceOption = "",
    stop_file: StopFileOption = None,
) -> None:
    """Run the watchdog: stops the drives when lease, driver or a drive fails or is implausible.

    This process is replaced by one that contains only Python's standard library and python-can.
    """
    from canbase_config.derive import watchdog_config

    robot = _robot_named(config)
    check_unused_ros_arguments(ctx)
    clear_first_records(robot)
    leave_stop_file(robot, stop_file)
    if stop_file is None:
        _refuse_second_watchdog(robot)
        start_post_stop(robot)
    told = watchdog_config(robot).to_json()
    os.execve(sys.executable, module_command("canbase_watchdog", "--config-json", told), os.environ | WITHOUT_ROS)


def _refuse_second_watchdog(robot: Robot) -> None:
    """Its end would send stop frames to the robot of the first one."""
    try:
        check("watchdog", bus_name(robot.bus.arguments()))
    except TakenError as error:
        fail(f"watchdog: {error}", FAILED)


def start_post_stop(robot: Robot) -> None:
    """A process that sends the stop frames when this one has ended, however it ends and whoever started it: it waits
    for the end of a pipe whose only writer is this process. Where there is a --stop-file, its supervisor sends them."""
    from canbase_config.derive import watchdog_config

    reads, writes = os.pipe()
    os.set_inheritable(writes, True)  # the watchdog replaces its program; child processes get no descriptors
    subprocess.Popen(
        module_command("canbase_watchdog.post_stop", "-"),
        stdin=reads,
        stdout=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C at the terminal reaches this process, whose end it waits for
        env=os.environ | WITHOUT_ROS,
    )
    os.write(writes, watchdog_config(robot).to_json().encode())
    os.close(reads)


def leave_stop_file(robot: Robot, path: Path | None) -> None:
    """What the stop frames need, for a process that is started when this one has died. Whole or not there at all."""
    if path is None:
        return
    from canbase_config.derive import watchdog_config

    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replaced(path) as file:
            file.write(watchdog_config(robot).to_json().encode())
    except OSError as error:
        fail(f"{path} cannot be written: {error}; without it the drives cannot be stopped after a crash", FAILED)


def _robot_named(config: Path | None, *, bench: bool = False) -> Robot:
    """Of a component, which opens a bus and stays: it means no robot that only happens to be here."""
    path = named(config, bench=bench)
    if path is None and not os.environ.get(VARIABLE):
        fail(_UNNAMED, WRONG_INPUT)
    return load_config(path, quiet=CHILD in os.environ).robot


def add_services(app: typer.Typer) -> None:
    """The commands of SERVICES."""
    ros: dict[str, Any] = {"cls": RosCommand, "options_metavar": ROS_USAGE}
    app.command("driver", **ros)(driver)
    app.command("velocity", **ros)(velocity)
    app.command("action-server", **ros)(action_server)
    app.command("watchdog", cls=RosCommand)(watchdog)
    app.command("sim", cls=RosCommand)(sim)
