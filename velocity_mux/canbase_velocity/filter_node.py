"""The ROS node safety_filter: topics, its service and the lease around filter_state.py.

Orders of the mux, scans and estop_state in; cmd_vel, safety_filter/state and leases out; the service
safety_filter/reset. See docs/ros_api.md.
"""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict

from canbase.msg import SafetyState
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from canbase_base.latch_file import LatchKeeper
from canbase_base.latch_record import Record
from canbase_config.diagnostics import PERIOD_S as DIAGNOSTICS_PERIOD_S
from canbase_config.robot import Robot
from canbase_config.safety import Scan as ScanConfig
from canbase_config.state_age import STATE_PERIOD_S
from canbase_config.stopping import ramp
from canbase_runtime.journal import EventLog, Journal
from canbase_runtime.log_priority import Priority
from canbase_runtime.receive_time import ReceiveTimes
from canbase_runtime.serialized_message import SerializedTwist
from canbase_runtime.sim_time import refuse_sim_time
from canbase_velocity import messages
from canbase_velocity.changes import DropTeller, changed_order, is_told
from canbase_velocity.decision import Decision
from canbase_velocity.estop import EstopState
from canbase_velocity.filter_diagnostics import diagnostics
from canbase_velocity.filter_state import NOT_LATCHED, SafetyFilter
from canbase_velocity.graph import BUTTON_KIND, SCAN_KIND, publishers
from canbase_velocity.input_ring import Note, filter_entry, forget
from canbase_velocity.lease import lease_datagram
from canbase_velocity.lease_sender import LeaseSender
from canbase_velocity.parameters import Parameters
from canbase_velocity.placement import HeldPlacement, Placement, PlacementError, Transform, placed_by_tf
from canbase_velocity.qos import COMMAND, SCAN, STATE, STATIC_TF, listen_closely
from canbase_velocity.safety_filter import FilterConfig, Inputs
from canbase_velocity.speed_limit import SpeedLimits
from canbase_velocity.steady import next_turn, steady_timer
from canbase_velocity.twist import Twist
from canbase_velocity.unexpected_publishers import UNKNOWN

GRAPH_PERIOD_S = 0.5
OLD = "refused: it may be old, because safety_filter did not run before it; send it again"
MovingSources = Callable[[], Sequence[str]]


