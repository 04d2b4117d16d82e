"""`canbase drive`: drive a distance, watch it, cancel it with Ctrl-C. The client is `canbase_action_server.client`."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from canbase_cli.options import FAILED, NamespaceOption, RosCommand, colour, fail, ros_arguments, ros_needed

if TYPE_CHECKING:
    from canbase_action_server.client import Drive, DriveClient, DriveFeedback, DriveResult

CANCELED: Final = 3
ABORTED: Final = 4
REJECTED: Final = 5
NO_SERVER: Final = 6
CANCEL_PATIENCE_S: Final = 10.0
"""After --timeout the final status has this long to come."""


class DriveCommand(RosCommand):
    """A command whose distance may be negative: `canbase drive -0.5` is no option."""

    ignore_unknown_options = True


class Interrupts:
    """Ctrl-C as a count instead of an exception: rclpy is never left in the middle of something."""

    def __init__(self) -> None:
        self.count = 0

    @contextmanager
    def caught(self) -> Iterator[None]:
        """While this lasts, SIGINT and SIGTERM are counted."""
        before = {number: signal.signal(number, self._count) for number in (signal.SIGINT, signal.SIGTERM)}
        yield
        for number, handler in before.items():
            signal.signal(number, handler)

    def _count(self, _number: int, _frame: FrameType | None) -> None:
        self.count += 1


def drive(
    ctx: typer.Context,
    distance_m: Annotated[float, typer.Argument(metavar="DISTANCE", help="in m, negative: backward")],
    speed_mps: Annotated[float, typer.Option("--speed", "-s", metavar="SPEED", help="highest speed, m/s")] = 0.2,
    timeout_s: Annotated[
        float | None, typer.Option("--timeout", metavar="SECONDS", min=0.1, help="then cancel it", show_default="none")
    ] = None,
    wait_s: Annotated[float, typer.Option("--wait", metavar="SECONDS", min=0.1, help="for the server")] = 5.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as one line of JSON.")] = False,
    namespace: NamespaceOption = "",
) -> None:
    """Drive DISTANCE metres along the heading of the base, and stand there.

    Ctrl-C cancels and waits until the base stands; a second Ctrl-C stops waiting.

    Exit codes: 0 succeeded, 2 wrong command line, 3 canceled, 4 aborted, 5 rejected, 6 no server, or it
    went away, or does not answer, 1 anything else.
    """
    with ros_needed():
        import rclpy
        from rclpy.signals import SignalHandlerOptions

        from canbase_action_server.client import DriveClient

    rclpy.init(args=ros_arguments(ctx, namespace), signal_handler_options=SignalHandlerOptions.NO)
    interrupts = Interrupts()
    try:
        with interrupts.caught():
            client = DriveClient(rclpy.create_node("canbase_drive", enable_rosout=False))
            result = _drive(client, distance_m, speed_mps, timeout_s, wait_s, interrupts, as_json)
    finally:
        rclpy.try_shutdown()
    _print_result(result, as_json)
    raise typer.Exit({"SUCCEEDED": 0, "CANCELED": CANCELED, "ABORTED": ABORTED}[result.status.name])


def _drive(
    client: DriveClient,
    distance_m: float,
    speed_mps: float,
    timeout_s: float | None,
    wait_s: float,
    interrupts: Interrupts,
    quiet: bool,
) -> DriveResult:
    from canbase_action_server.client import DriveError, InterruptedDriveError, RejectedError

    try:
        with _shown(distance_m, quiet) as show:
            goal = client.send(
                distance_m,
                speed_mps,
                on_feedback=show,
                discovery_timeout_s=wait_s,
                interrupted=lambda: interrupts.count > 0,
            )
            return goal.wait(timeout_s, until=lambda: interrupts.count > 0) or _cancel(goal, interrupts)
    except RejectedError as error:
        fail(str(error), REJECTED)
    except InterruptedDriveError as error:
        fail(str(error), CANCELED)
    except DriveError as error:
        fail(str(error), NO_SERVER)


def _cancel(goal: Drive, interrupts: Interrupts) -> DriveResult:
    seen = interrupts.count
    typer.echo("canceling; waiting until the base stands", err=True)
    if not goal.cancel():
        typer.echo("the server does not accept the cancel: the goal is about to end", err=True)
    result = goal.wait(CANCEL_PATIENCE_S, until=lambda: interrupts.count > seen)
    if result is None:
        fail("gave up waiting for the final status: the base may still move", FAILED)
    return result


@contextmanager
def _shown(distance_m: float, quiet: bool) -> Iterator[Callable[[DriveFeedback], None]]:
    """What to call with each feedback: a progress bar on a terminal, a line per 10 % elsewhere, nothing when quiet."""
    console = Console(stderr=True)
    if quiet:
        yield lambda feedback: None
    elif console.is_terminal:
        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"))
        with Progress(*columns, TimeElapsedColumn(), console=console) as progress:
            yield _bar(progress, distance_m)
    else:
        yield _lines(distance_m)


def _bar(progress: Progress, distance_m: float) -> Callable[[DriveFeedback], None]:
    task = progress.add_task(f"{0.0:+.3f} m", total=abs(distance_m))

    def show(feedback: DriveFeedback) -> None:
        text = f"{feedback.traveled_m:+.3f} m, {feedback.remaining_m:.3f} m left"
        progress.update(task, completed=abs(distance_m) - feedback.remaining_m, description=text)

    return show


def _lines(distance_m: float) -> Callable[[DriveFeedback], None]:
    said = [0]

    def show(feedback: DriveFeedback) -> None:
        tenths = int(10.0 * (1.0 - feedback.remaining_m / abs(distance_m)))
        if tenths > said[0]:
            said[0] = tenths
            typer.echo(f"{feedback.traveled_m:+.3f} m, {feedback.remaining_m:.3f} m left", err=True)

    return show


def _print_result(result: DriveResult, as_json: bool) -> None:
    if as_json:
        values: dict[str, Any] = asdict(result) | {"status": result.status.name, "code": result.code.name}
        typer.echo(json.dumps(values))
        return
    good = result.status.name == "SUCCEEDED"
    fg = typer.colors.GREEN if good else typer.colors.YELLOW
    typer.secho(f"{result.status.name} ({result.code.name}): {result.message}", fg=fg, color=colour())
