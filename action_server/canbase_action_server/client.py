"""A client of drive_distance for applications: tells discovery, acceptance, feedback, cancel and final status apart.

A goal is sent once. When its result is lost it may still have run: nothing here sends it again.

    drive = DriveClient(node).send(1.0, 0.2)      # raises NoServerError, NoResponseError, RejectedError
    result = drive.wait()                         # read result.status first
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from canbase.action import DriveDistance
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node

from canbase_action_server.outcome import ErrorCode, Status

SLICE_S = 0.1
"""Longest time without a look at the deadline, at `interrupted`, and at whether the server is still there."""
SERVER_LOST_S = 2.0
"""A server that cannot be seen for this long is lost."""


class DriveError(Exception):
    """A goal did not come to a result; the subclass says how far it came."""


class NoServerError(DriveError):
    """No action server was found in time; nothing was sent."""


class NoResponseError(DriveError):
    """The server did not say in time whether it accepts the goal. The goal may run: do not send it again blindly."""


class RejectedError(DriveError):
    """The server refuses the goal; its log says why."""


class ServerLostError(DriveError):
    """The server went away during the goal. The result is unknown: do not send the goal again blindly."""


class InterruptedDriveError(DriveError):
    """`interrupted` became true before the goal was accepted. It was canceled if the server accepted it after all."""


@dataclass(frozen=True, slots=True)
class DriveResult:
    """The end of a goal."""

    status: Status
    code: ErrorCode
    traveled_m: float
    overshoot_m: float
    message: str


@dataclass(frozen=True, slots=True)
class DriveFeedback:
    """Where the base is on its way [m]."""

    traveled_m: float
    remaining_m: float


def _never() -> bool:
    return False


class DriveClient:
    """Sends goals from `node`, which nobody else may spin while a method here waits (or give its own `executor`)."""

    def __init__(self, node: Node, executor: Executor | None = None, action: str = "drive_distance") -> None:
        self._client = ActionClient(node, DriveDistance, action)
        self._executor = executor or SingleThreadedExecutor(context=node.context)
        if executor is None:
            self._executor.add_node(node)
        self.action = action

    @property
    def server_ready(self) -> bool:
        """An action server is there now."""
        return bool(self._client.server_is_ready())

    def spin_until(self, done: Callable[[], bool], timeout_s: float | None) -> bool:
        """Handles what arrives until `done()` or the timeout (None: without end); whether it is done."""
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while not done():
            left_s = SLICE_S if deadline is None else deadline - time.monotonic()
            if left_s <= 0.0:
                return False
            self._executor.spin_once(timeout_sec=min(SLICE_S, left_s))
        return True

    def wait_for_server(self, timeout_s: float = 5.0, interrupted: Callable[[], bool] = _never) -> None:
        """Until a server is found. NoServerError after timeout_s [s], InterruptedDriveError before."""
        found = self.spin_until(lambda: self.server_ready or interrupted(), timeout_s)
        if interrupted():
            raise InterruptedDriveError("interrupted; nothing was sent")
        if not found:
            raise NoServerError(
                f"no action server {self.action} within {timeout_s} s; is drive_distance_server running, "
                "in the same ROS_DOMAIN_ID and namespace?"
            )

    def send(
        self,
        distance_m: float,
        max_speed_mps: float,
        *,
        on_feedback: Callable[[DriveFeedback], None] | None = None,
        discovery_timeout_s: float = 5.0,
        response_timeout_s: float = 5.0,
        interrupted: Callable[[], bool] = _never,
    ) -> Drive:
        """Find the server, send the goal once, wait for its acceptance. Raises the subclasses of DriveError."""
        self.wait_for_server(discovery_timeout_s, interrupted)
        goal = DriveDistance.Goal(distance_m=float(distance_m), max_speed_mps=float(max_speed_mps))
        response = self._client.send_goal_async(goal, feedback_callback=_feedback_to(on_feedback))
        if not self.spin_until(response.done, response_timeout_s):
            response.add_done_callback(_cancel_late)
            raise NoResponseError(f"{self.action} did not answer within {response_timeout_s} s; the goal may run")
        handle: ClientGoalHandle = response.result()
        if not handle.accepted:
            raise RejectedError(f"{self.action} rejects the goal; the log of drive_distance_server says why")
        return Drive(self, handle)

    def close(self) -> None:
        """Leaves the action."""
        self._client.destroy()


def _feedback_to(on_feedback: Callable[[DriveFeedback], None] | None) -> Callable[[Any], None] | None:
    if on_feedback is None:
        return None
    told = on_feedback
    return lambda message: told(DriveFeedback(message.feedback.traveled_m, message.feedback.remaining_m))


def _cancel_late(response: Any) -> None:
    """A goal that is accepted after its client gave it up must not run unwatched."""
    handle = response.result()
    if handle is not None and handle.accepted:
        handle.cancel_goal_async()


class Drive:
    """One accepted goal."""

    def __init__(self, client: DriveClient, handle: ClientGoalHandle) -> None:
        self._client = client
        self._handle = handle
        self._result = handle.get_result_async()
        self._seen = time.monotonic()

    @property
    def uuid(self) -> str:
        """In hex, as in the server's log."""
        return bytes(self._handle.goal_id.uuid).hex()

    @property
    def result(self) -> DriveResult | None:
        """None while the goal runs. ServerLostError when the server does not know the goal any more."""
        if not self._result.done():
            return None
        wrapped = self._result.result()
        if wrapped.status not in Status.__members__.values():
            raise ServerLostError("the action server does not know the goal: it was restarted. The result is unknown")
        result = wrapped.result
        status, code = Status(wrapped.status), ErrorCode(result.error_code)
        return DriveResult(status, code, result.traveled_m, result.overshoot_m, result.message)

    def wait(self, timeout_s: float | None = None, until: Callable[[], bool] = _never) -> DriveResult | None:
        """The result; None when timeout_s [s] is over or `until()` before it came: the goal still runs then.

        ServerLostError when the server goes away.
        """
        self._seen = time.monotonic()
        self._client.spin_until(lambda: self._result.done() or until() or self._server_lost(), timeout_s)
        if not self._result.done() and self._server_lost():
            raise ServerLostError("the action server went away; the result is unknown. Look at the base first")
        return self.result

    def cancel(self, timeout_s: float = 5.0) -> bool:
        """Ask for a cancel; whether the server accepts it. The goal ends later: `wait` for its status.

        NoResponseError when the server does not answer within timeout_s [s].
        """
        response = self._handle.cancel_goal_async()
        if not self._client.spin_until(response.done, timeout_s):
            raise NoResponseError(f"no answer to the cancel within {timeout_s} s; the base may still move")
        return bool(response.result().goals_canceling)

    def _server_lost(self) -> bool:
        now = time.monotonic()
        if self._client.server_ready:
            self._seen = now
        return now - self._seen > SERVER_LOST_S
