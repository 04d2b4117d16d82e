"""Services motor_driver/stop, reset and reset_odometry, and the topic set_pose.

No callback waits: a request is handed to the control thread, and its answer is sent when the outcome is there. So a
stop never waits for a reset, a transition or a boot. What gives power or changes the pose is refused when it is old.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.node import Node
from std_srvs.srv import Trigger

from canbase_driver.motion.odometry import Pose2D
from canbase_driver.ros.late_answer import Asked, answer_later
from canbase_driver.ros.messages import pose_of
from canbase_driver.ros.request_age import refusal
from canbase_driver.runtime.control_thread import ControlLoop
from canbase_driver.supervision.fault_reset import RequestOutcome
from canbase_runtime.foreign_text import printable
from canbase_runtime.journal import EventLog, Journal
from canbase_runtime.log_budget import LogBudget
from canbase_runtime.log_priority import Priority
from canbase_runtime.receive_time import ReceiveTimes


def _answered_later(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
    """In place of a callback: `answer_later` takes the requests over."""
    return response


class DriverServices:
    """What `node` offers beside its topics and its lifecycle."""

    def __init__(self, node: Node, loop: ControlLoop, odom_frame: str, request_times: ReceiveTimes) -> None:
        self._loop = loop
        self._node = node
        self._odom_frame = odom_frame
        self._request_times = request_times
        self._budget = LogBudget()
        self._event_log = EventLog(node.get_logger(), Journal("motor_driver"))
        answer_later(node.create_service(Trigger, "motor_driver/stop", _answered_later), self._on_stop)
        self._offer("motor_driver/reset", self._on_reset)
        self._offer("motor_driver/reset_odometry", self._on_reset_odometry)
        node.create_subscription(PoseWithCovarianceStamped, "motor_driver/set_pose", self._on_set_pose, 1)

    def _offer(self, name: str, carry_out: Callable[[Asked], None]) -> None:
        def on_request(asked: Asked) -> None:
            old = refusal(self._request_times.waited(time.monotonic()), asked.sent_s, time.time())
            if old:
                self._answer(asked, RequestOutcome(False, old))
            else:
                carry_out(asked)

        answer_later(self._node.create_service(Trigger, name, _answered_later), on_request)

    def _answer(self, asked: Asked, outcome: RequestOutcome) -> None:
        asked.response.success, asked.response.message = outcome.done, outcome.sentence
        asked.answer()

    def _on_stop(self, asked: Asked) -> None:
        """However old it is, and whatever else is under way. The answer means that the control thread obeys."""
        self._loop.stop(lambda outcome: self._answer(asked, outcome))
        self._event_log.write("stop requested", Priority.WARNING)

    def _on_reset(self, asked: Asked) -> None:
        def end(outcome: RequestOutcome) -> None:
            text = outcome.sentence if outcome.done else f"reset: {outcome.sentence}"
            self._event_log.write(text, Priority.NOTICE)
            self._answer(asked, outcome)

        self._loop.reset(end)

    def _on_reset_odometry(self, asked: Asked) -> None:
        def end(outcome: RequestOutcome) -> None:
            self._tell(outcome)
            self._answer(asked, outcome)

        self._loop.set_pose(Pose2D(), end)

    def _on_set_pose(self, message: PoseWithCovarianceStamped) -> None:
        if self._request_times.waited(time.monotonic()):
            self._node.get_logger().warning(
                "set_pose refused: it may be old, because motor_driver did not run before it", throttle_duration_sec=1.0
            )
        elif message.header.frame_id != self._odom_frame:
            frame = printable(message.header.frame_id)
            why = f"set_pose refused: frame_id is {frame!r}, not {self._odom_frame!r}"
            self._node.get_logger().warning(why, throttle_duration_sec=1.0)
        else:
            self._loop.set_pose(pose_of(message.pose.pose), self._tell_pose)

    def _tell_pose(self, outcome: RequestOutcome) -> None:
        """A topic, which may be flooded."""
        self._node.get_logger().info(outcome.sentence, throttle_duration_sec=1.0)

    def _tell(self, outcome: RequestOutcome) -> None:
        omitted = self._budget.take(time.monotonic())
        if omitted is not None:
            self._node.get_logger().info(outcome.sentence + (f" ({omitted} lines omitted)" if omitted else ""))
