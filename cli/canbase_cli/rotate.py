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
    value_and_unit,
)
from canbase_cli.options import NamespaceOption, right_start, ros_arguments, ros_needed


def angle_rad(text: str, degrees: bool) -> float:
    """`1.57`, `1.57rad`, `90deg` or `90°` in radians. `degrees`: a bare number is in degrees.

    Raises typer.BadParameter for other words, and for a bare number of radians beyond a full turn: `90` is a slip.
    """
    value, unit = value_and_unit("ANGLE", text, ("rad", "deg", "°"), "1.57, 1.57rad or 90deg")
    unit = unit or ("deg" if degrees else "")
    if not unit and abs(value) > math.tau:
        turns = abs(value) / math.tau
        raise typer.BadParameter(f"ANGLE {text} is {turns:.1f} turns in radians; write {text}deg or {text}rad")
    return value if unit in ("", "rad") else math.radians(value)


def rotate(
    ctx: typer.Context,
    angle: Annotated[
        str, typer.Argument(metavar="ANGLE", help="1.57 or 1.57rad, 90deg; negative: clockwise; may be many turns")
    ],
    speed_radps: Annotated[float, typer.Option("--speed", "-s", metavar="SPEED", help="highest speed, rad/s")] = 0.5,
    degrees: Annotated[bool, typer.Option("--degrees", "-d", help="A number without a unit is in degrees.")] = False,
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
    wanted_rad = angle_rad(angle, degrees)
    with ros_needed():
        import rclpy
        from rclpy.signals import SignalHandlerOptions

        from canbase_action_server.rotate_client import RotateClient

    rclpy.init(args=ros_arguments(ctx, namespace), signal_handler_options=SignalHandlerOptions.NO)
    interrupts = Interrupts()
    try:
        with interrupts.caught(), right_start():
            node = rclpy.create_node("canbase_rotate", enable_rosout=False)
            client = RotateClient(node, feedback_timeout_s=feedback_timeout_s)
            run_goal(
                lambda show, interrupted: client.send(
                    wanted_rad,
                    speed_radps,
                    on_feedback=lambda feedback: show(feedback.turned_rad, feedback.remaining_rad),
                    discovery_timeout_s=wait_s,
                    interrupted=interrupted,
                ),
                wanted_rad,
                "rad",
                cancel_after_s,
                as_json,
                interrupts,
            )
    finally:
        rclpy.try_shutdown()
