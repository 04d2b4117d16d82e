"""`canbase drive`: drive a distance, watch it, cancel it with Ctrl-C. The client is `canbase_action_server.client`."""

from __future__ import annotations

from typing import Annotated, Final

import typer

from canbase_action_server.feedback_watch import FEEDBACK_TIMEOUT_S
from canbase_cli.goal import (
    CancelAfterOption,
    FeedbackTimeoutOption,
    Interrupts,
    JsonOption,
    WaitOption,
    run_goal,
    value_and_unit,
)
from canbase_cli.options import NamespaceOption, right_start, ros_arguments, ros_needed

_UNITS_M: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001}


def distance_m(text: str) -> float:
    """`1.0`, `1m` or `50cm` in metres. Raises typer.BadParameter for other words."""
    value, unit = value_and_unit("DISTANCE", text, tuple(_UNITS_M), "1.0, 1m or 50cm")
    return value * _UNITS_M.get(unit, 1.0)


def drive(
    ctx: typer.Context,
    distance: Annotated[str, typer.Argument(metavar="DISTANCE", help="in m, or 50cm; negative: backward")],
    speed_mps: Annotated[float, typer.Option("--speed", "-s", metavar="SPEED", help="highest speed, m/s")] = 0.2,
    cancel_after_s: CancelAfterOption = None,
    wait_s: WaitOption = 5.0,
    feedback_timeout_s: FeedbackTimeoutOption = FEEDBACK_TIMEOUT_S,
    as_json: JsonOption = False,
    namespace: NamespaceOption = "",
) -> None:
    """Drive DISTANCE metres along the heading of the base, and stop.

    Ctrl-C cancels the goal and waits for standstill; a second Ctrl-C stops waiting.

    Exit codes: 0 succeeded, 1 other failures, 2 wrong command line, 3 canceled, 4 aborted, 5 rejected, 6 the server is
    not found, has ended, or does not answer, 7 canceled because no feedback arrived.
    """
    wanted_m = distance_m(distance)
    with ros_needed():
        import rclpy
        from rclpy.signals import SignalHandlerOptions

        from canbase_action_server.client import DriveClient

    rclpy.init(args=ros_arguments(ctx, namespace), signal_handler_options=SignalHandlerOptions.NO)
    interrupts = Interrupts()
    try:
        with interrupts.caught(), right_start():
            node = rclpy.create_node("canbase_drive", enable_rosout=False)
            client = DriveClient(node, feedback_timeout_s=feedback_timeout_s)
            run_goal(
                lambda show, interrupted: client.send(
                    wanted_m,
                    speed_mps,
                    on_feedback=lambda feedback: show(feedback.traveled_m, feedback.remaining_m),
                    discovery_timeout_s=wait_s,
                    interrupted=interrupted,
                ),
                wanted_m,
                "m",
                cancel_after_s,
                as_json,
                interrupts,
            )
    finally:
        rclpy.try_shutdown()
