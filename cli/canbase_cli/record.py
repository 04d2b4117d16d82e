"""`canbase record --mcap FILE`: every topic of the ROS graph into one file that Foxglove and PlotJuggler open."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from canbase_cli.end_signals import end_signals
from canbase_cli.options import NamespaceOption, ros_arguments, ros_needed
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail

if TYPE_CHECKING:
    from canbase_recording.mcap_file import McapFile

LOOK_S: Final = 1.0
"""Between two looks at the graph for new topics, and two lines of progress."""
TURN_S: Final = 0.2


def record(
    ctx: typer.Context,
    mcap: Annotated[Path, typer.Option("--mcap", metavar="FILE", help="The file to write; it must not exist yet.")],
    seconds: Annotated[
        float | None, typer.Option("--seconds", min=0.1, help="End after this time.", show_default="until Ctrl-C")
    ] = None,
    topics: Annotated[
        list[str] | None,
        typer.Option("--topic", metavar="TOPIC", help="Record this one; repeatable.", show_default="all topics"),
    ] = None,
    namespace: NamespaceOption = "",
) -> None:
    """Record the topics of a running robot as MCAP. For example: canbase record --mcap run.mcap

    Foxglove and PlotJuggler open the file. It has each message as it came, with the definition of its type. Topics
    that appear later are recorded from then on. Hidden topics, those of actions, are recorded when --topic names them.
    Ctrl-C ends the recording; the robot is not affected.

    Exit codes: 0 recorded, 1 nothing was recorded or the file could not be written, 2 wrong command line.
    """
    with ros_needed():
        import rclpy
        from rclpy.signals import SignalHandlerOptions
    try:
        from canbase_recording.mcap_file import McapFile
    except ModuleNotFoundError as error:
        fail(f"canbase record needs the Python package {error.name}: pip install 'mcap>=1.2,<2'", WRONG_INPUT)
    ended = end_signals()
    rclpy.init(args=ros_arguments(ctx, namespace), signal_handler_options=SignalHandlerOptions.NO)
    try:
        file = McapFile(mcap)
        failure = _record(file, topics, seconds, ended)
    except OSError as error:
        fail(f"{mcap} cannot be written: {error.strerror}", WRONG_INPUT)
    finally:
        rclpy.try_shutdown()
    if failure:
        fail(f"{mcap} is not complete, after {file.messages} messages: {failure}", FAILED)
    if file.messages == 0:
        mcap.unlink()
        fail("no message came: is the robot up, and is ROS_DOMAIN_ID the same? ros2 topic list", FAILED)
    end = "\r" if sys.stderr.isatty() else ""
    typer.echo(f"{end}{mcap}: {file.messages} messages of {file.topics} topics, {file.size / 1e6:.1f} MB", err=True)


def _record(file: McapFile, topics: list[str] | None, seconds: float | None, ended: list[int]) -> str:
    """Until a signal, the time or a failure. Returns why the file is not complete; empty: it is."""
    import rclpy
    from rclpy.experimental import EventsExecutor

    from canbase_cli.topic_recorder import TopicRecorder

    node = rclpy.create_node("canbase_record", enable_rosout=False)
    recorder = TopicRecorder(node, file, topics)
    executor = EventsExecutor()
    executor.add_node(node)
    began_s = time.monotonic()
    look_at = 0.0
    try:
        while not ended and not recorder.failure:
            now_s = time.monotonic()
            if seconds is not None and now_s >= began_s + seconds:
                break
            if now_s >= look_at:
                look_at = now_s + LOOK_S
                recorder.look()
                _progress(file, now_s - began_s)
            executor.spin_once(timeout_sec=TURN_S)
        return recorder.failure or file.close()
    finally:
        executor.shutdown()


def _progress(file: McapFile, elapsed_s: float) -> None:
    if sys.stderr.isatty():
        line = f"\r{elapsed_s:6.0f} s  {file.topics} topics  {file.messages} messages  {file.size / 1e6:.1f} MB"
        sys.stderr.write(f"{line}\033[K")
        sys.stderr.flush()
