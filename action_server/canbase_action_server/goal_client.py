"""What the clients of the actions share: discovery, acceptance, feedback, cancel and final status, each with its error.

A goal is sent once. When its result is lost it may still have run: nothing here sends it again. While a goal runs and
its executor spins, it publishes the client lease (action.require_client_lease in robot.yaml).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Generic, TypeVar, cast
from uuid import uuid4

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from unique_identifier_msgs.msg import UUID

from canbase_action_server.action_name import action_name
from canbase_action_server.feedback_watch import FEEDBACK_TIMEOUT_S, FeedbackWatch
from canbase_action_server.goal_errors import (
    FeedbackLostError,
    InterruptedDriveError,
    NoResponseError,
    NoServerError,
    RejectedError,
    ServerLostError,
)
from canbase_action_server.open_goal import exact
from canbase_action_server.outcome import Status
from canbase_action_server.rejection import Reasons
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable

SLICE_S = 0.1
"""Longest time without a look at the deadline, at `interrupted`, and at whether the server is still there."""
SERVER_LOST_S = 2.0
"""A server that cannot be seen for this long is lost."""
KEEPALIVE_S = 0.1
"""Period of the client lease [s]; the shortest lease is three times as long."""
SERVICE_QOS = QoSProfile(depth=100)
"""With the usual depth of 10 a server loses the oldest of more requests at once, and their clients wait for ever.
A client receives the answers to all clients, and loses its own in the same way."""

REJECTION_QOS = QoSProfile(depth=10)
"""Volatile: the reason of an earlier goal with the same numbers is none of this one's."""
REASON_S = 0.5
"""A goal waits this long for the topic of the reasons before it is sent, and its rejection for the reason [s]."""

ResultT = TypeVar("ResultT")
FeedbackT = TypeVar("FeedbackT")


def never() -> bool:
    """Nothing interrupts."""
    return False


class GoalClient(Generic[ResultT, FeedbackT]):
    """Sends goals from a node of its own, which only its methods spin; `node` gives name, namespace and context.

    With `executor` it sends them from `node`, which is in that executor: its methods spin it, and nothing else may.
    """

    def __init__(
        self,
        node: Node,
        kind: type,
        action: str,
        executor: Executor | None,
        read_feedback: Callable[[Any], FeedbackT],
        read_result: Callable[[Status, Any], ResultT],
        feedback_timeout_s: float = FEEDBACK_TIMEOUT_S,
    ) -> None:
        """`feedback_timeout_s`: as `FeedbackWatch` takes it."""
        FeedbackWatch(feedback_timeout_s)  # ValueError now, and not when a goal is sent
        name = action_name(action, node.resolve_topic_name, node.resolve_service_name)
        self._reasons = Reasons()
        self._application = node  # else a node that is created in the call would be destroyed
        self._has_own_node = executor is None
        if executor is None:
            node = _own_node(node, name)
            executor = executor_of(node)
        self._node, self._executor = node, executor
        # Before the client, so that a server that can receive a goal has found this subscription as well.
        self._rejections = node.create_subscription(
            DiagnosticStatus, f"{name}/rejection", self._on_rejection, REJECTION_QOS
        )
        self._client = ActionClient(
            node,
            kind,
            name,
            goal_service_qos_profile=SERVICE_QOS,
            result_service_qos_profile=SERVICE_QOS,
            cancel_service_qos_profile=SERVICE_QOS,
        )
        self._feedback_timeout_s = feedback_timeout_s
        self._read_feedback = read_feedback
        self.read_result = read_result
        self.action = action
        self._alive: list[Any] = []
        self._keepalive = node.create_publisher(UUID, f"{name}/keepalive", 10)
        self._timer = node.create_timer(KEEPALIVE_S, self._tell_alive)

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

    def wait_for_server(self, timeout_s: float = 5.0, interrupted: Callable[[], bool] = never) -> None:
        """Until a server is found. NoServerError after timeout_s [s], InterruptedDriveError before."""
        found = self.spin_until(lambda: self.server_ready or interrupted(), timeout_s)
        if interrupted():
            raise InterruptedDriveError("interrupted; nothing was sent")
        if not found:
            raise NoServerError(
                f"no action server {self.action} within {timeout_s} s; is its server running, "
                "in the same ROS_DOMAIN_ID and namespace?"
            )

    def send_goal(
        self,
        goal: Any,
        on_feedback: Callable[[FeedbackT], None] | None = None,
        discovery_timeout_s: float = 5.0,
        response_timeout_s: float = 5.0,
        interrupted: Callable[[], bool] = never,
    ) -> SentGoal[ResultT]:
        """Find the server, send the goal once, wait for its acceptance. Raises the subclasses of DriveError."""
        self.wait_for_server(discovery_timeout_s, interrupted)
        self.spin_until(lambda: self._rejections.get_publisher_count() > 0 or interrupted(), REASON_S)
        if interrupted():
            raise InterruptedDriveError("interrupted; nothing was sent")
        self._reasons.expect(exact(goal))
        uuid, watch = UUID(uuid=list(uuid4().bytes)), FeedbackWatch(self._feedback_timeout_s)
        response = self._client.send_goal_async(goal, self._feedback_to(watch, on_feedback), uuid)
        self.spin_until(lambda: response.done() or interrupted(), response_timeout_s)
        if not response.done():
            self._give_up(uuid, response)
            if interrupted():
                raise InterruptedDriveError("interrupted before the goal was accepted; its cancel was sent")
            raise NoResponseError(f"{self.action} did not answer within {response_timeout_s} s; its cancel was sent")
        handle: ClientGoalHandle = response.result()
        if not handle.accepted:
            self.spin_until(lambda: self._reasons.found is not None or interrupted(), REASON_S)
            reason = self._reasons.found
            raise RejectedError(self.action, None if reason is None else printable(reason, SENTENCE_LENGTH))
        return SentGoal(self, handle, self._result_of(handle), watch)

    def _on_rejection(self, rejection: DiagnosticStatus) -> None:
        self._reasons.take_rejection([(each.key, each.value) for each in rejection.values], rejection.message)

    def close(self) -> None:
        """Leaves the action."""
        self._node.destroy_timer(self._timer)
        self._node.destroy_publisher(self._keepalive)
        self._node.destroy_subscription(self._rejections)
        self._client.destroy()
        if self._has_own_node:
            self._executor.shutdown()
            self._node.destroy_node()

    def _give_up(self, uuid: UUID, response: Any) -> None:
        """Nothing watches this goal: its cancel is queued at the server behind it, also when this process is gone."""
        ClientGoalHandle(self._client, uuid, None).cancel_goal_async()
        response.add_done_callback(_cancel_late)

    def _result_of(self, handle: ClientGoalHandle) -> Any:
        """The future result. Until it is done, this client publishes its lease."""
        result = handle.get_result_async()
        self._alive.append(handle.goal_id)
        result.add_done_callback(lambda _: self._alive.remove(handle.goal_id))
        self._tell_alive()
        return result

    def _tell_alive(self) -> None:
        for goal_id in self._alive:
            self._keepalive.publish(goal_id)

    def _feedback_to(
        self, watch: FeedbackWatch, on_feedback: Callable[[FeedbackT], None] | None
    ) -> Callable[[Any], None]:
        def received(message: Any) -> None:
            watch.received(time.monotonic())
            if on_feedback is not None:
                on_feedback(self._read_feedback(message.feedback))

        return received


