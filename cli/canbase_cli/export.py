"""`canbase record export`: a recording of a CAN bus as ROS messages, for Foxglove and PlotJuggler."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from canbase_cli.explain import ChannelOfFile, RecordingConfig, recorded_robot
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail, warn

EPILOG: Final = "For example: canbase record export stop.asc --config robot.yaml --output stop.mcap"


def export(
    recording: Annotated[
        Path, typer.Argument(metavar="FILE", help="What canbase explain reads: ASC, candump -L, BLF, …")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The file to write; it must not exist yet.")
    ],
    config: RecordingConfig = None,
    channel: ChannelOfFile = None,
) -> None:
    """Write a recording as an MCAP file of ROS messages, which Foxglove and PlotJuggler open.

    It has joint_states (measured) and joint_states_ordered, cmd_vel, the log, and each frame (can_msgs/Frame).
    Without a robot.yaml the joints are called after their nodes, in topics that end in _raw. It needs
    Foxglove's library, and no ROS. `canbase explain` reads the file again.

    Exit codes: 0 written, 1 nothing in the file can be read or the MCAP file is not complete, 2 wrong command line or
    robot.yaml.
    """
    robot, _ = recorded_robot(recording, config)
    try:
        from canbase_recording.mcap_export import export as write
    except ModuleNotFoundError as error:
        fail(f"this needs the Python package {error.name}: pip install 'mcap-ros2-support>=0.5,<1'", WRONG_INPUT)
    from canbase_recording.recording_file import NoRecordingError

    try:
        read, written = write(recording, output, robot, channel)
    except NoRecordingError as error:
        fail(str(error), FAILED)
    except (FileExistsError, FileNotFoundError, NotADirectoryError, PermissionError) as error:
        fail(f"{output} cannot be written: {error.strerror}", WRONG_INPUT)
    except OSError as error:
        fail(f"{output} is not complete: {error.strerror or error}", FAILED)
    for sentence in read.problems.sentences:
        warn(sentence)
    typer.echo(f"{output}: {read.frames} frames, {written.total()} messages of {len(written)} topics", err=True)
