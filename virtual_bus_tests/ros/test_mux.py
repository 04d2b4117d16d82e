"""velocity_mux over DDS: locks, parameter files of twist_mux, publishers of every kind, and those that are foreign."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import rclpy
from canbase.msg import DriverStatus, MuxState
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Twist, TwistStamped
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.clock_type import ClockType
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool

from canbase_config.robot import Robot
from canbase_velocity.filter_node import FilterNode
from canbase_velocity.mux_node import MuxNode
from support.ros_harness import Process, Recorder, TestNode

pytestmark = pytest.mark.ros

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
START_S = 15.0
RUN = """
import sys
from canbase_config.load import load_robot
from canbase_velocity.main import run
sys.exit(run(load_robot({path!r}).robot, []))
"""
FREE: Mapping[str, Any] = {"safety": {"scan": {"required": False}}}
"""Nothing but the mux decides."""


def drive(linear_mps: float) -> TwistStamped:
    message = TwistStamped()
    message.twist.linear.x = linear_mps
    return message


class Velocity:
    """The process and what it says."""

    def __init__(self, node: TestNode, process: Process) -> None:
        self.node, self.process = node, process
        self.orders: Recorder[TwistStamped] = node.record(TwistStamped, "cmd_vel")
        self.states: Recorder[MuxState] = node.record(MuxState, "velocity_mux/state", LATCHED)
        self.driver = node.repeat(DriverStatus, "motor_driver/status", 20.0, owner="motor_driver")
        self.driver.message = DriverStatus(state=DriverStatus.ENABLED)
        self.diagnostics: Recorder[DiagnosticArray] = node.record(DiagnosticArray, "/diagnostics")
        node.wait_for(lambda: self.orders.last is not None and self.states.last is not None, START_S, "cmd_vel")
        node.wait_for(lambda: self.state.ready, START_S, "the driver's state at the mux")

    @property
    def state(self) -> MuxState:
        last = self.states.last
        assert last is not None
        return last

    def source(self, kind: type[Any], topic: str, qos: QoSProfile | int = 1) -> Any:
        """A publisher at 50 Hz that the mux has found; one of velocities has commanded zero."""
        if kind is not Bool:
            return self.node.source(topic, kind, qos)
        repeater = self.node.repeat(kind, topic, 50.0, qos)
        self.node.wait_for_subscriber(repeater.publisher, START_S)
        return repeater

    def wait_for_order(self, linear_mps: float, timeout_s: float = 3.0) -> None:
        def ordered() -> bool:
            last = self.orders.last
            return last is not None and last.twist.linear.x == pytest.approx(linear_mps)

        self.node.wait_for(ordered, timeout_s, f"{linear_mps} m/s on cmd_vel, mux says {self.states.last}")

    def ordered_for(self, duration_s: float) -> set[float]:
        """All that is ordered from now on."""
        self.orders.clear()
        self.node.spin_for(duration_s)
        assert len(self.orders.messages) >= 20 * duration_s  # never silent
        return {message.twist.linear.x for message in self.orders.messages}

    def reasons(self) -> dict[str, str]:
        return {source.name: source.reason for source in self.state.sources}


@pytest.fixture
def start(
    spawn: Callable[..., Process], make_robot: Callable[[Mapping[str, Any]], Path], test_node: TestNode
) -> Callable[[Mapping[str, Any]], Velocity]:
    """start({keys below mux}): the process, talking."""

    def start_velocity(mux: Mapping[str, Any]) -> Velocity:
        return Velocity(test_node, spawn(RUN.format(path=str(make_robot({**FREE, "mux": mux})))))

    return start_velocity


@pytest.fixture
def twist_mux_file(tmp_path: Path) -> Path:
    """A parameter file as a user of twist_mux has it."""
    path = tmp_path / "twist_mux.yaml"
    path.write_text(
        "twist_mux:\n  ros__parameters:\n    use_stamped: false\n"
        "    topics:\n      nav: {topic: nav_vel, timeout: 0.5, priority: 10}\n"
        "      joy: {topic: joy_vel, timeout: 0.3, priority: 100}\n"
        "    locks:\n      pause: {topic: pause_navigation, timeout: 0.0, priority: 100}\n"
        "      e_stop: {topic: e_stop, timeout: 0.5, priority: 255}\n",
        encoding="utf-8",
    )
    return path


def test_the_file_of_a_twist_mux_user_drives_with_its_locks(
    start: Callable[[Mapping[str, Any]], Velocity], twist_mux_file: Path
) -> None:
    own = {"action": {"topic": "cmd_vel_action", "priority": 5, "timeout_s": 0.3}}
    velocity = start({"twist_mux": [str(twist_mux_file)], "sources": own})
    nav, joy = velocity.source(Twist, "nav_vel"), velocity.source(Twist, "joy_vel")
    action = velocity.source(TwistStamped, "cmd_vel_action")
    e_stop, pause = velocity.source(Bool, "e_stop"), velocity.source(Bool, "pause_navigation")
    nav.message = drive(0.2).twist
    assert velocity.ordered_for(0.5) == {0.0}  # e_stop was never heard
    assert velocity.reasons()["nav"] == "locked: e_stop has published nothing yet on e_stop"
    e_stop.message = Bool(data=False)
    assert velocity.ordered_for(0.5) == {0.0}  # nor does it drive off when the lock opens
    velocity.node.release(nav, joy)
    nav.message = drive(0.2).twist
    velocity.wait_for_order(0.2)
    pause.message = Bool(data=True)
    velocity.wait_for_order(0.0)
    assert velocity.ordered_for(0.3) == {0.0}  # said explicitly, and again and again
    joy.message = drive(-0.1).twist
    velocity.wait_for_order(-0.1)
    e_stop.message = None  # its publisher dies
    velocity.wait_for_order(0.0)
    velocity.node.spin_for(0.1)
    assert [(lock.name, lock.holds) for lock in velocity.state.locks] == [("e_stop", True), ("pause", True)]
    assert "has published nothing for" in velocity.reasons()["joy"]
    nav.message = joy.message = None
    e_stop.message, pause.message = Bool(data=False), Bool(data=False)
    velocity.node.release(action)
    action.message = drive(0.3)  # a stamped source beside plain ones
    velocity.wait_for_order(0.3)


@pytest.mark.parametrize("qos", [BEST_EFFORT, QoSProfile(depth=1), LATCHED], ids=["best effort", "reliable", "latched"])
def test_publishers_of_every_quality_of_service_are_heard(
    start: Callable[[Mapping[str, Any]], Velocity], qos: QoSProfile
) -> None:
    lock = {"topic": "pause", "priority": 101}
    velocity = start({"locks": {"pause": lock}})
    joystick, pause = velocity.source(TwistStamped, "cmd_vel_joy", qos), velocity.source(Bool, "pause", qos)
    estop = velocity.source(Bool, "estop_state", qos)
    pause.message = Bool(data=False)
    velocity.node.wait_for(lambda: not velocity.state.locks[0].holds, 2.0, "the lock to open")
    velocity.node.release(joystick)
    joystick.message = drive(0.2)
    velocity.wait_for_order(0.2)
    estop.message = Bool(data=True)
    velocity.wait_for_order(0.0)
    assert velocity.state.active == "joystick"  # the mux passes it on: it is the filter that heard the button
    pause.message = Bool(data=True)
    velocity.node.wait_for(lambda: velocity.state.active == "", 2.0, "the lock")


def test_a_subscriber_that_asks_for_more_than_is_offered_is_told_loudly(
    start: Callable[[Mapping[str, Any]], Velocity],
) -> None:
    velocity = start({})
    velocity.node.record(TwistStamped, "cmd_vel_mux", LATCHED)
    sentence = "a subscriber of cmd_vel_mux receives nothing: it requests another DURABILITY than is offered"

    def told() -> bool:
        return any(sentence in status.message for message in velocity.diagnostics.messages for status in message.status)

    velocity.node.wait_for(told, 5.0, f"{sentence} in {velocity.diagnostics.last}")
    assert sentence in velocity.process.log()


def test_a_foreign_publisher_is_named_in_state_and_diagnostics_and_nothing_else_happens(
    start: Callable[[Mapping[str, Any]], Velocity],
) -> None:
    velocity = start({})
    with TestNode("intruder", namespace="/other") as other:
        other.node.create_publisher(TwistStamped, "/cmd_vel", 1)
        joystick = velocity.source(TwistStamped, "cmd_vel_joy")
        joystick.message = drive(0.2)
        velocity.node.wait_for(lambda: velocity.state.foreign, 5.0, "a foreign publisher")
        (foreign,) = velocity.state.foreign
        assert (foreign.topic, foreign.node, foreign.locks) == ("/cmd_vel", "/other/intruder", False)
        assert foreign.problem == "only /safety_filter should"
        velocity.wait_for_order(0.2)

        def warned() -> bool:
            return any(
                status.level == DiagnosticStatus.WARN and "/other/intruder publishes on /cmd_vel" in status.message
                for message in velocity.diagnostics.messages
                for status in message.status
            )

        velocity.node.wait_for(warned, 3.0, "a warning in /diagnostics")
    velocity.node.wait_for(lambda: not velocity.state.foreign, 5.0, "the end of it")


def test_a_foreign_publisher_locks_its_source_when_the_configuration_says_so(
    start: Callable[[Mapping[str, Any]], Velocity],
) -> None:
    velocity = start({"foreign_publishers": "lock"})
    action = velocity.source(TwistStamped, "cmd_vel_action")  # test_node is not drive_distance_server
    joystick = velocity.source(TwistStamped, "cmd_vel_joy")
    action.message = drive(0.2)
    velocity.node.wait_for(lambda: velocity.state.foreign, 5.0, "a foreign publisher")
    velocity.wait_for_order(0.0)
    assert velocity.reasons()["action"] == (
        "locked: /test_node publishes on /cmd_vel_action: only /drive_distance_server should"
    )
    joystick.message = drive(0.1)
    velocity.wait_for_order(0.1)

    def on_the_output() -> bool:
        return any(foreign.topic == "/cmd_vel" for foreign in velocity.state.foreign)

    with TestNode("intruder") as other:
        other.node.create_publisher(TwistStamped, "cmd_vel", 1)
        velocity.node.wait_for(on_the_output, 5.0, "the intruder")
        velocity.wait_for_order(0.0, 5.0)
        assert velocity.ordered_for(0.3) == {0.0}

    velocity.node.wait_for(lambda: not on_the_output(), 5.0, "the end of the intruder")
    assert velocity.ordered_for(0.3) == {0.0}  # the stick is still held
    velocity.node.release(joystick)
    joystick.message = drive(0.1)
    velocity.wait_for_order(0.1)


@pytest.mark.parametrize("policy", ["report", "lock"])
def test_a_stranger_on_cmd_vel_mux_moves_nothing_holds_nobody_back_and_is_told(
    start: Callable[[Mapping[str, Any]], Velocity], policy: str
) -> None:
    velocity = start({"foreign_publishers": policy})
    stranger = velocity.node.repeat(TwistStamped, "cmd_vel_mux", 100.0)
    stranger.message = drive(0.28)
    velocity.node.wait_for(lambda: velocity.state.foreign, 5.0, "a foreign publisher")
    assert velocity.ordered_for(1.0) == {0.0}
    (foreign,) = velocity.state.foreign
    assert (foreign.topic, foreign.locks) == ("/cmd_vel_mux", False)
    assert foreign.problem == "only /velocity_mux should; it does not move the base"
    joystick = velocity.source(TwistStamped, "cmd_vel_joy")
    joystick.message = drive(0.1)
    velocity.wait_for_order(0.1)
    assert velocity.ordered_for(0.5) == {0.1}


@pytest.mark.parametrize("node", ["velocity_mux", "safety_filter"])
def test_simulation_time_is_refused_while_it_runs_and_its_timers_go_on(
    start: Callable[[Mapping[str, Any]], Velocity], node: str
) -> None:
    velocity = start({})
    client = velocity.node.node.create_client(SetParameters, f"{node}/set_parameters")
    velocity.node.wait_for(client.service_is_ready, START_S, "the parameters")
    value = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=True)
    request = SetParameters.Request(parameters=[Parameter(name="use_sim_time", value=value)])
    answer = client.call_async(request)
    velocity.node.wait_for(answer.done, 5.0, "an answer")
    (result,) = answer.result().results
    assert not result.successful
    assert result.reason.startswith("use_sim_time is refused: this node moves a robot")
    velocity.ordered_for(1.0)  # it asserts that it is not silent


@pytest.mark.usefixtures("domain_id")
def test_every_timer_of_mux_and_filter_runs_on_the_steady_clock(robot: Robot) -> None:
    """A clock that is set back, or simulated and paused, holds up neither zeros nor leases."""
    rclpy.init(args=[])
    try:
        mux = MuxNode(robot)
        timers = [*mux.timers, *FilterNode(robot, mux.moving_sources).timers]
        assert len(timers) >= 4
        assert {timer.clock.clock_type for timer in timers} == {ClockType.STEADY_TIME}
    finally:
        rclpy.shutdown()


def test_a_start_with_simulation_time_is_refused_with_a_sentence(
    spawn: Callable[..., Process], make_robot: Callable[[Mapping[str, Any]], Path], test_node: TestNode
) -> None:
    words = ["velocity", "--config", str(make_robot(FREE)), "--ros-args", "-p", "use_sim_time:=true"]
    process = spawn([sys.executable, "-m", "canbase_cli", *words])
    test_node.wait_for(lambda: process.exit_code is not None, 30.0, "its end")
    assert process.exit_code == 2
    assert "use_sim_time is refused" in process.log()
    assert "Traceback" not in process.log()


def test_in_its_namespace_a_source_is_no_output_of_the_robot(
    spawn: Callable[..., Process], make_robot: Callable[[Mapping[str, Any]], Path]
) -> None:
    loop = {"loop": {"topic": "/robot1/cmd_vel", "priority": 9, "timeout_s": 0.3}}
    path = make_robot({**FREE, "mux": {"sources": loop}})
    words = ["velocity", "--config", str(path), "--namespace", "robot1"]
    process = spawn([sys.executable, "-m", "canbase_cli", *words])
    assert process.wait(START_S) == 2
    assert "mux.sources.loop: its topic is /robot1/cmd_vel here, an output of this robot" in process.log()
    assert "Traceback" not in process.log()


def test_a_publisher_of_the_other_message_type_is_told(start: Callable[[Mapping[str, Any]], Velocity]) -> None:
    velocity = start({})
    velocity.node.node.create_publisher(Twist, "cmd_vel_joy", 1)
    velocity.node.wait_for(lambda: velocity.state.foreign, 5.0, "the wrong type")
    (foreign,) = velocity.state.foreign
    assert (foreign.type, foreign.locks) == ("geometry_msgs/msg/Twist", False)
    assert foreign.problem.endswith("which is not received; expected geometry_msgs/msg/TwistStamped")


def test_infinity_is_counted_for_its_source_alone(start: Callable[[Mapping[str, Any]], Velocity]) -> None:
    velocity = start({})
    joystick = velocity.source(TwistStamped, "cmd_vel_joy")
    joystick.message = drive(math.inf)

    def refused() -> dict[str, int]:
        return {source.name: source.refused for source in velocity.state.sources}

    velocity.node.wait_for(lambda: refused()["joystick"] > 0, 3.0, "a refusal")
    assert {name for name, count in refused().items() if count} == {"joystick"}
    assert velocity.ordered_for(0.3) == {0.0}
