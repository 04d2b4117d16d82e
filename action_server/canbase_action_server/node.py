"""The ROS node drive_distance_server: topics in, a timer that ticks the goal, the action's callbacks, log lines.

Runs in one thread (SingleThreadedExecutor, docs/decisions/0003-executor.md): no callback blocks, and none can come
between the acceptance of a goal and its taking of the base.
"""

from __future__ import annotations

import json
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from action_msgs.msg import GoalStatus
from canbase.action import DriveDistance
from canbase.msg import DriverStatus, MuxState, SafetyState
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry as OdometryMessage
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future

from canbase_action_server import messages
from canbase_action_server.goal import Order, Phase
from canbase_action_server.inputs import Inputs
from canbase_action_server.motion import STOP
from canbase_action_server.outcome import ErrorCode, Outcome, Status
from canbase_action_server.owner import Owner
from canbase_config.robot import Robot

SENSOR_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
STATUS_QOS = QoSProfile(depth=1)
LATCHED_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SERVICE_QOS = QoSProfile(depth=100)
"""With the usual depth of 10, of more requests at once the oldest are lost, and their clients wait for ever."""

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Active:
    """The goal that owns the base, as ROS sees it."""

    handle: ServerGoalHandle
    ended: Future
    """Completed by the timer with the outcome."""
    began: float

    @property
    def uuid(self) -> str:
        """Of the goal, in hex."""
        return uuid_of(self.handle)


def uuid_of(handle: ServerGoalHandle) -> str:
    """UUID of a goal in hex."""
    return bytes(handle.goal_id.uuid).hex()


