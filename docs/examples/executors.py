"""An action server to experiment with: how it works, and on which executor of rclpy. Nothing moves. docs/exercises.md.

    python docs/examples/executors.py --executor single --work blocking
    canbase fibonacci send 40        # in another terminal; Ctrl-C after a second

One goal is `order` steps of 0.1 s. Beside it, a timer publishes `heartbeat` ten times a second, as a control cycle
would.
"""

from __future__ import annotations

import argparse
import asyncio
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import rclpy
from canbase.action import Fibonacci
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import CallbackGroup, MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args
from std_msgs.msg import Empty

STEP_S = 0.1
HEARTBEAT_S = 0.1
SLOW_S = 3.0

EXECUTORS: dict[str, Callable[[], Any]] = {
    "single": SingleThreadedExecutor,
    "multi": lambda: MultiThreadedExecutor(num_threads=2),
    "events": EventsExecutor,
}
GROUPS: dict[str, Callable[[], CallbackGroup]] = {
    "exclusive": MutuallyExclusiveCallbackGroup,
    "reentrant": ReentrantCallbackGroup,
}


class Exercise(Node):
    """The server. `group` has all of its callbacks."""

    def __init__(self, work: str, group: CallbackGroup, slow_timer: bool) -> None:
        super().__init__("exercise")
        self._group = group
        self._work = {"blocking": self._blocking, "pausing": self._pausing, "asyncio": self._asyncio}[work]
        self._heartbeat = self.create_publisher(Empty, "heartbeat", 10)
        self.create_timer(HEARTBEAT_S, lambda: self._heartbeat.publish(Empty()), callback_group=group)
        if slow_timer:
            self.create_timer(0.1, lambda: time.sleep(SLOW_S), callback_group=group)
        self._server = ActionServer(
            self,
            Fibonacci,
            "fibonacci",
            execute_callback=self._work,
            cancel_callback=lambda _handle: CancelResponse.ACCEPT,
            callback_group=group,
        )

    def _blocking(self, handle: ServerGoalHandle) -> Fibonacci.Result:
        """Keeps its thread until the goal has ended."""
        for step in range(handle.request.order):
            if handle.is_cancel_requested:
                return self._end(handle, step)
            time.sleep(STEP_S)
            self._report(handle, step)
        return self._end(handle, handle.request.order)

    async def _pausing(self, handle: ServerGoalHandle) -> Fibonacci.Result:
        """Gives its thread back in each pause, by what rclpy can wait for: a future of its own."""
        for step in range(handle.request.order):
            if handle.is_cancel_requested:
                return self._end(handle, step)
            over: Future = Future()
            timer = self.create_timer(STEP_S, partial(over.set_result, None), callback_group=self._group)
            await over
            self.destroy_timer(timer)
            self._report(handle, step)
        return self._end(handle, handle.request.order)

    async def _asyncio(self, handle: ServerGoalHandle) -> Fibonacci.Result:
        """As many examples have it. rclpy has a loop of its own, and asyncio has none here."""
        for step in range(handle.request.order):
            if handle.is_cancel_requested:
                return self._end(handle, step)
            await asyncio.sleep(STEP_S)
            self._report(handle, step)
        return self._end(handle, handle.request.order)

    def _report(self, handle: ServerGoalHandle, step: int) -> None:
        handle.publish_feedback(Fibonacci.Feedback(partial_sequence=[step]))

    def _end(self, handle: ServerGoalHandle, steps: int) -> Fibonacci.Result:
        handle.canceled() if handle.is_cancel_requested else handle.succeed()
        return Fibonacci.Result(sequence=[steps])


def main() -> None:
    """Until Ctrl-C."""
    options = argparse.ArgumentParser()
    options.add_argument("--executor", choices=EXECUTORS, default="single")
    options.add_argument("--work", choices=("blocking", "pausing", "asyncio"), default="blocking")
    options.add_argument("--group", choices=GROUPS, default="exclusive")
    options.add_argument("--slow-timer", action="store_true", help=f"another callback of the group sleeps {SLOW_S} s")
    chosen = options.parse_args(remove_ros_args(sys.argv)[1:])
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # Ctrl-C is Python's KeyboardInterrupt
    executor = EXECUTORS[chosen.executor]()
    executor.add_node(Exercise(chosen.work, GROUPS[chosen.group](), chosen.slow_timer))
    try:
        while True:
            executor.spin_once(timeout_sec=0.1)  # EventsExecutor.spin() of rclpy 7.1 calls nothing (decision 62)
    except KeyboardInterrupt:
        rclpy.shutdown()


if __name__ == "__main__":
    main()
