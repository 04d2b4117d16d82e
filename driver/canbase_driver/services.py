"""Services motor_driver/reset, stop and reset_odometry, set_pose, and the lifecycle, on a thread of their own.

A reset or a transition takes up to seconds: it answers when it is done, not when it begins. rclpy cannot await inside a
service of its events executor, and the main thread must not wait, since commands arrive there.
"""

from __future__ import annotations

import threading

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from std_srvs.srv import Trigger

from canbase_config.journal import Journal, Voice
from canbase_config.priority import Priority
from canbase_driver.loop import ControlLoop
from canbase_driver.managed_node import ManagedNode
from canbase_driver.messages import pose_of
from canbase_driver.odometry import Pose2D


class DriverServices(threading.Thread):
    """Spins the node motor_driver until ROS is shut down."""

    def __init__(self, node: ManagedNode, loop: ControlLoop, odom_frame: str) -> None:
        super().__init__(name="services", daemon=True)
        self._loop = loop
        self._node = node
        self._voice = Voice(node.get_logger(), Journal("motor_driver"))
        self._node.create_service(Trigger, "motor_driver/reset", self._on_reset)
        self._node.create_service(Trigger, "motor_driver/stop", self._on_stop)
        self._odom_frame = odom_frame
        self._node.create_service(Trigger, "motor_driver/reset_odometry", self._on_reset_odometry)
        self._node.create_subscription(PoseWithCovarianceStamped, "motor_driver/set_pose", self._on_set_pose, 1)
        self.failure: BaseException | None = None

    def run(self) -> None:
        """The thread's body."""
        executor = SingleThreadedExecutor()
        executor.add_node(self._node)
        try:
            self._node.start()
            executor.spin()
        except ExternalShutdownException:
            return
        except BaseException as error:  # noqa: BLE001 - main sees it, stops the robot and ends the process
            self.failure = error

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        outcome = self._loop.reset()
        response.success, response.message = outcome.done, outcome.sentence
        self._voice.tell(f"reset: {outcome.sentence}", Priority.NOTICE)
        return response

    def _on_reset_odometry(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = self._set_pose(Pose2D())
        return response

    def _on_set_pose(self, message: PoseWithCovarianceStamped) -> None:
        if message.header.frame_id != self._odom_frame:
            frame = message.header.frame_id
            self._node.get_logger().warning(f"set_pose refused: frame_id is {frame!r}, not {self._odom_frame!r}")
            return
        self._set_pose(pose_of(message.pose.pose))

    def _set_pose(self, pose: Pose2D) -> tuple[bool, str]:
        outcome = self._loop.set_pose(pose)
        self._node.get_logger().info(outcome.sentence)
        return outcome.done, outcome.sentence

    def _on_stop(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._loop.request_stop()
        response.success, response.message = True, "stopping; nothing moves until motor_driver/reset"
        self._voice.tell("stop requested", Priority.WARNING)
        return response
