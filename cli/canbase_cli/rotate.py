"""`canbase rotate`: turn in place, watch it, cancel it with Ctrl-C. Client: `canbase_action_server.rotate_client`."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from canbase_action_server.feedback_watch import FEEDBACK_TIMEOUT_S
from canbase_cli.goal import (
    CancelAfterOption,
    FeedbackTimeoutOption,
    Interrupts,
    JsonOption,
    WaitOption,
    run_goal,
)
from canbase_cli.options import NamespaceOption, right_start, ros_arguments, ros_needed


def rotate(
    ctx: typer.Context,
    angle: Annotated[float, typer.Argument(metavar="ANGLE", help="in rad, negative: clockwise; may be many turns")],
    speed_radps: Annotated[float, typer.Option("--speed", "-s", metavar="SPEED", help="highest speed, rad/s")] = 0.5,
    degrees: Annotated[bool, typer.Option("--degrees", "-d", help="ANGLE is in degrees.")] = False,
    cancel_after_s: CancelAfterOption = None,
    wait_s: WaitOption = 5.0,
    feedback_timeout_s: FeedbackTimeoutOption = FEEDBACK_TIMEOUT_S,
    as_json: JsonOption = False,
    namespace: NamespaceOption = "",
) -> None:
    """Turn in place by ANGLE, counter-clockwise if positive, and stop.

    Ctrl-C cancels the goal and waits for standstill; a second Ctrl-C stops waiting.

    Exit codes: 0 succeeded, 1 other failures, 2 wrong command line, 3 canceled, 4 aborted, 5 rejected, 6 the server is
    not found, has ended, or does not answer, 7 canceled because no feedback arrived.
    """
    with ros_needed():
        import rclpy
        from rclpy.signals import SignalHandlerOptions

        from canbase_action_server.rotate_client import RotateClient

    rclpy.init(args=ros_arguments(ctx, namespace), signal_handler_options=SignalHandlerOptions.NO)
    angle_rad = math.radians(angle) if degrees else angle
    interrupts = Interrupts()
    try:
        with interrupts.caught(), right_start():
            node = rclpy.create_node("canbase_rotate", enable_rosout=False)
            client = RotateClient(node, feedback_timeout_s=feedback_timeout_s)
            run_goal(
                lambda show, interrupted: client.send(
                    angle_rad,
                    speed_radps,
                    on_feedback=lambda feedback: show(feedback.turned_rad, feedback.remaining_rad),
                    discovery_timeout_s=wait_s,
                    interrupted=interrupted,
                ),
                angle_rad,
                "rad",
                cancel_after_s,
                as_json,
                interrupts,
            )
    finally:
        rclpy.try_shutdown()
