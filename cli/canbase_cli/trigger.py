"""`canbase stop` and `canbase reset`: call services of the robot and print their answers. `cancel.py` too."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from canbase_cli.options import NamespaceOption, ros_arguments, ros_needed
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable
from canbase_runtime.terminal import FAILED, colour, fail

if TYPE_CHECKING:
    from rclpy.node import Node

NO_DRIVER: Final = 6
ANSWER_S: Final = 16.0
"""A reset may have to boot the drives first."""
FILTER_S: Final = 1.0
"""Beside a motor driver that is found, the safety filter is as well within this time, or there is none."""
STATE_S: Final = 1.0
"""motor_driver/status and safety_filter/state come ten times a second."""
STANDSTILL_S: Final = 2.0
"""The action server knows a standstill from odom, the driver from its drives: one may see it a little later."""
SLICE_S: Final = 0.1
"""Ctrl-C takes effect after this at the latest [s]."""
WaitOption = Annotated[
    float, typer.Option("--wait", metavar="SECONDS", min=0.1, help="How long to look for the motor driver.")
]


def stop(ctx: typer.Context, wait_s: WaitOption = 5.0, namespace: NamespaceOption = "") -> None:
    """Stop the robot: ramp to standstill, power off, latched until `canbase reset`.

    This is not an emergency stop. An emergency stop is a button that removes the torque (STO).

    Exit codes: 0 done, 1 refused, 2 wrong command line, 6 no motor driver.
    """
    with Caller(ctx, namespace, wait_s) as caller:
        _tell(caller.call("motor_driver/stop"))


def reset(ctx: typer.Context, wait_s: WaitOption = 5.0, namespace: NamespaceOption = "") -> None:
    """Reset a latched stop, also an emergency stop. The reset itself moves nothing.

    Refused while any source orders a velocity, or while the cause of the stop persists.

    Exit codes: 0 done, 1 refused, 2 wrong command line, 6 no motor driver.
    """
    with Caller(ctx, namespace, wait_s) as caller:
        caller.need_driver("motor_driver/reset")
        if caller.is_offered("safety_filter/reset", FILTER_S):
            held = caller.estop_holds()
            answer = caller.call("safety_filter/reset")
            if held:
                _tell(answer)
                if caller.driver_is_enabled():
                    return
        _tell(caller.call("motor_driver/reset"))


def _tell(sentence: str) -> None:
    typer.secho(sentence, fg=typer.colors.GREEN, color=colour())


class Caller:
    """A node for a few calls. Each failure ends the command with its exit code."""

    def __init__(self, ctx: typer.Context, namespace: str, wait_s: float) -> None:
        self._ros_args = ros_arguments(ctx, namespace)
        self._wait_s = wait_s
        self._node: Node
        self._clients: dict[str, Any] = {}

    def __enter__(self) -> Caller:
        with ros_needed():
            import rclpy
            from rclpy.signals import SignalHandlerOptions

        # Ctrl-C ends it as any command.
        rclpy.init(args=self._ros_args, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("canbase_trigger", enable_rosout=False)
        return self

    def __exit__(self, *_: object) -> None:
        import rclpy

        rclpy.try_shutdown()

    def is_offered(self, service: str, within_s: float) -> bool:
        """Somebody offers the service."""
        return bool(self._client(service).wait_for_service(within_s))

    def need_driver(self, service: str) -> None:
        """Ends the command when its node does not offer the service in time."""
        if not self.is_offered(service, self._wait_s):
            name = self._client(service).srv_name
            node = service.partition("/")[0].replace("_", " ")
            ask = "does it run (canbase up), in this namespace, or does it hang (canbase doctor)?"
            fail(f"no {node} offers {name}; {ask}", NO_DRIVER)

    def call(self, service: str) -> str:
        """The sentence for an answer that reports success."""
        from std_srvs.srv import Trigger

        self.need_driver(service)
        answer = self.answer(Trigger, service, Trigger.Request(), ANSWER_S)
        if answer is None:
            fail(f"{service} did not answer within {ANSWER_S:.0f} s; look at its log", FAILED)
        if not answer.success:
            fail(printable(answer.message, SENTENCE_LENGTH), FAILED)
        return printable(answer.message, SENTENCE_LENGTH)

    def offers(self, kind: Any, service: str) -> bool:
        """Somebody offers the service within the time of `--wait`."""
        return bool(self._client(service, kind).wait_for_service(self._wait_s))

    def answer(self, kind: Any, service: str, request: Any, within_s: float) -> Any:
        """The response; None: it did not come in time."""
        future = self._client(service, kind).call_async(request)
        self._spin_until(future.done, within_s)
        return future.result() if future.done() else None

    def estop_holds(self) -> bool:
        """The emergency stop holds the base, or waits for its reset."""
        from canbase.msg import SafetyState

        state = self._newest(SafetyState, "safety_filter/state")
        return state is not None and bool(state.estop)

    def driver_is_enabled(self) -> bool:
        """The drives have power: they need no reset."""
        from canbase.msg import DriverStatus

        status = self._newest(DriverStatus, "motor_driver/status")
        return status is not None and status.state == DriverStatus.ENABLED

    def is_at_standstill(self) -> bool:
        """By the motor driver, within a moment; False also when it reports nothing."""
        from canbase.msg import DriverStatus

        heard: list[Any] = []
        self._node.create_subscription(DriverStatus, "motor_driver/status", heard.append, 1)
        self._spin_until(lambda: bool(heard) and heard[-1].standstill, STANDSTILL_S)
        return bool(heard) and bool(heard[-1].standstill)

    def _newest(self, kind: Any, topic: str) -> Any:
        """The next message on a topic that is published ten times a second; None: it did not come."""
        heard: list[Any] = []
        self._node.create_subscription(kind, topic, heard.append, 1)
        self._spin_until(lambda: bool(heard), STATE_S)
        return heard[-1] if heard else None

    def _client(self, service: str, kind: Any = None) -> Any:
        """`kind` None: Trigger. One client for each service, as long as the command runs."""
        from std_srvs.srv import Trigger

        if service not in self._clients:
            self._clients[service] = self._node.create_client(kind or Trigger, service)
        return self._clients[service]

    def _spin_until(self, done: Any, within_s: float) -> None:
        import rclpy

        deadline = time.monotonic() + within_s
        while not done() and time.monotonic() < deadline:
            rclpy.spin_once(self._node, timeout_sec=SLICE_S)
