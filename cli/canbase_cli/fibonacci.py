"""`canbase fibonacci`: an action without a robot, to learn actions with before anything moves."""

from __future__ import annotations

from typing import Annotated

import typer

from canbase_cli.goal import NO_SERVER, REJECTED, CancelAfterOption, WaitOption, exit_code
from canbase_cli.options import NamespaceOption, RosCommand, ros_arguments, ros_needed
from canbase_runtime.terminal import fail

app = typer.Typer(help="An action to learn with; nothing moves.", no_args_is_help=True)
PeriodOption = Annotated[float, typer.Option("--period", metavar="SECONDS", min=0.01, max=10.0, help="for one number")]


@app.command(cls=RosCommand)
def serve(ctx: typer.Context, period_s: PeriodOption = 1.0, namespace: NamespaceOption = "") -> None:
    """Run the action server `fibonacci` until Ctrl-C."""
    with ros_needed():
        from canbase_action_server.fibonacci_node import run
    raise typer.Exit(run(ros_arguments(ctx, namespace), period_s))


@app.command(cls=RosCommand)
def send(
    ctx: typer.Context,
    order: Annotated[int, typer.Argument(metavar="ORDER", help="1 to 1000; beyond 46 it ends aborted")],
    cancel_after_s: CancelAfterOption = None,
    wait_s: WaitOption = 5.0,
    namespace: NamespaceOption = "",
) -> None:
    """Send a goal; print its feedback and its result.

    Exit codes: 0 succeeded, 2 wrong command line, 3 canceled, 4 aborted, 5 rejected, 6 no server, or it went away.
    """
    with ros_needed():
        import rclpy

        from canbase_action_server.fibonacci_client import FibonacciClient
        from canbase_action_server.goal_client import DriveError, RejectedError
    rclpy.init(args=ros_arguments(ctx, namespace))
    try:
        client = FibonacciClient(rclpy.create_node("canbase_fibonacci", enable_rosout=False))
        goal = client.send(
            order,
            on_feedback=lambda numbers: typer.echo(f"feedback: {_words(numbers)}"),
            discovery_timeout_s=wait_s,
        )
        typer.echo("accepted: that is no result yet")
        result = goal.wait(cancel_after_s)
        if result is None:
            typer.echo(f"cancel {'accepted' if goal.cancel() else 'not accepted'}: that is no result yet either")
            result = goal.wait()
    except RejectedError as error:
        fail(str(error), REJECTED)
    except DriveError as error:
        fail(str(error), NO_SERVER)
    finally:
        rclpy.try_shutdown()
    if result is None:
        fail("no result", NO_SERVER)
    typer.echo(f"{result.status.name}: {_words(result.sequence)}")
    raise typer.Exit(exit_code(result.status))


def _words(numbers: tuple[int, ...]) -> str:
    return " ".join(str(number) for number in numbers)
