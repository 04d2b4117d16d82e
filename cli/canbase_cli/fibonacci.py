"""`canbase fibonacci`: an action without a robot, to learn actions with before anything moves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from canbase_cli.goal import CANCELED, NO_SERVER, REJECTED, CancelAfterOption, Interrupts, WaitOption, exit_code
from canbase_cli.options import NamespaceOption, RosCommand, right_start, ros_arguments, ros_needed
from canbase_runtime.terminal import FAILED, fail

if TYPE_CHECKING:
    from canbase_action_server.fibonacci_client import Numbers
    from canbase_action_server.goal_client import SentGoal

app = typer.Typer(help="An action to learn with: serve it, send it a goal. Nothing moves.", no_args_is_help=True)
PeriodOption = Annotated[float, typer.Option("--period", metavar="SECONDS", min=0.01, max=10.0, help="for one number")]


@app.command(cls=RosCommand)
def serve(ctx: typer.Context, period_s: PeriodOption = 1.0, namespace: NamespaceOption = "") -> None:
    """Run the action server `fibonacci` until Ctrl-C."""
    with ros_needed():
        from canbase_action_server.fibonacci_node import run
    with right_start():
        raise typer.Exit(run(ros_arguments(ctx, namespace), period_s))


@app.command(cls=RosCommand)
def send(
    ctx: typer.Context,
    order: Annotated[int, typer.Argument(metavar="ORDER", help="1 to 1000; beyond 46 it ends aborted")],
    cancel_after_s: CancelAfterOption = None,
    wait_s: WaitOption = 5.0,
    namespace: NamespaceOption = "",
) -> None:
    """Send a goal; print its feedback and its result. Ctrl-C cancels it; a second Ctrl-C stops waiting.

    Exit codes: 0 succeeded, 1 the end was not waited for, 2 wrong command line, 3 canceled, 4 aborted, 5 rejected,
    6 no server, or it went away.
    """
    with ros_needed():
        import rclpy
        from rclpy.signals import SignalHandlerOptions

        from canbase_action_server.fibonacci_client import FibonacciClient
        from canbase_action_server.goal_errors import DriveError, InterruptedDriveError, RejectedError
    # rclpy's own handlers would end the context, and the answer to the cancel could not arrive.
    rclpy.init(args=ros_arguments(ctx, namespace), signal_handler_options=SignalHandlerOptions.NO)
    interrupts = Interrupts()
    try:
        with interrupts.caught(), right_start():
            client = FibonacciClient(rclpy.create_node("canbase_fibonacci", enable_rosout=False))
            goal = client.send(
                order,
                on_feedback=lambda numbers: typer.echo(f"feedback: {_words(numbers)}"),
                discovery_timeout_s=wait_s,
                interrupted=lambda: interrupts.count > 0,
            )
            result = _end_of(goal, cancel_after_s, interrupts)
    except RejectedError as error:
        fail(str(error), REJECTED)
    except InterruptedDriveError as error:
        fail(str(error), CANCELED)
    except DriveError as error:
        fail(str(error), NO_SERVER)
    finally:
        rclpy.try_shutdown()
    typer.echo(f"{result.status.name}: {_words(result.sequence)}")
    raise typer.Exit(exit_code(result.status))


def _end_of(goal: SentGoal[Numbers], cancel_after_s: float | None, interrupts: Interrupts) -> Numbers:
    """Its result: of its end, or of the cancel that Ctrl-C or the time requests."""
    typer.echo("accepted: that is no result yet")
    result = goal.wait(cancel_after_s, until=lambda: interrupts.count > 0)
    if result is None:
        seen = interrupts.count
        typer.echo(f"cancel {'accepted' if goal.cancel() else 'not accepted'}: that is no result yet either")
        result = goal.wait(until=lambda: interrupts.count > seen)
    if result is None:
        fail("no longer waiting for the result", FAILED)
    return result


def _words(numbers: tuple[int, ...]) -> str:
    return " ".join(str(number) for number in numbers)
