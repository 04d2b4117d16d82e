"""What `canbase drive` and `canbase rotate` share: send one goal, show it, cancel it with Ctrl-C, report its result."""

from __future__ import annotations

import json
import math
import re
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from canbase_action_server.feedback_watch import MAX_TIMEOUT_S
from canbase_action_server.outcome import Status
from canbase_cli.options import ROS_FLAG, RosCommand
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable
from canbase_runtime.terminal import FAILED, colour, fail, with_cursor

if TYPE_CHECKING:
    from canbase_action_server.goal_client import SentGoal

CANCELED: Final = 3
ABORTED: Final = 4
REJECTED: Final = 5
NO_SERVER: Final = 6
NO_FEEDBACK: Final = 7
CANCEL_PATIENCE_S: Final = 10.0
"""After a cancel the final status has this long to come."""

CancelAfterOption = Annotated[
    float | None,
    typer.Option(
        "--cancel-after",
        metavar="SECONDS",
        min=0.1,
        help="Cancel the goal after this time.",
        show_default="never",
    ),
]
WaitOption = Annotated[
    float, typer.Option("--wait", metavar="SECONDS", min=0.1, help="How long to look for the server.")
]
FeedbackTimeoutOption = Annotated[
    float,
    typer.Option(
        "--feedback-timeout",
        metavar="SECONDS",
        min=0.5,
        max=MAX_TIMEOUT_S,
        help="Cancel the goal after this time without feedback.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as one line of JSON.")]

WITHOUT_SERVER: Final = (
    "without a server nothing is published on cmd_vel_action, and the base stops after the timeout of that source "
    "(mux.sources, 0.3 s by default). If only this computer is cut off, the goal goes on: `canbase stop`"
)

_VALUE: Final = re.compile(r"([-+]?[0-9.]+(?:e[-+]?[0-9]+)?)\s*([a-z°]*)", re.IGNORECASE)
_SIGNED_WITH_UNIT: Final = re.compile(r"-[0-9.]+[a-zA-Z°]+")

Show = Callable[[float, float], None]
"""Called with what is done (signed) and what is left, in the goal's unit."""


def value_and_unit(name: str, text: str, units: Sequence[str], such_as: str) -> tuple[float, str]:
    """`90deg` as 90.0 and deg; without a unit it is empty. Raises typer.BadParameter for other words."""
    match = _VALUE.fullmatch(text.strip())
    with suppress(ValueError):  # 1.2.3
        if match and match[2].lower() in ("", *units) and math.isfinite(value := float(match[1])):
            return value, match[2].lower()
    raise typer.BadParameter(f"{name} is {text!r}, expected a number such as {such_as}")


class GoalCommand(RosCommand):
    """A command whose argument may be negative: `canbase drive -0.5` is no option."""

    ignore_unknown_options = True

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """A negative number with a unit (-90deg) goes behind `--`: its letters would be read as short options."""
        at = args.index(ROS_FLAG) if ROS_FLAG in args else len(args)
        signed = [word for word in args[:at] if _SIGNED_WITH_UNIT.fullmatch(word)]
        behind = ["--", *signed] if signed else []
        return super().parse_args(ctx, [*(word for word in args[:at] if word not in signed), *behind, *args[at:]])


