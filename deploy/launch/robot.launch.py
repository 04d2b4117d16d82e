"""A whole robot: watchdog, velocity mux and safety filter, motor driver, action server; on a bench its drives too.

    ros2 launch canbase robot.launch.py config:=robot.yaml

`config` is a robot.yaml or a parameter file of ROS. When one part ends, or launch itself, all end: the base stops.
Services that start at boot and come back are systemd's work: `canbase setup install`.
"""

import os
import signal

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler, Shutdown
from launch.conditions import IfCondition
from launch.event_handlers import OnShutdown
from launch.events import Shutdown as ShutdownEvent
from launch.events import matches_action
from launch.events.process import SignalProcess
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node

END_S = "15"
"""From Ctrl-C to SIGTERM, and to SIGKILL: the driver needs the time of its ramp."""

ARGUMENTS = (
    DeclareLaunchArgument("config", description="robot.yaml, or a parameter file of ROS with its keys"),
    DeclareLaunchArgument("namespace", default_value="", description="of this robot's nodes"),
    DeclareLaunchArgument("autostart", default_value="true", description="false: configure and activate motor_driver"),
    DeclareLaunchArgument("sim", default_value="false", description="true: simulated drives on the robot's bus"),
)


def _part(executable: str, *arguments: object, after: tuple[EmitEvent, ...] = (), **options: object) -> Node:
    """`after`: what follows its end, before all others end."""
    return Node(
        package="canbase",
        executable=executable,
        namespace=LaunchConfiguration("namespace"),
        arguments=["--config", LaunchConfiguration("config"), *arguments],
        output="screen",
        emulate_tty=True,
        sigterm_timeout=END_S,
        sigkill_timeout=END_S,
        additional_env={"CANBASE_PARENT": str(os.getpid())},
        on_exit=[*after, Shutdown(reason=f"{executable} ended")],
        **options,
    )


def _interrupt_all(event: ShutdownEvent, _context: LaunchContext) -> EmitEvent | None:
    """launch leaves it to the terminal to interrupt the parts. One that was interrupted alone would wait END_S."""
    if not event.due_to_sigint:
        return None
    return EmitEvent(event=SignalProcess(signal_number=signal.SIGINT, process_matcher=lambda _process: True))


def generate_launch_description() -> LaunchDescription:
    """The parts, those first that stop the others. Ctrl-C does not end the watchdog: the end of the driver does."""
    autostart = PythonExpression(
        ["'--autostart' if '", LaunchConfiguration("autostart"), "' == 'true' else '--no-autostart'"]
    )
    watchdog = _part("watchdog")
    end_watchdog = EmitEvent(
        event=SignalProcess(signal_number=signal.SIGTERM, process_matcher=matches_action(watchdog))
    )
    return LaunchDescription(
        [
            *ARGUMENTS,
            RegisterEventHandler(OnShutdown(on_shutdown=_interrupt_all)),
            _part("sim", condition=IfCondition(LaunchConfiguration("sim"))),
            watchdog,
            _part("velocity_mux"),
            _part("motor_driver", autostart, after=(end_watchdog,)),
            _part("drive_distance_server"),
        ]
    )
