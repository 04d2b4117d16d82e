"""`canbase record start`: the last seconds of the black box, or every topic of the ROS graph as MCAP.

This file records topics; record_black_box.py has the other half.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from canbase_cli.end_signals import end_signals
from canbase_cli.options import NamespaceOption, ros_arguments, ros_needed
from canbase_runtime.terminal import FAILED, WRONG_INPUT, fail, with_cursor

if TYPE_CHECKING:
    from canbase_recording.mcap_file import McapFile

LOOK_S: Final = 1.0
"""Between two looks at the graph for new topics, and two lines of progress."""
TURN_S: Final = 0.2


EPILOG: Final = (
    "Examples:  \ncanbase record start              the last seconds, into the folder of the black box  \n"
    "canbase record start --seconds 5 --out turn.asc;  canbase explain turn.asc  \n"
    "canbase record start --mcap run.mcap    every topic until Ctrl-C"
)


def record(
    ctx: typer.Context,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE.asc", help="Copy it there, with its .json; it must not exist yet."),
    ] = None,
    mcap: Annotated[
        Path | None,
        typer.Option("--mcap", metavar="FILE", help="Record the topics instead; the file must not exist yet."),
    ] = None,
    seconds: Annotated[
        float | None,
        typer.Option("--seconds", min=0.1, help="End after this time.", show_default="now; --mcap: until Ctrl-C"),
    ] = None,
    topics: Annotated[
        list[str] | None,
        typer.Option("--topic", metavar="TOPIC", help="With --mcap: this one; repeatable.", show_default="all topics"),
    ] = None,
    namespace: NamespaceOption = "",
) -> None:
    """Record a running robot, also while it drives: the bus with all commands and states, or its topics.

    Without --mcap the motor driver writes what its black box has of the last seconds (black_box.seconds, 10 by
    default), as for a stop: an .asc and a .json file that canbase explain, export and replay read. With --seconds it
    does so after that time, or at Ctrl-C. One recording at a time, at most one in 5 s; the newest black_box.files are
    kept.

    With --mcap each topic is recorded as it comes, until Ctrl-C, for Foxglove and PlotJuggler. Topics that appear later
    are recorded from then on. Hidden topics, those of actions, are recorded when --topic names them.

    The robot is not affected.

    Exit codes: 0 recorded, 1 nothing was recorded or the file could not be written, 2 wrong command line, 6 no motor
    driver.
    """
    if mcap is not None and out is not None:
        fail(
            "--out belongs to a recording of the black box, --mcap to one of the topics: give one of them", WRONG_INPUT
        )
    if mcap is None and topics:
        fail("--topic selects topics: give --mcap FILE too", WRONG_INPUT)
    if mcap is None:
        from canbase_cli.record_black_box import record_black_box

        record_black_box(ctx, seconds, out, namespace)
    else:
        _record_topics(ctx, mcap, seconds, topics, namespace)


def _record_topics(
    ctx: typer.Context, mcap: Path, seconds: float | None, topics: list[str] | None, namespace: str
) -> None:
    arguments = ros_arguments(ctx, namespace)
    with ros_needed():
        import rclpy
        from rclpy.signals import SignalHandlerOptions
    try:
        from canbase_recording.mcap_file import McapFile
    except ModuleNotFoundError as error:
        fail(f"canbase record start needs the Python package {error.name}: pip install 'mcap>=1.2,<2'", WRONG_INPUT)
    ended = end_signals()
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
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
    if sys.stderr.isatty():
        with_cursor(sys.stderr).write("\r")
    typer.echo(f"{mcap}: {file.messages} messages of {file.topics} topics, {file.size / 1e6:.1f} MB", err=True)


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
        with_cursor(sys.stderr).write(f"{line}\033[K")
        with_cursor(sys.stderr).flush()
