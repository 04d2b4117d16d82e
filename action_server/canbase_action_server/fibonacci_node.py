"""The action server of Fibonacci.action: an example as small as it can be that does what a server has to.

It rejects invalid numbers, reports its progress, can be canceled between two numbers, and ends in each of the ways
that there are. Goals share nothing, so several may run at once: that policy fits here, and never fits a robot's base.
"""

from __future__ import annotations

from typing import Any

import rclpy
from canbase.action import Fibonacci
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future

from canbase_action_server.action_name import action_name
from canbase_action_server.fibonacci import next_number, refusal
from canbase_action_server.goal_client import REJECTION_QOS
from canbase_action_server.open_goal import rejection


class FibonacciServer(Node):
    """Serves `fibonacci`, one number every `period_s` [s]."""

    def __init__(self, period_s: float) -> None:
        super().__init__("fibonacci_action_server")
        self._period_s = period_s
        name = action_name("fibonacci", self.resolve_topic_name, self.resolve_service_name)
        self._rejections = self.create_publisher(DiagnosticStatus, f"{name}/rejection", REJECTION_QOS)
        self._server = ActionServer(
            self,
            Fibonacci,
            name,
            execute_callback=self._execute,
            goal_callback=self._on_goal,
            cancel_callback=self._on_cancel,
        )

    def _on_goal(self, goal: Fibonacci.Goal) -> GoalResponse:
        reason = refusal(goal.order)
        self.get_logger().info(f"order {goal.order}: {reason or 'accepted'}")
        if reason is None:
            return GoalResponse.ACCEPT
        self._rejections.publish(rejection("fibonacci", goal, reason))  # a rejection itself has none
        return GoalResponse.REJECT

    def _on_cancel(self, _handle: ServerGoalHandle) -> CancelResponse:
        self.get_logger().info("cancel requested")
        return CancelResponse.ACCEPT

    async def _execute(self, handle: ServerGoalHandle) -> Fibonacci.Result:
        sequence = [0, 1]
        for _ in range(1, handle.request.order):
            handle.publish_feedback(Fibonacci.Feedback(partial_sequence=sequence))
            await self._pause()
            number = next_number(sequence)
            if handle.is_cancel_requested or number is None:
                break
            sequence.append(number)
        return self._end(handle, sequence)

    def _end(self, handle: ServerGoalHandle, sequence: list[int]) -> Fibonacci.Result:
        """Every way out sets a status and returns a result."""
        whole = len(sequence) == handle.request.order + 1
        if whole:
            handle.succeed()
        elif handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.abort()
        self.get_logger().info(f"{'all' if whole else 'only'} {len(sequence)} numbers")
        return Fibonacci.Result(sequence=sequence)

    async def _pause(self) -> None:
        """One period, in which this executor serves others. asyncio.sleep would not work: rclpy has its own loop."""
        over: Future = Future()
        timer = self.create_timer(self._period_s, lambda: over.set_result(None))
        await over
        self.destroy_timer(timer)


def run(ros_args: list[str], period_s: float) -> int:
    """Serve until Ctrl-C; 0."""
    rclpy.init(args=ros_args)
    executor: Any = SingleThreadedExecutor()
    node = FibonacciServer(period_s)
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0