class FilterNode(Node):
    """Issues an order on every command, on the emergency stop, and on a timer; each with its lease.

    `moving_sources`: names of all sources that order a velocity now, also without the base; read before a reset.
    """

    def __init__(
        self,
        robot: Robot,
        moving_sources: MovingSources = tuple,
        keeper: LatchKeeper | None = None,
        note: Note = forget,
    ) -> None:
        """`keeper`: of the record of the emergency stop; None: for a test of the node alone. `note`: takes each input
        of the core, and each decision."""
        super().__init__("safety_filter")
        refuse_sim_time(self, SetParametersResult)
        self._robot = robot
        self._event_log = EventLog(self.get_logger(), Journal("safety_filter"))
        self._receive_times = ReceiveTimes()
        self._request_times = ReceiveTimes.of_requests()
        self._moving_sources, self._note = moving_sources, note
        self._keeper = keeper
        self.config = FilterConfig.of(robot)
        self._filter = SafetyFilter(self.config, keeper.found if keeper else None)
        self._noted: tuple[Record | None, str] = None, ""
        self._drops = DropTeller()
        self._transforms: dict[str, Transform] = {}
        self._leases = LeaseSender(robot.lease.socket)
        self._lease_sequence = self._lease_errors_before = 0
        self._decision = self._filter.decide(time.monotonic())
        self._state_due_s = -math.inf
        self._told: Inputs | None = None
        """What the last state was made of."""
        self._stands_from_s = -math.inf
        self._serialized = SerializedTwist(robot.base.base_frame)
        self._commands = self.create_publisher(TwistStamped, "cmd_vel", COMMAND)
        self._states = self.create_publisher(SafetyState, "safety_filter/state", STATE)
        listen_closely(self, Bool, robot.safety.estop.topic, self._on_estop)
        self._watch_scans(robot.safety.scans)
        self.create_service(Trigger, "safety_filter/reset", self._on_reset)
        steady_timer(self, GRAPH_PERIOD_S, self._count_buttons)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        steady_timer(self, DIAGNOSTICS_PERIOD_S, self._diagnose)
        self._timer = steady_timer(self, 1.0 / robot.rates.command_hz, self._tick)
        self._ros_parameters = Parameters(self, robot, self._on_speed_limit, self._refuse)

    def shut_down(self) -> None:
        """Orders zero, with its lease, and publishes that in the state; from here on nothing else is ordered. Called
        several times: one message may be lost.
        """
        now_s = time.monotonic()
        decision = self._filter.shut_down(now_s)
        self._note(*filter_entry("shut_down", now_s, decision))
        self._issue(decision, now_s)

    def end(self) -> bool:
        """The base is at standstill in an orderly end: a free emergency stop leaves nothing behind for the next start.

        Call until it is True: that is on disk. A press that arrives afterwards is recorded all the same.
        """
        self._note("end", time.monotonic())
        self._filter.end()
        self._keep_record()
        return self._keeper is None or self._filter.record_is_on_disk

    @property
    def core(self) -> SafetyFilter:
        """What decides."""
        return self._filter

    @property
    def stands_from_s(self) -> float:
        """When the driver's ramp from the last order to move ends, if zeros follow (time.monotonic)."""
        return self._stands_from_s

    @property
    def estop_free(self) -> bool:
        """No emergency stop holds or waits for its reset, or for a zero."""
        return self._filter.estop is EstopState.FREE

    @property
    def without_scans(self) -> str:
        """Why it has been without usable scans for long; empty: it has not."""
        return self._filter.without_scans

    @property
    def state_text(self) -> str:
        """What it does and why, in words. The detail is left out: its numbers change all the time."""
        return f"{self._decision.action.name} {self._decision.cause.value}"

    def destroy_node(self) -> None:
        """Closes the lease socket with the node."""
        self._leases.close()
        super().destroy_node()

    def _watch_scans(self, scans: Sequence[ScanConfig]) -> None:
        for scan in scans:
            callback = functools.partial(self._on_scan, scan, HeldPlacement())
            self.create_subscription(LaserScan, scan.topic, callback, SCAN)
        steady_timer(self, GRAPH_PERIOD_S, self._check_scan_publishers)
        if any(scan.pose == "tf" for scan in scans):
            if messages.TFMessage is None:
                raise ModuleNotFoundError("a scanner with `pose: tf` needs tf2_msgs; install ros-jazzy-tf2-msgs")
            self.create_subscription(messages.TFMessage, "tf_static", self._on_tf_static, STATIC_TF)

    def obey(self, twist: Twist, now_s: float) -> None:
        """Takes the order of the mux at `now_s` [s, time.monotonic], and issues it as far as it may."""
        received = self._receive_times.at(now_s)
        self._note("obey", now_s, received)
        self._filter.accept_command(twist, received)
        self._timer.reset()  # a mux faster than the timer is not doubled by it
        self._decide(now_s)

    def _on_speed_limit(self, limits: SpeedLimits, how: str) -> None:
        """A change is ordered at once, so the next lease tells the watchdog."""
        now_s, limit = time.monotonic(), limits.effective
        fields = {"linear_mps": f"{limit.linear_mps:g}", "angular_radps": f"{limit.angular_radps:g}"}
        self._event_log.write(f"speed limit {limit}, {how}", Priority.NOTICE, robot=self._robot.name, **fields)
        self._note("speed_limit", now_s, limit.linear_mps, limit.angular_radps, limits.by)
        self._filter.on_speed_limit(limit, limits.by)
        self._decide(now_s)

    def _refuse(self, why: str) -> None:
        self._event_log.write(why, Priority.WARNING, robot=self._robot.name)

    def _on_estop(self, message: Bool) -> None:
        now_s = time.monotonic()
        received = self._receive_times.at(now_s)
        self._note("estop", now_s, message.data, received)
        self._filter.on_estop(message.data, received)
        if message.data:
            self._decide(now_s)

    def _count_buttons(self) -> None:
        before, topic = self._filter.estop_crowd, self.resolve_topic_name(self._robot.safety.estop.topic)
        on_topic = publishers(self, topic)
        other = (each for each in on_topic if each.kind != BUTTON_KIND)
        unheard = (f"{each.node or UNKNOWN} publishes it as {each.kind}, which is not received" for each in other)
        count, why = sum(each.kind == BUTTON_KIND for each in on_topic), next(unheard, "")
        self._note("buttons", time.monotonic(), count, why)
        self._filter.on_estop_publishers(count, why)
        crowd = self._filter.estop_crowd
        if crowd and crowd != before:
            self._event_log.write(crowd, Priority.ERROR, robot=self._robot.name)

    def _on_scan(self, config: ScanConfig, held: HeldPlacement, message: LaserScan) -> None:
        now_s, wall_s = time.monotonic(), time.time()
        if self._receive_times.waited(now_s):
            return
        try:
            if config.pose == "tf":
                frame, base_frame = message.header.frame_id.lstrip("/"), self._robot.base.base_frame
                placement = held.hold(frame, placed_by_tf(frame, base_frame, self._transforms))
            else:
                placement = Placement.of(config)
        except PlacementError as error:
            self._note("unplaced", now_s, config.topic, str(error))
            self._filter.on_unplaced_scan(config.topic, str(error))
            return
        scan = messages.scan_of(message)
        self._note("scan", now_s, config.topic, scan, placement if config.pose == "tf" else None, wall_s)
        self._filter.on_laser_scan(config.topic, scan, placement, now_s, wall_s)

    def _check_scan_publishers(self) -> None:
        """Into the ROS graph: a message does not contain its publisher."""
        now_s = time.monotonic()
        for scan in self._robot.safety.scans:
            there = publishers(self, self.resolve_topic_name(scan.topic))
            scanners = [each for each in there if each.kind == SCAN_KIND]
            nodes, keys = [each.node or "a node without a name" for each in scanners], [each.key for each in scanners]
            self._note("scanners", now_s, scan.topic, nodes, keys)
            self._filter.on_scan_publishers(scan.topic, nodes, keys, now_s)

    def _on_tf_static(self, message: messages.TFMessage) -> None:
        self._transforms.update(messages.transforms_of(message))

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        now_s = time.monotonic()
        if self._request_times.waited(now_s):  # the caller may have given up, and be near the base
            response.success, response.message = False, OLD
        else:
            moving = list(self._moving_sources())
            self._note("reset", now_s, moving)
            response.success, response.message = self._filter.reset(moving, now_s)
        if response.message != NOT_LATCHED:  # `canbase reset` calls it in any case
            self._event_log.write(f"reset: {response.message}", Priority.NOTICE, robot=self._robot.name)
        return response

    def _tick(self) -> None:
        """Nothing was issued for a period: decides again, for ages have grown and scans have come."""
        now_s = time.monotonic()
        self._receive_times.at(now_s)
        self._decide(now_s)

    def _decide(self, now_s: float) -> None:
        decision = self._filter.decide(now_s)
        self._note(*filter_entry("decide", now_s, decision))
        self._issue(decision, now_s)

    def _issue(self, decision: Decision, now_s: float) -> None:
        """The lease goes first: the watchdog knows what is allowed before a wheel can move."""
        self._request_times.at(now_s)
        self._send_lease(decision)
        stamp = self.get_clock().now().to_msg()
        twist = decision.twist
        self._commands.publish(self._serialized.pack(twist.linear_mps, twist.angular_radps, stamp))
        if not twist.is_zero:
            self._stands_from_s = now_s + ramp(self._robot.limits, twist.linear_mps, twist.angular_radps).time_s
        self._tell(decision, now_s)
        self._decision = decision
        self._keep_record()

    def _keep_record(self) -> None:
        """After the order is out; the writer's defect is this process's."""
        if self._keeper is None:
            return
        if self._keeper.failure is not None:
            raise self._keeper.failure
        record = self._keeper.written, self._keeper.problem
        if record != self._noted:
            self._noted = record
            self._note("record", time.monotonic(), record[0] and asdict(record[0]), record[1])
        self._filter.on_record(*record)
        self._keeper.want(self._filter.record)

    def _diagnose(self) -> None:
        """Once a second, for people and aggregators. The core is not queried here: that would move its motion on, and
        a recording knows of decisions alone."""
        errors = self._leases.errors
        new, self._lease_errors_before = errors - self._lease_errors_before, errors
        if self._told is not None:
            stamp = self.get_clock().now().to_msg()
            self._diagnostics.publish(diagnostics(self._decision, self._told, self._robot.name, errors, new, stamp))

    def _send_lease(self, decision: Decision) -> None:
        self._lease_sequence += 1
        now_ns = time.monotonic_ns()
        lease = lease_datagram(self._lease_sequence, now_ns, decision.twist, brakes_hard=decision.emergency)
        report = self._leases.send(lease, now_ns * 1e-9)
        if report is not None:
            self._event_log.write(report, Priority.WARNING, robot=self._robot.name)

    def _tell(self, decision: Decision, now_s: float) -> None:
        before = self._decision
        if is_told(before, decision):
            sentence, priority, fields = changed_order(decision)
            self._event_log.write(sentence, priority, robot=self._robot.name, **fields)
        changed = decision.essence != before.essence
        if not changed and now_s < self._state_due_s:
            return
        inputs = self._told = self._filter.inputs(now_s)
        for sentence, priority, fields in self._drops.news(inputs.scans, now_s):
            self._event_log.write(sentence, priority, robot=self._robot.name, **fields)
        message = messages.safety_state(
            decision, inputs, self._filter.clearances(now_s), self.get_clock().now().to_msg()
        )
        message.lease_sequence, message.lease_errors = self._lease_sequence, self._leases.errors
        self._states.publish(message)
        self._state_due_s = next_turn(self._state_due_s, now_s, STATE_PERIOD_S)
