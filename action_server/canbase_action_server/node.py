"""The ROS node drive_distance_server: topics in, a timer that ticks the goals, the actions' callbacks, log lines.

Runs in one thread (docs/decisions/0062-one-executor-in-one-thread.md): no callback blocks or awaits, and none can
come between the decision on a goal and its admission. At rest there is no timer, and odometry is kept as it came.
"""

from __future__ import annotations

import json
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from action_msgs.srv import CancelGoal
from canbase.msg import DriverStatus, MuxState, SafetyState
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry as OdometryMessage
from rcl_interfaces.msg import SetParametersResult
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from unique_identifier_msgs.msg import UUID

from canbase_action_server import messages
from canbase_action_server.action_name import action_name
from canbase_action_server.action_servers import second_server
from canbase_action_server.binding import Binding
from canbase_action_server.cancel_rule import NO_UUID, meant
from canbase_action_server.goal import GoalPhase
from canbase_action_server.goal_client import REJECTION_QOS, SERVICE_QOS
from canbase_action_server.goal_queue import Cycle, End, GoalQueue
from canbase_action_server.goal_step import GoalStep
from canbase_action_server.inputs import Inputs
from canbase_action_server.motion import STOP, BaseTwist
from canbase_action_server.open_goal import OpenGoal, goal_numbers, measured_numbers, rejection, uuid_of
from canbase_action_server.outcome import ErrorCode, Status
from canbase_config.robot import Robot
from canbase_runtime.chain_topics import CHAIN, Use
from canbase_runtime.journal import EventLog, Journal
from canbase_runtime.log_budget import LogBudget
from canbase_runtime.log_priority import Priority
from canbase_runtime.message_reader import MessageReader
from canbase_runtime.receive_time import REQUEST_GAP_S, RESENT_S, ReceiveTimes
from canbase_runtime.received import Received
from canbase_runtime.serialized_message import SerializedTwist
from canbase_runtime.sim_time import refuse_sim_time

SENSOR_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
STATUS_QOS = QoSProfile(depth=1)
LATCHED_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
KEEPALIVE_QOS = QoSProfile(depth=100)
"""Deep enough for all goals that may wait."""
OLD = "the goal may be old, because the action server did not run before it; send it again"

TWO_SERVERS = "a goal reaches both; end one of them (of Nav2: take it out of behavior_plugins of behavior_server)"

CANCEL_GOALS = "drive_distance_server/cancel_goals"
"""The service that cancels goals of all actions of this server."""
NOT_CANCELED = CancelGoal.Response(return_code=CancelGoal.Response.ERROR_REJECTED)

OF_REQUESTS = (GoalStep.REJECTED, GoalStep.CANCEL_REQUESTED)
"""Steps that any client causes as often as it likes: their lines have a budget."""

T = TypeVar("T")