class DriveDistanceServer(Node):
    """Action server drive_distance, and the publisher of cmd_vel_action."""

    def __init__(self, robot: Robot) -> None:
        super().__init__("drive_distance_server")
        self._robot = robot
        self._owner = Owner(robot)
        self._inputs = Inputs()
        self._active: Active | None = None
        self.failure: Exception | None = None
        """The first exception that a callback raised; the process must end with an error."""
        self._orders = self.create_publisher(TwistStamped, "cmd_vel_action", 1)
        self._listen(OdometryMessage, "odom", SENSOR_QOS, self._on_odometry)
        self._listen(SafetyState, "safety_filter/state", LATCHED_QOS, self._on_safety)
        self._listen(DriverStatus, "motor_driver/status", STATUS_QOS, self._on_driver)
        self._listen(MuxState, "velocity_mux/state", LATCHED_QOS, self._on_mux)
        self._server = ActionServer(
            self,
            DriveDistance,
            "drive_distance",
            execute_callback=self._execute,
            goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=self._on_cancel,
            goal_service_qos_profile=SERVICE_QOS,
            result_service_qos_profile=SERVICE_QOS,
            cancel_service_qos_profile=SERVICE_QOS,
        )
        # The steady clock: setting the computer's time must not stretch a control cycle.
        period_s = 1.0 / robot.action.control_hz
        self.create_timer(period_s, self._guarded(self._on_timer), clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def busy(self) -> bool:
        """A goal runs, or its result is not out yet."""
        return self._owner.busy or self._active is not None

    def shut_down(self) -> None:
        """From now on no goal is accepted, and the one that runs stops and ends with SHUTDOWN."""
        self._inputs = replace(self._inputs, shutdown=True)

    def give_up(self, message: str) -> None:
        """Ends the goal now, whether the base stands or not. For the end of the process."""
        code = ErrorCode.SHUTDOWN if self.failure is None else ErrorCode.INTERNAL
        order = self._owner.give_up(code, message, time.monotonic())
        if order is not None:
            self._carry_out(order)

    def order_stop(self) -> None:
        """Zero on cmd_vel_action. Needs no goal and no state."""
        message = messages.twist_out(STOP, self._robot.base.base_frame)
        message.header.stamp = self.get_clock().now().to_msg()
        self._orders.publish(message)

    def fail(self, error: Exception) -> None:
        """A callback raised: stop, end the goal with INTERNAL, and let the process end."""
        self.order_stop()
        self.failure = self.failure or error
        self._owner.fail(error, self._inputs, time.monotonic())
        self.shut_down()
        self.get_logger().fatal("".join(traceback.format_exception(error)))

    def _listen(self, kind: type[T], topic: str, qos: QoSProfile, callback: Callable[[T], None]) -> None:
        self.create_subscription(kind, topic, self._guarded(callback), qos)

    def _guarded(self, callback: Callable[..., None]) -> Callable[..., None]:
        def guarded(*args: Any) -> None:
            try:
                callback(*args)
            except Exception as error:  # noqa: BLE001  whatever it is, the base must stop first
                self.fail(error)

        return guarded

    def _on_odometry(self, message: OdometryMessage) -> None:
        odometry = messages.odometry_in(message, time.monotonic())
        if odometry is not None:
            self._inputs = replace(self._inputs, odometry=odometry)

    def _on_safety(self, message: SafetyState) -> None:
        self._inputs = replace(self._inputs, safety=messages.safety_in(message, time.monotonic()))

    def _on_driver(self, message: DriverStatus) -> None:
        self._inputs = replace(self._inputs, driver=messages.driver_in(message, time.monotonic()))

    def _on_mux(self, message: MuxState) -> None:
        self._inputs = replace(self._inputs, mux=messages.mux_in(message, time.monotonic()))

    def _on_goal(self, goal: DriveDistance.Goal) -> GoalResponse:
        reason = self._owner.refusal(goal.distance_m, goal.max_speed_mps, self._inputs, time.monotonic())
        if reason is None and self._active is None:
            return GoalResponse.ACCEPT
        # rclpy does not tell the UUID of a goal that is not accepted yet.
        wanted = {"distance_m": goal.distance_m, "max_speed_mps": goal.max_speed_mps}
        self._log("rejected", None, reason=reason or "busy: the last goal's result is just going out", **wanted)
        return GoalResponse.REJECT

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        goal, now = handle.request, time.monotonic()
        self._owner.take(goal.distance_m, goal.max_speed_mps, self._inputs, now)
        self._active = Active(handle, Future(), now)
        self._log("accepted", self._active.uuid, distance_m=goal.distance_m, max_speed_mps=goal.max_speed_mps)
        handle.execute()

    def _on_cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        self._log("cancel requested", uuid_of(handle))
        return CancelResponse.ACCEPT

    async def _execute(self, handle: ServerGoalHandle) -> DriveDistance.Result:
        try:
            return await self._run(handle)
        except Exception as error:
            self.fail(error)  # rclpy would log it, abort the goal, and leave the base moving
            raise

    async def _run(self, handle: ServerGoalHandle) -> DriveDistance.Result:
        active = self._active
        if active is None or active.handle is not handle:
            raise RuntimeError(f"goal {uuid_of(handle)} is executed, but does not own the base")
        self._log("started", active.uuid)
        outcome: Outcome = await active.ended
        self._active = None
        self._finish(handle, outcome)
        self._log_end(active, outcome)
        return messages.result_out(outcome)

    @staticmethod
    def _finish(handle: ServerGoalHandle, outcome: Outcome) -> None:
        match outcome.status:
            case Status.SUCCEEDED:
                handle.succeed()
            case Status.CANCELED:
                handle.canceled()
            case Status.ABORTED:
                handle.abort()

    def _on_timer(self) -> None:
        active = self._active
        canceling = active is not None and active.handle.status == GoalStatus.STATUS_CANCELING
        before = self._owner.phase
        order = self._owner.tick(replace(self._inputs, cancel_requested=canceling), time.monotonic())
        if order is not None:
            self._carry_out(order)
        after = self._owner.phase
        if active and before is not after and after is not Phase.ENDED:
            self._log(after.value, active.uuid)

    def _carry_out(self, order: Order) -> None:
        message = messages.twist_out(order.twist, self._robot.base.base_frame)
        message.header.stamp = self.get_clock().now().to_msg()
        self._orders.publish(message)
        if self._active is None:
            return
        if order.feedback is not None:
            self._active.handle.publish_feedback(messages.feedback_out(order.feedback))
        if order.end is not None:
            self._log("standstill", self._active.uuid)
            self._active.ended.set_result(order.end)

    def _log(self, step: str, uuid: str | None, **fields: Any) -> None:
        self.get_logger().info(json.dumps({"uuid": uuid, "step": step, **fields}))

    def _log_end(self, active: Active, outcome: Outcome) -> None:
        self._log(
            "ended",
            active.uuid,
            status=outcome.status.name,
            error_code=outcome.code.name,
            traveled_m=round(outcome.traveled_m, 5),
            overshoot_m=round(outcome.overshoot_m, 5),
            duration_s=round(time.monotonic() - active.began, 3),
            message=outcome.message,
        )