class Interrupts:
    """Ctrl-C as a count instead of an exception: rclpy is never left in the middle of something."""

    def __init__(self) -> None:
        self.count = 0

    @contextmanager
    def caught(self) -> Iterator[None]:
        """While this lasts, SIGINT and SIGTERM are counted."""
        before = {number: signal.signal(number, self._count) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _count(self, _number: int, _frame: FrameType | None) -> None:
        self.count += 1


def run_goal(
    send: Callable[[Show, Callable[[], bool]], SentGoal[Any]],
    way: float,
    unit: str,
    cancel_after_s: float | None,
    as_json: bool,
    interrupts: Interrupts,
) -> None:
    """Send the goal, wait for its end, print it, and exit with its code. `send` gets `Show` and `interrupted`."""
    from canbase_action_server.goal_errors import DriveError, InterruptedDriveError, RejectedError

    def interrupted() -> bool:
        return interrupts.count > 0

    try:
        with _shown(way, unit, as_json) as show:
            result, feedback_lost = _end_of(send(show, interrupted), cancel_after_s, interrupts)
    except RejectedError as error:
        fail(str(error), REJECTED)
    except InterruptedDriveError as error:
        fail(str(error), CANCELED)
    except DriveError as error:
        fail(str(error), NO_SERVER)
    _print_result(result, as_json)
    raise typer.Exit(exit_code(result.status, feedback_lost))


def exit_code(status: Status, feedback_lost: bool = False) -> int:
    """Of a goal that ended: 0 for success alone. `feedback_lost`: this command canceled it for that."""
    canceled = NO_FEEDBACK if feedback_lost else CANCELED
    return {Status.SUCCEEDED: 0, Status.CANCELED: canceled, Status.ABORTED: ABORTED}[status]


def _end_of(goal: SentGoal[Any], cancel_after_s: float | None, interrupts: Interrupts) -> tuple[Any, bool]:
    """Its result, and whether it was canceled because no feedback arrived."""
    from canbase_action_server.goal_errors import FeedbackLostError

    try:
        return goal.wait(cancel_after_s, until=lambda: interrupts.count > 0) or _cancel(goal, interrupts), False
    except FeedbackLostError as error:
        typer.echo(str(error), err=True)
        return _cancel(goal, interrupts, WITHOUT_SERVER), True


def _cancel(goal: SentGoal[Any], interrupts: Interrupts, unanswered: str = "") -> Any:
    """Requests it and waits for the end. `unanswered`: what to add when the server does not answer."""
    from canbase_action_server.goal_errors import NoResponseError

    seen = interrupts.count
    typer.echo("canceling; waiting for standstill", err=True)
    try:
        accepted = goal.cancel()
    except NoResponseError as error:
        fail(f"{error}; {unanswered}" if unanswered else str(error), NO_SERVER)
    if accepted:
        typer.echo("the server accepts the cancel", err=True)
    else:
        typer.echo("the server does not accept the cancel: the goal is about to end", err=True)
    result = goal.wait(CANCEL_PATIENCE_S, until=lambda: interrupts.count > seen)
    if result is None:
        fail("no longer waiting for the result: the base may still move", FAILED)
    return result


@contextmanager
def _shown(way: float, unit: str, quiet: bool) -> Iterator[Show]:
    """A progress bar on a terminal, a line per 10 % elsewhere, nothing when quiet."""
    console = Console(file=with_cursor(sys.stderr))
    if quiet:
        yield lambda done, left: None
    elif console.is_terminal:
        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"))
        with Progress(*columns, TimeElapsedColumn(), console=console) as progress:
            yield _bar(progress, way, unit)
    else:
        yield _lines(way, unit)


def _bar(progress: Progress, way: float, unit: str) -> Show:
    task = progress.add_task(_words(0.0, abs(way), unit), total=abs(way))
    return lambda done, left: progress.update(task, completed=abs(way) - left, description=_words(done, left, unit))


def _lines(way: float, unit: str) -> Show:
    said = [0]

    def show(done: float, left: float) -> None:
        tenths = int(10.0 * (1.0 - left / abs(way)))
        if tenths > said[0]:
            said[0] = tenths
            typer.echo(_words(done, left, unit), err=True)

    return show


def _words(done: float, left: float, unit: str) -> str:
    return f"{done:+.3f} {unit}, {left:.3f} {unit} left"


def _print_result(result: Any, as_json: bool) -> None:
    if as_json:
        values: dict[str, Any] = asdict(result) | {"status": result.status.name, "code": result.code.name}
        typer.echo(json.dumps(values))
        return
    good = result.status is Status.SUCCEEDED
    fg = typer.colors.GREEN if good else typer.colors.YELLOW
    typer.secho(
        f"{result.status.name} ({result.code.name}): {printable(result.message, SENTENCE_LENGTH)}",
        fg=fg,
        color=colour(),
    )