class DriveDistanceServer(Node):
    """The action servers, and the publisher of cmd_vel_action."""

    def __init__(self, robot: Robot, bindings: Sequence[Binding]) -> None:
        super().__init__("drive_distance_server")
        refuse_sim_time(self, SetParametersResult)
        self._robot = robot
        self._own_source = robot.mux.action_source
        self._goal_queue = GoalQueue(robot)
        self._event_log = EventLog(self.get_logger(), Journal("drive_distance_server"))
        self._budgets = {step: LogBudget() for step in OF_REQUESTS}
        self._inputs = Inputs()
        self._states = {self.resolve_topic_name(row.topic): row for row in CHAIN if row.use is Use.STATE}
        self._reader = MessageReader()
        self._odometry_waiting: tuple[bytes, float] | None = None
        """The last message of odom that was not looked at yet, serialized, and when it was received."""
        self._request_times = ReceiveTimes(REQUEST_GAP_S, RESENT_S)
        self._keepalive_times = ReceiveTimes(robot.action.client_lease_s)
        """A lease that waited for longer than it is valid is no evidence that the client lives now."""
        self._open: dict[str, OpenGoal] = {}
        self.failure: Exception | None = None
        """The first exception that a callback raised; the process must end with an error."""
        self._serialized = SerializedTwist(robot.base.base_frame)
        self._orders = self.create_publisher(TwistStamped, "cmd_vel_action", 1)
        self._listen(OdometryMessage, "odom", SENSOR_QOS, self._on_odometry, raw=True)
        self._listen(SafetyState, "safety_filter/state", LATCHED_QOS, self._on_safety)
        self._listen(DriverStatus, "motor_driver/status", STATUS_QOS, self._on_driver)
        self._listen(MuxState, "velocity_mux/state", LATCHED_QOS, self._on_mux)
        self._rejections: dict[str, Publisher] = {}
        self._names: dict[str, str] = {}
        """Whole names of the actions, by those of their bindings."""
        self._servers = [self._serve(binding) for binding in bindings]
        self.create_service(CancelGoal, CANCEL_GOALS, self._guarded(self._on_cancel_goals, NOT_CANCELED))
        # The steady clock: setting the computer's time must not stretch a control cycle.
        period_s = 1.0 / robot.action.control_hz
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = self.create_timer(period_s, self._guarded(self._on_timer), clock=steady)

    @property
    def busy(self) -> bool:
        """A goal waits or runs, or its result is not out yet."""
        return self._goal_queue.busy or bool(self._open)

    def shut_down(self) -> None:
        """From now on no goal is accepted, and all that wait or run end with SHUTDOWN."""
        self._inputs = replace(self._inputs, shutdown=True)

    def give_up(self, message: str) -> None:
        """Ends all goals now, whether the base stands or not. For the end of the process."""
        code = ErrorCode.SHUTDOWN if self.failure is None else ErrorCode.INTERNAL
        self._carry_out(self._goal_queue.give_up(code, message, time.monotonic()))

    def order_stop(self) -> None:
        """Zero on cmd_vel_action. Needs no goal and no state."""
        self._order(STOP)

    def fail(self, error: Exception) -> None:
        """A callback raised: stop, end all goals with INTERNAL, and let the process end."""
        self.order_stop()
        self.failure = self.failure or error
        self._goal_queue.fail(error, time.monotonic())
        self.shut_down()
        for line in "".join(traceback.format_exception(error)).splitlines():
            self._event_log.write(line, Priority.ERROR, robot=self._robot.name)

    def look_at_the_clock(self, now_s: float) -> None:
        """Call at least every 0.1 s: a pause of this process is found by it."""
        for times in (self._request_times, self._keepalive_times):
            times.at(now_s)

    def _listen(
        self, kind: type[T], topic: str, qos: QoSProfile, callback: Callable[..., None], raw: bool = False
    ) -> None:
        """`raw`: the callback gets bytes, as `MessageReader.read` takes them."""
        self.create_subscription(kind, topic, self._guarded(callback), qos, raw=raw)

    def _guarded(self, callback: Callable[..., Any], answer: Any = None) -> Callable[..., Any]:
        """A callback whose exception ends every goal, and the process. Without it, one in a callback of an action
        would abort the process at once (rclpy 7.1.6, EventsExecutor). `answer`: what it returns then."""

        def guarded(*args: Any) -> Any:
            try:
                return callback(*args)
            except Exception as error:  # noqa: BLE001  whatever it is, the base must stop first
                self.fail(error)
                return answer

        return guarded

    def _on_odometry(self, serialized: bytes) -> None:
        self._odometry_waiting = serialized, time.monotonic()

    def _newest(self) -> Inputs:
        """What was received, odometry too. To take a message of odom apart costs more than to receive it."""
        if self._odometry_waiting is not None:
            (serialized, received_s), self._odometry_waiting = self._odometry_waiting, None
            message = self._reader.read(serialized, OdometryMessage)
            if message is not None:
                odometry = messages.odometry_in(message, received_s)
                self._inputs = replace(self._inputs, odometry=Received(odometry, received_s))
        return self._inputs

    def _on_safety(self, message: SafetyState) -> None:
        self._inputs = replace(self._inputs, safety=Received(messages.safety_in(message), time.monotonic()))

    def _on_driver(self, message: DriverStatus) -> None:
        self._inputs = replace(self._inputs, driver=Received(messages.driver_in(message), time.monotonic()))

    def _on_mux(self, message: MuxState) -> None:
        now_s, contested = time.monotonic(), messages.contested_in(message, self._states)
        self._inputs = replace(self._inputs, mux=Received(messages.mux_in(message, self._own_source), now_s))
        if contested:  # a second publisher of this topic, which reports none, does not hide it
            self._inputs = replace(self._inputs, contested=Received(contested, now_s))

    def _serve(self, binding: Binding) -> ActionServer:
        name = action_name(binding.name, self.resolve_topic_name, self.resolve_service_name)
        self._names[binding.name] = name
        self._listen(UUID, f"{name}/keepalive", KEEPALIVE_QOS, self._on_keepalive)
        self._rejections[binding.name] = self.create_publisher(DiagnosticStatus, f"{name}/rejection", REJECTION_QOS)
        return ActionServer(
            self,
            binding.type,
            name,
            execute_callback=partial(self._finish, binding),
            goal_callback=self._guarded(partial(self._on_goal, binding), GoalResponse.REJECT),
            handle_accepted_callback=self._guarded(partial(self._on_accepted, binding)),
            cancel_callback=self._guarded(self._on_cancel, CancelResponse.REJECT),
            goal_service_qos_profile=SERVICE_QOS,
            result_service_qos_profile=SERVICE_QOS,
            cancel_service_qos_profile=SERVICE_QOS,
        )

    def _on_keepalive(self, goal_id: UUID) -> None:
        now_s = time.monotonic()
        if not self._keepalive_times.waited(now_s):
            self._goal_queue.keepalive(bytes(goal_id.uuid).hex(), now_s)

    def _on_goal(self, binding: Binding, goal: Any) -> GoalResponse:
        now_s = time.monotonic()
        old = OLD if self._request_times.waited(now_s) else None
        reason = (
            old
            or self._second_server(binding)
            or self._goal_queue.refusal(binding.request(goal), self._newest(), now_s)
        )
        if reason is None:
            return GoalResponse.ACCEPT
        # rclpy does not give the UUID of a goal that is not accepted yet.
        self._log(GoalStep.REJECTED, None, action=binding.name, reason=reason, **goal_numbers(goal))
        self._rejections[binding.name].publish(rejection(binding.name, goal, reason))
        return GoalResponse.REJECT

    def _second_server(self, binding: Binding) -> str | None:
        """Why no goal of this action is accepted: a client's goal reaches both servers, and both would drive."""
        name = self._names[binding.name]
        other = second_server(self, name)
        return f"{other} serves {name} too: {TWO_SERVERS}" if other else None

    def _on_accepted(self, binding: Binding, handle: ServerGoalHandle) -> None:
        goal, now_s, uuid = handle.request, time.monotonic(), uuid_of(handle)
        self._goal_queue.admit(uuid, binding.request(goal), now_s)
        self._open[uuid] = OpenGoal(handle, binding, now_s)
        self._timer.reset()
        self._log(GoalStep.ACCEPTED, uuid, action=binding.name, **goal_numbers(goal))

    def _on_cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        self._log(GoalStep.CANCEL_REQUESTED, uuid_of(handle))
        return CancelResponse.ACCEPT

    def _on_cancel_goals(self, request: CancelGoal.Request, answer: CancelGoal.Response) -> CancelGoal.Response:
        """One request over all actions. Its age does not matter: it stops."""
        wanted = request.goal_info
        uuid, stamp_ns = bytes(wanted.goal_id.uuid).hex(), wanted.stamp.sec * 1_000_000_000 + wanted.stamp.nanosec
        for key in meant({key: goal.accepted_ns for key, goal in self._open.items()}, uuid, stamp_ns):
            if self._open[key].request_cancel():
                self._log(GoalStep.CANCEL_REQUESTED, key)
            answer.goals_canceling.append(self._open[key].info)
        if uuid not in (NO_UUID, *self._open):
            answer.return_code = CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID
        return answer

    def _finish(self, binding: Binding, handle: ServerGoalHandle) -> Any:
        """The execute callback of rclpy, called when a goal has ended: its status is set, its result goes out."""
        try:
            return self._open.pop(uuid_of(handle)).finish()
        except Exception as error:  # noqa: BLE001  rclpy would log it, leave the base moving, and send error code 0: OK
            self.fail(error)
        return binding.defect

    def _on_timer(self) -> None:
        for uuid, goal in self._open.items():
            if goal.handle.is_cancel_requested:
                self._goal_queue.cancel(uuid)
        running, before = self._goal_queue.running, self._goal_queue.phase
        cycle = self._goal_queue.tick(self._newest(), time.monotonic())
        if self._goal_queue.phase is not before:
            self._log_phase(running, before, cycle)
        self._carry_out(cycle)
        if not self.busy and cycle.twist is None:
            self._timer.cancel()  # until the next goal is accepted

    def _carry_out(self, cycle: Cycle) -> None:
        if cycle.twist is not None:
            self._order(cycle.twist)
        if cycle.began is not None:
            self._open[cycle.began].begin(time.monotonic())
            self._log(GoalStep.STARTED, cycle.began)
        for uuid, feedback in cycle.feedback:
            self._open[uuid].tell(feedback)
            if self._open[uuid].log_is_due(time.monotonic()):
                self._log(GoalStep.FEEDBACK, uuid, **self._open[uuid].feedback)
        for end in cycle.ends:
            self._open[end.key].end(end.outcome)
        for end in cycle.ends:
            self._log_end(self._open[end.key], end)

    def _order(self, twist: BaseTwist) -> None:
        stamp = self.get_clock().now().to_msg()
        self._orders.publish(self._serialized.pack(twist.linear_mps, twist.angular_radps, stamp))

    def _log(self, step: GoalStep, uuid: str | None, **fields: Any) -> None:
        budget = self._budgets.get(step)
        omitted = budget.take(time.monotonic()) if budget else 0
        if omitted is None:
            return
        if omitted:
            fields["omitted_lines"] = omitted
        self._write_log(step, uuid, fields, Priority.INFO)

    def _write_log(self, step: GoalStep, uuid: str | None, fields: dict[str, Any], priority: Priority) -> None:
        text = json.dumps({"uuid": uuid, "step": step.value, **fields})
        entry = {name: fields[name] for name in ("status", "error_code", "reason") if name in fields}
        self._event_log.write(text, priority, robot=self._robot.name, goal=uuid, step=step.value, **entry)

    def _log_phase(self, uuid: str | None, before: GoalPhase, cycle: Cycle) -> None:
        if self._goal_queue.phase is GoalPhase.STOPPING:
            goal = self._open.get(uuid or "")
            self._log(GoalStep.STOPPING, uuid, **(goal.feedback if goal else {}))
        elif before is GoalPhase.STOPPING and any(end.key == uuid and end.outcome.stands for end in cycle.ends):
            self._log(GoalStep.STANDSTILL, uuid)

    def _log_end(self, goal: OpenGoal, end: End) -> None:
        """Here and not in `_finish`, which a busy computer may call after the next goal has begun."""
        outcome = end.outcome
        fields = {
            "status": outcome.status.name,
            "error_code": outcome.code.name,
            **measured_numbers(goal.result()),
            "duration_s": round(time.monotonic() - goal.accepted, 3),
            "message": outcome.message,
        }
        priority = Priority.INFO if outcome.status is Status.SUCCEEDED else Priority.NOTICE
        self._write_log(GoalStep.ENDED, end.key, fields, priority)
