"""`canbase stop` and `canbase reset`: call a service of the motor driver and tell its answer."""

from __future__ import annotations

import time
from typing import Annotated, Final

import typer

from canbase_cli.options import FAILED, NamespaceOption, colour, fail, ros_arguments, ros_needed

NO_DRIVER: Final = 6
ANSWER_S: Final = 16.0
"""A reset may have to boot the drives first."""
SLICE_S: Final = 0.1
"""Ctrl-C is heard after this at the latest."""
WaitOption = Annotated[float, typer.Option("--wait", metavar="SECONDS", min=0.1, help="for the motor driver")]


def stop(ctx: typer.Context, wait_s: WaitOption = 5.0, namespace: NamespaceOption = "") -> None:
    """Stop the robot: ramp to a stand, power off, and stay there until `canbase reset`.

    Not an emergency stop: that is a button that cuts the power (STO).

    Exit codes: 0 done, 1 refused, 2 wrong command line, 6 no motor driver.
    """
    _call("motor_driver/stop", ros_arguments(ctx, namespace), wait_s)


def reset(ctx: typer.Context, wait_s: WaitOption = 5.0, namespace: NamespaceOption = "") -> None:
    """Let the drives have power again after a latched stop; nothing moves by it.

    Refused while any source orders a velocity, or while the cause of the stop persists.

    Exit codes: 0 done, 1 refused, 2 wrong command line, 6 no motor driver.
    """
    _call("motor_driver/reset", ros_arguments(ctx, namespace), wait_s)


def _call(service: str, ros_args: list[str], wait_s: float) -> None:
    with ros_needed():
        import rclpy
        from rclpy.signals import SignalHandlerOptions
        from std_srvs.srv import Trigger

    rclpy.init(args=ros_args, signal_handler_options=SignalHandlerOptions.NO)  # Ctrl-C ends it as any command
    try:
        node = rclpy.create_node("canbase_trigger", enable_rosout=False)
        client = node.create_client(Trigger, service)
        if not client.wait_for_service(wait_s):
            fail(f"no motor driver offers {client.srv_name}; is it running (canbase up), in this namespace?", NO_DRIVER)
        future, deadline = client.call_async(Trigger.Request()), time.monotonic() + ANSWER_S
        while not future.done() and time.monotonic() < deadline:
            rclpy.spin_once(node, timeout_sec=SLICE_S)
        answer = future.result() if future.done() else None
    finally:
        rclpy.try_shutdown()
    if answer is None:
        fail(f"{service} did not answer within {ANSWER_S:.0f} s; look at the driver's log", FAILED)
    if not answer.success:
        fail(str(answer.message), FAILED)
    typer.secho(answer.message, fg=typer.colors.GREEN, color=colour())
