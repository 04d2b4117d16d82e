"""`canbase monitor`: a live picture of a running robot, for a terminal that an operator leaves open. Orders nothing."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

import typer

from canbase_cli.end_signals import end_signals
from canbase_cli.options import NamespaceOption, ros_arguments, ros_needed
from canbase_runtime.foreign_text import clean
from canbase_runtime.terminal import with_cursor

if TYPE_CHECKING:
    from rclpy.node import Node

    from canbase_cli.monitor_picture import Snapshot

REFRESH_S: Final = 0.2
ALL_STOPS: Final = 50


def monitor(ctx: typer.Context, namespace: NamespaceOption = "") -> None:
    """Show a running robot live: the active source, why others do not drive, filter, wheels, watchdog, drives.

    Ctrl-C ends the display; the robot is not affected. If the output is not a terminal, each change is one line.

    Exit codes: 0 ended by Ctrl-C or SIGTERM, 2 wrong command line.
    """
    with ros_needed():
        import rclpy
        from rclpy.signals import SignalHandlerOptions

    ended = end_signals()
    rclpy.init(args=ros_arguments(ctx, namespace), signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node("canbase_monitor", enable_rosout=False)
        with _shown() as show:
            for snapshot in _snapshots(node, namespace, ended):
                show(snapshot)
    finally:
        rclpy.try_shutdown()


@contextmanager
def _shown() -> Iterator[Callable[[Snapshot], None]]:
    """How a snapshot is shown: on a screen of its own, or as a line when something changed."""
    from canbase_cli.monitor_picture import line, picture

    if sys.stdout.isatty():
        from rich.console import Console
        from rich.live import Live

        with Live(console=Console(file=with_cursor(sys.stdout)), screen=True, auto_refresh=False) as live:
            yield lambda snapshot: live.update(picture(snapshot), refresh=True)
        return
    before = ""

    def print_line(snapshot: Snapshot) -> None:
        nonlocal before
        if (text := line(snapshot)) != before:
            before = text
            print(f"{time.strftime('%H:%M:%S')}  {text}", flush=True)

    yield print_line


def _snapshots(node: Node, namespace: str, ended: list[int]) -> Iterator[Snapshot]:
    """One every REFRESH_S until a signal came."""
    import rclpy

    kept = _listen(node)
    while not ended:
        due_s = time.monotonic() + REFRESH_S
        while not ended and (left_s := due_s - time.monotonic()) > 0.0:
            rclpy.spin_once(node, timeout_sec=left_s)
        yield _snapshot(namespace or "/", kept, time.monotonic())


def _listen(node: Node) -> dict[str, tuple[Any, float]]:
    """The newest message of each topic and when it came (time.monotonic), kept up to date while the node spins."""
    from canbase.msg import DriverStatus, MuxState, SafetyState, StopEvent
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    topics = {
        "mux": (MuxState, "velocity_mux/state", latched),
        "safety": (SafetyState, "safety_filter/state", latched),
        "driver": (DriverStatus, "motor_driver/status", newest),
        "event": (StopEvent, "stop_events", QoSProfile(depth=ALL_STOPS)),
    }
    kept: dict[str, tuple[Any, float]] = {}

    def keeper(name: str) -> Callable[[Any], None]:
        return lambda message: kept.update({name: (clean(message), time.monotonic())})

    for name, (kind, topic, qos) in topics.items():
        node.create_subscription(kind, topic, keeper(name), qos)
    return kept


def _snapshot(robot: str, kept: dict[str, tuple[Any, float]], now_s: float) -> Snapshot:
    from canbase_cli.monitor_picture import Snapshot
    from canbase_runtime.last_message import LastMessage

    return Snapshot(robot, **{name: LastMessage(message, now_s - at_s) for name, (message, at_s) in kept.items()})
