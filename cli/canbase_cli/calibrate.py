"""`canbase setup calibrate`: wheel radii and track by squares in both directions, measured with the scanner."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from canbase_cli.goal import CANCELED, NO_SERVER, REJECTED, Interrupts
from canbase_cli.options import ConfigOption, NamespaceOption, RobotFile, one_of, ros_arguments, ros_needed
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail, load_config

if TYPE_CHECKING:
    from canbase_cli.calibration_drive import CalibrationDrive
    from canbase_commissioning.edits import Edit
    from canbase_commissioning.umbmark.squares import Course
    from canbase_config.robot import Robot

EPILOG: Final = (
    "Examples:  \ncanbase setup calibrate --config robot.yaml  \n"
    "canbase setup calibrate --config robot.yaml --side 2 --squares 3 --write"
)


def calibrate(
    ctx: typer.Context,
    file: RobotFile = None,
    config: ConfigOption = None,
    side_m: Annotated[float, typer.Option("--side", metavar="M", min=0.5, max=10.0, help="Side of the squares.")] = 1.5,
    squares: Annotated[int, typer.Option("--squares", metavar="N", min=1, max=20, help="In each direction.")] = 4,
    linear_mps: Annotated[float, typer.Option("--speed", metavar="M/S", min=0.05, max=1.0, help="Along a side.")] = 0.3,
    angular_radps: Annotated[
        float, typer.Option("--turn-speed", metavar="RAD/S", min=0.1, max=2.0, help="At a corner.")
    ] = 0.5,
    write: Annotated[bool, typer.Option("--write", help="Write the new values into it; its comments stay.")] = False,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="The space is free: do not ask. For tests.")] = False,
    namespace: NamespaceOption = "",
) -> None:
    """Measure wheel radii and track: squares to the left and to the right (UMBmark), the scanner sees how far it came.

    The robot has to run (canbase up, or its services), in a room with walls that do not move. It drives by the actions
    drive_distance and rotate_angle, so the safety filter and every stop apply. Ctrl-C stops it, as in canbase drive.
    Without --write nothing changes. It refuses a result that is not certain to 0.2 % (radius) and 0.5 % (track).

    Exit codes: 0 measured, 1 not certain enough or other failures, 2 wrong command line or robot.yaml, 3 interrupted,
    4 a goal failed, 5 a goal was rejected, 6 no action server.
    """
    with ros_needed():
        import rclpy
        from rclpy.signals import SignalHandlerOptions

        from canbase_cli.calibration_drive import CalibrationDrive
        from canbase_commissioning.umbmark.verdict import course_of

    loaded = load_config(one_of(file, config), quiet=True)
    _usable(loaded.robot)
    course = course_of(loaded.robot, side_m, squares)
    typer.echo(
        f"The base drives {squares} squares to the left and {squares} to the right, {side_m:g} m a side: it needs "
        f"{side_m:g} m ahead, to the left and to the right of where it stands, and 0.3 m more around its footprint."
    )
    if not yes:
        typer.confirm("Is this space free, and are you beside the emergency stop?", abort=True)
    rclpy.init(args=ros_arguments(ctx, namespace), signal_handler_options=SignalHandlerOptions.NO)
    interrupts = Interrupts()
    try:
        with interrupts.caught():
            node = rclpy.create_node("canbase_calibrate", enable_rosout=False)
            drive = CalibrationDrive(node, loaded.robot, lambda: interrupts.count > 0)
            _drive(drive, course, linear_mps, angular_radps)
    finally:
        rclpy.try_shutdown()
    _finish(loaded.path, loaded.robot, course, write=write)


def _usable(robot: Robot) -> None:
    if robot.safety.scan.pose == "tf":
        fail(
            "safety.scan.pose is tf: calibrate needs the scanner's pose in robot.yaml (x_m, y_m, yaw_rad)", WRONG_INPUT
        )


def _drive(drive: CalibrationDrive, course: Course, linear_mps: float, angular_radps: float) -> None:
    """Every move of the squares, one line each."""
    from canbase_action_server.goal_errors import DriveError, InterruptedDriveError, RejectedError
    from canbase_cli.calibration_drive import CalibrationStopped
    from canbase_commissioning.umbmark.room_scan import RoomError

    try:
        for move in drive.drive(course, linear_mps, angular_radps):
            typer.echo(f"{len(course.stops)}/{course.moves} {move}; {len(course.stops[-1].points)} beams see the room")
    except CalibrationStopped as stopped:
        fail(printable(str(stopped), SENTENCE_LENGTH), stopped.exit_code)
    except RejectedError as error:
        fail(str(error), REJECTED)
    except InterruptedDriveError as error:
        fail(str(error), CANCELED)
    except DriveError as error:
        fail(str(error), NO_SERVER)
    except RoomError as error:
        fail(f"{error}; nothing is changed", FAILED)


def _finish(config: Path, robot: Robot, course: Course, *, write: bool) -> None:
    """The result, in words and in robot.yaml."""
    from canbase_commissioning.umbmark.verdict import result
    from canbase_commissioning.umbmark.wheel_fit import FitError

    try:
        lines, edits, refused = result(robot, course)
    except FitError as error:
        fail(f"{error}; nothing is changed", FAILED)
    for line in lines:
        typer.echo(line)
    if refused:
        fail(f"{refused}; nothing is changed", FAILED)
    if not edits:
        typer.echo("robot.yaml has these values already")
    elif write:
        _write(config, robot, edits)
    else:
        _show(edits, "would change")
        typer.echo("Nothing is written: --write does, or write these values by hand")


def _show(edits: list[Edit], verb: str) -> None:
    for edit in edits:
        typer.echo(f"{verb} {edit}")


def _write(config: Path, robot: Robot, edits: list[Edit]) -> None:
    from canbase_commissioning.edits import with_edits
    from canbase_commissioning.onbus.robot_file import write_edits
    from canbase_config.commissioned import uncommissioned
    from canbase_config.errors import ConfigError

    try:
        write_edits(config, edits)
    except (OSError, ConfigError, KeyError) as error:
        _show(edits, "to change")
        fail(f"{config} is left as it was; write the values above into it by hand: {error}", FAILED)
    _show(edits, "changed")
    typer.echo("Restart canbase: its parts still run with the old values")
    if uncommissioned(with_edits(robot, edits)):
        typer.echo(
            "The mark of commissioning does not fit to the new values: run canbase setup commission "
            "--steps floor --config "
            f"{config}. Until then safety.uncommissioned_mps limits the speed"
        )
