"""velocity_mux over DDS: locks, parameter files of twist_mux, publishers of every kind, and those that are foreign."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import rclpy
from canbase.msg import ForeignPublisher
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Twist, TwistStamped
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.clock_type import ClockType
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool

from canbase_config.robot import Robot
from canbase_velocity.filter_node import FilterNode
from canbase_velocity.mux_node import MuxNode
from support.velocity_chain import LATCHED, START_S, Chain, drive

pytestmark = pytest.mark.ros

BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
CHANGES = {"mux": {"locks": {"pause": {"topic": "pause", "priority": 101, "required": False}}}}


@pytest.fixture
def chain(module_chain: Chain) -> Chain:
    module_chain.rest()
    return module_chain


def reasons(chain: Chain) -> dict[str, str]:
    return {source.name: source.reason for source in chain.mux.messages[-1].sources}


def foreign_on(chain: Chain, topic: str) -> list[ForeignPublisher]:
    return [foreign for foreign in chain.mux.messages[-1].foreign if foreign.topic == topic]


def wait_foreign(chain: Chain, topic: str) -> ForeignPublisher:
    """The only one there."""
    (foreign,) = chain.node.wait_for(lambda: foreign_on(chain, topic), 5.0, f"a foreign publisher on {topic}")
    return foreign


def wait_gone(chain: Chain, topic: str) -> None:
    chain.node.wait_for(lambda: not foreign_on(chain, topic), 5.0, f"no foreign publisher on {topic}")


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
    start: Callable[[Mapping[str, Any]], Chain], twist_mux_file: Path
) -> None:
    own = {
        "joystick": {"topic": "cmd_vel_joy", "priority": 6, "timeout_s": 0.3},
        "action": {"topic": "cmd_vel_action", "priority": 5, "timeout_s": 0.3},
    }
    chain = start({"mux": {"twist_mux": [str(twist_mux_file)], "sources": own}})
    nav, joy = chain.node.source("nav_vel", Twist), chain.node.source("joy_vel", Twist)
    e_stop, pause = (chain.node.repeat(Bool, topic, 50.0) for topic in ("e_stop", "pause_navigation"))
    for lock in (e_stop, pause):
        chain.node.wait_for_subscriber(lock.publisher, START_S)
    nav.message = drive(0.2).twist
    assert chain.ordered_for(0.5) == {0.0}  # e_stop was never heard
    assert reasons(chain)["nav"] == "locked: e_stop has published nothing yet on e_stop"
    e_stop.message = Bool(data=False)
    assert chain.ordered_for(0.5) == {0.0}  # nor does it drive off when the lock opens
    chain.node.release(nav, joy)
    nav.message = drive(0.2).twist
    chain.wait_for_order(0.2)
    pause.message = Bool(data=True)
    chain.wait_for_order(0.0)
    assert chain.ordered_for(0.3) == {0.0}  # said explicitly, and again and again
    joy.message = drive(-0.1).twist
    chain.wait_for_order(-0.1)
    e_stop.message = None  # its publisher dies
    chain.wait_for_order(0.0)
    chain.node.spin_for(0.1)
    assert [(lock.name, lock.holds) for lock in chain.mux.messages[-1].locks] == [("e_stop", True), ("pause", True)]
    assert "has published nothing for" in reasons(chain)["joy"]
    nav.message = joy.message = None
    e_stop.message, pause.message = Bool(data=False), Bool(data=False)
    chain.node.release(chain.action)
    chain.action.message = drive(0.3)  # a stamped source beside plain ones
    chain.wait_for_order(0.3)


# those of `chain` are reliable and keep nothing
@pytest.mark.parametrize("qos", [BEST_EFFORT, LATCHED], ids=["best effort", "latched"])
def test_publishers_of_every_quality_of_service_are_heard(chain: Chain, qos: QoSProfile) -> None:
    node = chain.node
    for replaced in (chain.joystick, chain.estop):
        node.node.destroy_publisher(replaced.publisher)
    chain.joystick = node.repeat(TwistStamped, "cmd_vel_joy", 50.0, qos)
    chain.estop, pause = node.repeat(Bool, "estop_state", 20.0, qos), node.repeat(Bool, "pause", 50.0, qos)
    for repeater in (chain.joystick, chain.estop, pause):
        node.wait_for_subscriber(repeater.publisher)
    node.spin_for(1.0)  # the mux has seen that others took their place
    node.release(chain.joystick)
    chain.joystick.message = drive(0.2)
    chain.wait_for_order(0.2)
    chain.estop.message = Bool(data=True)
    chain.wait_for_order(0.0)
    assert chain.mux.messages[-1].active == "joystick"  # the mux passes it on: it is the filter that heard the button
    pause.message = Bool(data=True)
    node.wait_for(lambda: chain.mux.messages[-1].active == "", 2.0, "the lock")
    pause.message = Bool(data=False)
    node.wait_for(lambda: not chain.mux.messages[-1].locks[0].holds, 2.0, "the lock to open")
    pause.message = None
    node.node.destroy_publisher(pause.publisher)


def test_a_subscriber_that_asks_for_more_than_is_offered_is_told_loudly(chain: Chain) -> None:
    diagnostics = chain.node.record(DiagnosticArray, "/diagnostics")
    sentence = "a subscriber of cmd_vel_mux receives nothing: it requests another DURABILITY than is offered"

    def told() -> bool:
        return any(sentence in status.message for message in diagnostics.messages for status in message.status)

    with chain.another("listener") as listener:
        listener.record(TwistStamped, "cmd_vel_mux", LATCHED)
        chain.node.wait_for(told, 5.0, f"{sentence} in {diagnostics.last}")
    assert sentence in chain.process.log()


def test_a_foreign_publisher_is_named_in_state_and_diagnostics_and_nothing_else_happens(chain: Chain) -> None:
    diagnostics = chain.node.record(DiagnosticArray, "/diagnostics")

    def warned() -> bool:
        return any(
            status.level == DiagnosticStatus.WARN and "/other/intruder publishes on /cmd_vel" in status.message
            for message in diagnostics.messages
            for status in message.status
        )

    with chain.another("intruder", namespace="/other") as other:
        other.node.create_publisher(TwistStamped, "/cmd_vel", 1)
        chain.joystick.message = drive(0.2)
        foreign = wait_foreign(chain, "/cmd_vel")
        assert (foreign.node, foreign.locks) == ("/other/intruder", False)
        assert foreign.problem == "only /safety_filter should"
        chain.wait_for_order(0.2)
        chain.node.wait_for(warned, 3.0, "a warning in /diagnostics")
    wait_gone(chain, "/cmd_vel")


def test_a_foreign_publisher_locks_its_source_when_the_configuration_says_so(
    start: Callable[[Mapping[str, Any]], Chain],
) -> None:
    chain = start({"mux": {"foreign_publishers": "lock"}})
    chain.action.message = drive(0.2)  # test_node is not drive_distance_server
    wait_foreign(chain, "/cmd_vel_action")
    chain.wait_for_order(0.0)
    assert reasons(chain)["action"] == (
        "locked: /test_node publishes on /cmd_vel_action: only /drive_distance_server should"
    )
    chain.joystick.message = drive(0.1)
    chain.wait_for_order(0.1)
    stranger = chain.node.repeat(TwistStamped, "cmd_vel_mux", 100.0)
    stranger.message = drive(0.28)
    assert not wait_foreign(chain, "/cmd_vel_mux").locks
    assert chain.ordered_for(0.5) == {0.1}
    with chain.another("intruder") as other:
        other.node.create_publisher(TwistStamped, "cmd_vel", 1)
        wait_foreign(chain, "/cmd_vel")
        chain.wait_for_order(0.0, 5.0)
        assert chain.ordered_for(0.3) == {0.0}

    wait_gone(chain, "/cmd_vel")
    assert chain.ordered_for(0.3) == {0.0}  # the stick is still held
    chain.node.release(chain.joystick)
    chain.joystick.message = drive(0.1)
    chain.wait_for_order(0.1)


def test_a_stranger_on_cmd_vel_mux_moves_nothing_holds_nobody_back_and_is_told(chain: Chain) -> None:
    stranger = chain.node.repeat(TwistStamped, "cmd_vel_mux", 100.0)
    stranger.message = drive(0.28)
    foreign = wait_foreign(chain, "/cmd_vel_mux")
    assert chain.ordered_for(1.0) == {0.0}
    assert (foreign.node, foreign.locks) == ("/test_node", False)
    assert foreign.problem == "only /velocity_mux should; it does not move the base"
    chain.joystick.message = drive(0.1)
    chain.wait_for_order(0.1)
    assert chain.ordered_for(0.5) == {0.1}
    stranger.message = None
    chain.node.node.destroy_publisher(stranger.publisher)
    wait_gone(chain, "/cmd_vel_mux")


def test_simulation_time_is_refused_while_it_runs_and_its_timers_go_on(chain: Chain) -> None:
    value = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=True)
    request = SetParameters.Request(parameters=[Parameter(name="use_sim_time", value=value)])
    for node in ("velocity_mux", "safety_filter"):
        client = chain.node.node.create_client(SetParameters, f"{node}/set_parameters")
        chain.node.wait_for(client.service_is_ready, START_S, "the parameters")
        answer = client.call_async(request)
        chain.node.wait_for(answer.done, 5.0, "an answer")
        (result,) = answer.result().results
        assert not result.successful
        assert result.reason.startswith("use_sim_time is refused: this node moves a robot")
    chain.ordered_for(1.0)  # it asserts that it is not silent


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


def test_a_publisher_of_the_other_message_type_is_told(chain: Chain) -> None:
    with chain.another("teleop") as teleop:
        teleop.node.create_publisher(Twist, "cmd_vel_joy", 1)
        foreign = wait_foreign(chain, "/cmd_vel_joy")
        assert (foreign.type, foreign.locks) == ("geometry_msgs/msg/Twist", False)
        assert foreign.problem.endswith("which is not received; expected geometry_msgs/msg/TwistStamped")
    wait_gone(chain, "/cmd_vel_joy")


def test_infinity_is_counted_for_its_source_alone(chain: Chain) -> None:
    chain.joystick.message = drive(math.inf)

    def refused() -> dict[str, int]:
        return {source.name: source.refused for source in chain.mux.messages[-1].sources}

    chain.node.wait_for(lambda: refused()["joystick"] > 0, 3.0, "a refusal")
    assert {name for name, count in refused().items() if count} == {"joystick"}
    assert chain.ordered_for(0.3) == {0.0}
