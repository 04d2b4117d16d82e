"""velocity_mux and safety_filter as a real process over DDS: what comes in, what goes out, and every way out."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from canbase.msg import MuxState, SafetyState
from geometry_msgs.msg import TwistStamped
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool, Int8

from ros.conftest import MakeRobot, Spawn
from support.ros_harness import Process, TestNode
from support.scanner import BEAMS, all_around
from support.velocity_chain import LATCHED, RUN, START_S, Chain, drive, scan

pytestmark = pytest.mark.ros
Start = Callable[[Mapping[str, Any]], Chain]


@pytest.fixture
def chain(module_chain: Chain) -> Chain:
    """At rest. A test that ends its process starts another one."""
    module_chain.rest()
    return module_chain


def test_the_higher_priority_drives_and_silence_ends_in_explicit_zeros(chain: Chain) -> None:
    assert chain.ordered == (0.0, 0.0)  # before anybody spoke
    chain.action.message = drive(0.2, 0.1)
    chain.wait_for_order(0.2)
    assert chain.ordered == pytest.approx((0.2, 0.1))
    order = chain.orders.messages[-1]
    assert order.header.frame_id == "base_link"
    assert abs(time.time() - (order.header.stamp.sec + order.header.stamp.nanosec * 1e-9)) < 2.0
    chain.joystick.message = drive(-0.3)
    assert chain.wait_for_order(-0.3) < 0.5
    chain.node.wait_for(lambda: chain.mux.messages[-1].active == "joystick", 1.0, "the state")
    reasons = {"joystick": "", "navigation": "never received", "action": "joystick has priority"}

    def told() -> dict[str, str]:
        return {source.name: source.reason for source in chain.mux.messages[-1].sources}

    # a pause of this process makes a source silent for a moment
    chain.node.wait_for(lambda: told() == reasons, 2.0, f"the reasons {reasons}")
    chain.action.message = None
    chain.node.spin_for(0.4)  # the old command of the action is stale when the joystick is let go
    chain.joystick.message = None
    chain.orders.clear()
    chain.node.wait_for(lambda: chain.orders.last is not None, 1.0)
    took_s = chain.wait_for_order(0.0)
    assert 0.2 <= took_s <= 0.6
    assert 0.2 not in [message.twist.linear.x for message in chain.orders.messages]
    chain.orders.clear()
    chain.node.spin_for(0.5)
    assert 20 <= len(chain.orders.messages) <= 55  # zeros at command_hz, 50 Hz, by the mux and at most the filter's too
    assert {message.twist.linear.x for message in chain.orders.messages} == {0.0}
    assert chain.mux.messages[-1].active == ""


def test_a_source_faster_than_the_timer_is_not_doubled(chain: Chain) -> None:
    sent: list[TwistStamped] = []

    def send() -> None:
        sent.append(drive(0.2))
        chain.joystick.publisher.publish(sent[-1])

    timer = chain.node.node.create_timer(0.01, send)
    chain.wait_for_order(0.2)
    chain.orders.clear()
    sent.clear()
    chain.node.spin_for(2.0)
    chain.node.node.destroy_timer(timer)
    assert chain.ordered == pytest.approx((0.2, 0.0))
    assert len(chain.orders.messages) <= 1.3 * len(sent)  # with the timers' 2 × 50 Hz it were twice


def test_the_emergency_stop_stops_until_a_reset_that_is_refused_while_anybody_wants_to_drive(chain: Chain) -> None:
    chain.action.message = drive(0.2)
    chain.wait_for_order(0.2)
    chain.estop.message = Bool(data=True)
    state = chain.wait_for_cause(SafetyState.CAUSE_ESTOP)
    assert (state.estop, state.emergency) == (True, True)
    assert chain.ordered == (0.0, 0.0)
    assert chain.reset() == (False, "refused: the emergency stop on estop_state is pressed")
    chain.estop.message = Bool(data=False)
    chain.orders.clear()
    chain.node.spin_for(0.3)
    assert {message.twist.linear.x for message in chain.orders.messages} == {0.0}  # no jump at release
    chain.joystick.message = drive(0.0)  # it has priority: cmd_vel_mux is zero, and the action wants to drive still
    chain.node.spin_for(0.2)
    done, sentence = chain.reset()
    assert (done, sentence.split(";")[0]) == (False, "refused: action orders a velocity")
    chain.action.message = drive(0.0)
    chain.node.spin_for(0.2)
    assert chain.reset()[0] is True
    chain.wait_for_cause(SafetyState.CAUSE_NONE)
    chain.node.spin_for(0.1)  # the action's zero after the reset
    chain.action.message, chain.joystick.message = drive(0.2), None
    chain.wait_for_order(0.2)


def test_a_button_that_publishes_another_type_holds_the_base(chain: Chain) -> None:
    with chain.another("button") as button:
        button.node.create_publisher(Int8, "estop_state", 1).publish(Int8(data=1))
        state = chain.wait_for_cause(SafetyState.CAUSE_ESTOP)
        assert "publishes it as std_msgs/msg/Int8, which is not received" in state.detail


# a press and a lock, published once by publishers that keep them (transient local) ── the process starts
def test_what_a_button_and_a_lock_said_before_the_start_counts_where_their_publishers_keep_it(
    spawn: Spawn, make_robot: MakeRobot, test_node: TestNode, watchdog: socket.socket
) -> None:
    for topic in ("estop_state", "pause"):
        test_node.node.create_publisher(Bool, topic, LATCHED).publish(Bool(data=True))
    lock = {"topic": "pause", "priority": 101, "required": False}
    spawn(RUN.format(path=str(make_robot({"mux": {"locks": {"pause": lock}}})), ros_args=[]))
    state = test_node.record(SafetyState, "safety_filter/state", LATCHED)
    mux = test_node.record(MuxState, "velocity_mux/state", LATCHED)
    test_node.wait_for(lambda: state.last is not None and state.last.estop, 2.0 * START_S, "the emergency stop")
    test_node.wait_for(lambda: mux.last is not None and mux.last.locks[0].holds, START_S, "the lock")


# button A publishes its press once; button B says 20 times a second that it is free
def test_a_second_button_on_the_topic_of_the_emergency_stop_does_not_release_the_first(chain: Chain) -> None:
    chain.estop.message = Bool(data=False)
    other = chain.node.node.create_publisher(Bool, "estop_state", 1)
    chain.node.wait_for_subscriber(other)
    chain.node.spin_for(0.7)
    other.publish(Bool(data=True))
    state = chain.wait_for_cause(SafetyState.CAUSE_ESTOP)
    chain.node.spin_for(0.5)
    done, sentence = chain.reset()
    assert (done, "estop_state has 2 publishers" in sentence) == (False, True), sentence
    chain.node.node.destroy_publisher(other)
    chain.node.wait_for(lambda: chain.reset()[0], 5.0, "a reset with one button left")
    state = chain.wait_for_cause(SafetyState.CAUSE_NONE)
    assert not state.estop


def test_an_obstacle_ahead_blocks_the_way_ahead_but_not_the_way_back(chain: Chain) -> None:
    chain.scan.message = scan(ahead_m=0.4)  # 0.10 m before the footprint, stop distance 0.15 m
    chain.action.message = drive(0.2)
    state = chain.wait_for_cause(SafetyState.CAUSE_OBSTACLE)
    assert state.action == SafetyState.STOP
    assert state.clearance_ahead_m == pytest.approx(0.09, abs=1.1e-3)  # 0.01 m of padding; noise
    assert state.clearance_behind_m == math.inf
    assert chain.ordered == (0.0, 0.0)
    chain.action.message = drive(-0.2)
    chain.wait_for_order(-0.2)
    chain.scan.message = scan(ahead_m=0.6)  # 0.30 m free
    chain.action.message = drive(1.0)
    chain.wait_for_cause(SafetyState.CAUSE_OBSTACLE_NEAR)
    chain.node.spin_for(0.1)
    assert 0.0 < chain.ordered[0] <= math.sqrt(2 * 1.0 * 0.15)


def test_a_stale_scan_stops(chain: Chain) -> None:
    chain.action.message = drive(0.2)
    chain.wait_for_order(0.2)
    chain.scan.message = None
    assert chain.wait_for_order(0.0) < 0.8
    state = chain.wait_for_cause(SafetyState.CAUSE_SCAN_STALE)
    assert math.isnan(state.clearance_ahead_m)
    chain.scan.message = all_around([math.nan] * BEAMS)
    chain.wait_for_cause(SafetyState.CAUSE_SCAN_INVALID)
    assert chain.ordered == (0.0, 0.0)
    chain.scan.message = scan()
    chain.wait_for_order(0.2)


def test_a_scanner_that_says_nothing_ahead_or_sends_the_same_again_and_again_does_not_count_as_free(
    chain: Chain,
) -> None:
    chain.action.message = drive(0.4)
    chain.wait_for_order(0.4)
    half_blind = [math.inf] * BEAMS
    half_blind[: BEAMS // 4] = half_blind[-BEAMS // 4 :] = [math.nan] * (BEAMS // 4)
    chain.scan.message = all_around(half_blind)
    state = chain.wait_for_cause(SafetyState.CAUSE_SCAN_BLIND)
    assert state.scanners[0].usable_share == pytest.approx(0.5)
    assert 0.0 < chain.ordered[0] <= 0.15
    chain.scan.message = scan(ahead_m=3.0)
    chain.wait_for_order(0.4)
    again = chain.scan.prepare(chain.scan.message)
    chain.scan.prepare = lambda _: again  # the same message, with its stamp
    state = chain.wait_for_cause(SafetyState.CAUSE_SCAN_FROZEN)
    assert "stamp" in state.detail
    assert state.scanners[0].dropped > 0
    assert chain.ordered == (0.0, 0.0)


def test_every_order_has_its_lease_in_rising_sequence(chain: Chain) -> None:
    chain.action.message = drive(0.2, 0.1)
    chain.wait_for_order(0.2)
    chain.drain()
    chain.leases.clear()
    chain.orders.clear()
    before_ns = time.monotonic_ns()
    chain.node.spin_for(0.5)
    leases = list(chain.leases)
    assert len(leases) >= 20
    sequences = [lease[1] for lease in leases]
    assert sequences == list(range(sequences[0], sequences[0] + len(leases)))
    assert len(chain.orders.messages) == pytest.approx(len(leases), abs=5)
    for magic, _, sent_ns, linear_mps, angular_radps, flags, _ in leases:
        assert (magic, flags) == (b"CBL1", 0)
        assert (linear_mps, angular_radps) == pytest.approx((0.2, 0.1))
        assert before_ns - 1e9 < sent_ns <= time.monotonic_ns()
    chain.estop.message = Bool(data=True)
    chain.wait_for_cause(SafetyState.CAUSE_ESTOP)
    chain.drain()
    assert chain.leases[-1][3:6] == (0.0, 0.0, 4)  # brakes hard
    assert chain.state.messages[-1].lease_sequence >= sequences[-1]


def test_sigint_ends_with_zeros_until_the_base_can_stand(start: Start) -> None:
    chain = start({})
    chain.action.message = drive(0.5)
    chain.wait_for_order(0.5)
    asked_s = time.monotonic()
    chain.process.interrupt()
    chain.node.wait_for(lambda: chain.process.exit_code is not None, 5.0, "its end")
    ended_s = time.monotonic()
    assert chain.process.exit_code == 0, chain.process.log()
    chain.node.spin_for(0.2)
    assert 0.4 < ended_s - asked_s < 2.0  # 0.5 m/s on a ramp of 1 m/s² takes 0.5 s
    zeros = [message.twist.linear.x for message in chain.orders.since(asked_s + 0.1)]
    assert len(zeros) >= 10
    assert set(zeros) == {0.0}
    assert chain.state.last is not None
    assert (chain.state.last.cause, chain.state.last.action) == ("shutdown", SafetyState.STOP)
    assert chain.mux.last is not None
    assert [source.reason for source in chain.mux.last.sources] == ["shutdown"] * 3
    assert chain.leases[-1][3:6] == (0.0, 0.0, 0)
    assert "Traceback" not in chain.process.log()


def test_an_exception_in_a_callback_ends_the_process_with_zeros_and_the_traceback(
    spawn: Callable[..., Process], robot_yaml: Path, test_node: TestNode, watchdog: socket.socket
) -> None:
    broken = "\n".join((
        "from canbase_velocity.mux import Mux",
        "taken = Mux.accept_command",
        "def accept_command(self, name, twist, *times):",
        "    if name == 'joystick' and not twist.is_zero: raise RuntimeError('a defect')",
        "    return taken(self, name, twist, *times)",
        "Mux.accept_command = accept_command",
        RUN.format(path=str(robot_yaml), ros_args=[]),
    ))  # fmt: skip
    chain = Chain(test_node, spawn(broken), watchdog)
    chain.action.message = drive(0.2)
    chain.wait_for_order(0.2)
    chain.joystick.message = drive(0.1)
    chain.node.wait_for(lambda: chain.process.exit_code is not None, 5.0, "its end")
    assert chain.process.exit_code == 1
    assert "RuntimeError: a defect" in chain.process.log()
    chain.node.spin_for(0.2)
    assert [message.twist.linear.x for message in chain.orders.messages[-3:]] == [0.0, 0.0, 0.0]


# drives at 0.8 m/s ── SIGTERM ── 0.2: the button is pressed, which it publishes once ── 1.2: the end ── start: pressed
def test_a_press_during_the_orderly_end_outlives_it(start: Start, spawn: Spawn, robot_yaml: Path) -> None:
    chain = start({})
    chain.joystick.message = drive(0.8)
    chain.wait_for_order(0.8)
    chain.process.terminate()
    chain.node.spin_for(0.2)
    assert chain.wait_for_cause(SafetyState.CAUSE_SHUTDOWN)
    chain.orders.clear()
    chain.estop.publisher.publish(Bool(data=True))
    chain.node.wait_for(lambda: chain.process.exit_code is not None, 10.0, "the end")
    assert chain.process.exit_code == 0
    assert {order.twist.linear.x for order in chain.orders.messages} == {0.0}
    chain.joystick.message = None
    chain.state.clear()
    spawn(RUN.format(path=str(robot_yaml), ros_args=[]))
    chain.node.wait_for(lambda: chain.state.last, START_S, "the next start")
    assert "not seen released" in chain.wait_for_cause(SafetyState.CAUSE_ESTOP).detail
    assert chain.reset()[0] is False
    chain.orders.clear()
    chain.node.release(chain.joystick)
    chain.joystick.message = drive(0.8)
    chain.node.spin_for(0.5)
    assert {order.twist.linear.x for order in chain.orders.messages} == {0.0}


# two scanners on one topic, with one frame_id: each would show as free what only the other one sees
def test_two_scanners_on_one_topic_stop_the_base_with_their_names(chain: Chain) -> None:
    chain.joystick.message = drive(0.3)
    chain.wait_for_order(0.3)
    with chain.another("rear_scanner") as other:
        other.node.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        chain.wait_for_cause(SafetyState.CAUSE_SCAN_INVALID, "2 publishers (/rear_scanner, /test_node)")
        chain.wait_for_order(0.0)
    chain.wait_for_cause(SafetyState.CAUSE_NONE)
