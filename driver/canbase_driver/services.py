"""The services motor_driver/reset and motor_driver/stop, on a node and a thread of their own.

A reset takes up to seconds: it answers when it is done, not when it begins. rclpy cannot await inside a service of its
events executor, and the main thread must not wait, since commands arrive there.
"""

from __future__ import annotations

import threading

from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

from canbase_driver.loop import ControlLoop


class DriverServices(threading.Thread):
    """Answers the two services until ROS is shut down."""

    def __init__(self, loop: ControlLoop) -> None:
        super().__init__(name="services", daemon=True)
        self._loop = loop
        self._node = Node("motor_driver_services")
        self._node.create_service(Trigger, "motor_driver/reset", self._on_reset)
        self._node.create_service(Trigger, "motor_driver/stop", self._on_stop)
        self.failure: BaseException | None = None

    def run(self) -> None:
        """The thread's body."""
        executor = SingleThreadedExecutor()
        executor.add_node(self._node)
        try:
            executor.spin()
        except ExternalShutdownException:
            return
        except BaseException as error:  # noqa: BLE001 - main sees it, stops the robot and ends the process
            self.failure = error

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        outcome = self._loop.reset()
        response.success, response.message = outcome.done, outcome.sentence
        self._node.get_logger().info(f"reset: {outcome.sentence}")
        return response

    def _on_stop(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._loop.request_stop()
        response.success, response.message = True, "stopping; nothing moves until motor_driver/reset"
        self._node.get_logger().warning("stop requested")
        return response