def _own_node(node: Node, action: str) -> Node:
    """The node of one client. `action`: resolved, so that it needs no remapping."""
    return Node(
        f"{node.get_name()}_{action.rpartition('/')[2]}",
        context=node.context,
        namespace=node.get_namespace(),
        use_global_arguments=False,
        enable_rosout=False,
        start_parameter_services=False,
    )


def executor_of(node: Node) -> Executor:
    """An executor for this node alone. It ends with the context: one that outlives it prints an error."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    node.context.on_shutdown(cast("Callable[[], None]", executor.shutdown))
    return executor


def _cancel_late(response: Any) -> None:
    """A goal that is accepted after its client gave it up must not run unwatched."""
    handle = response.result()
    if handle is not None and handle.accepted:
        handle.cancel_goal_async()


class SentGoal(Generic[ResultT]):
    """One accepted goal."""

    def __init__(
        self, client: GoalClient[ResultT, Any], handle: ClientGoalHandle, result: Any, watch: FeedbackWatch
    ) -> None:
        self._client = client
        self._handle = handle
        self._result = result
        self._watch: FeedbackWatch | None = watch
        self._cancel: Any = None
        """The future answer to the last cancel."""
        self._seen = time.monotonic()

    @property
    def uuid(self) -> str:
        """In hex, as in the server's log."""
        return bytes(self._handle.goal_id.uuid).hex()

    @property
    def result(self) -> ResultT | None:
        """None while the goal runs. ServerLostError when the server does not know the goal any more."""
        if not self._result.done():
            return None
        wrapped = self._result.result()
        if wrapped.status not in Status.__members__.values():
            raise ServerLostError("the action server does not know the goal: it was restarted. The result is unknown")
        return self._client.read_result(Status(wrapped.status), wrapped.result)

    def wait(self, timeout_s: float | None = None, until: Callable[[], bool] = never) -> ResultT | None:
        """The result; None when timeout_s [s] is over or `until()` before it came: the goal still runs then.

        ServerLostError when the server goes away. FeedbackLostError, once for a goal, when feedback is missing: the
        goal was canceled then, and `wait` may be called again for its end.
        """
        self._seen = time.monotonic()
        self._client.spin_until(
            lambda: self._result.done() or until() or self._server_lost() or self._feedback_lost(), timeout_s
        )
        if not self._result.done():
            self._raise_lost()
        return self.result

    def cancel(self, timeout_s: float = 5.0) -> bool:
        """Request a cancel. True: the server accepts it. The goal ends later: `wait` for its status.

        NoResponseError when the server does not answer within timeout_s [s].
        """
        self._request_cancel()
        if not self._client.spin_until(self._cancel.done, timeout_s):
            raise NoResponseError(f"no answer to the cancel within {timeout_s} s; the base may still move")
        return bool(self._cancel.result().goals_canceling)

    def _request_cancel(self) -> None:
        """Sends one, unless one is under way or was accepted: a goal that is CANCELING accepts no second one."""
        pending = self._cancel is not None and not self._cancel.done()
        if not pending and not (self._cancel is not None and self._cancel.result().goals_canceling):
            self._cancel = self._handle.cancel_goal_async()

    def _raise_lost(self) -> None:
        if self._server_lost():
            raise ServerLostError("the action server has ended; the result is unknown. Check the base first")
        if self._watch is not None and self._feedback_lost():
            timeout_s, self._watch = self._watch.timeout_s, None
            self._request_cancel()
            raise FeedbackLostError(
                f"no feedback from {self._client.action} for {timeout_s:g} s: its server hangs, has ended or cannot be "
                "reached; its cancel was sent"
            )

    def _feedback_lost(self) -> bool:
        return self._watch is not None and self._watch.missing(time.monotonic())

    def _server_lost(self) -> bool:
        now_s = time.monotonic()
        if self._client.server_ready:
            self._seen = now_s
        return now_s - self._seen > SERVER_LOST_S
