"""Neutral start with real processes: a stick that is held while parts of the robot come and go."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import pytest
from canbase.msg import DriverStatus, MuxState, SafetyState
from geometry_msgs.msg import TwistStamped
from std_msgs.msg import Bool

from ros.test_velocity import reset
from support.running_robot import LATCHED as STATE
from support.running_robot import RESTS_M, RunningRobot, own_domain, robot_on
from support.velocity_chain import Chain, drive

pytestmark = [pytest.mark.ros, pytest.mark.timeout(240)]
ENABLED = DriverStatus(state=DriverStatus.ENABLED)
LATCHED = DriverStatus(state=DriverStatus.LATCHED)


def followed(chain: Chain, seconds: float = 1.0) -> bool:
    """Whether anything but zero is ordered from now on."""
    chain.orders.clear()
    chain.node.spin_for(seconds)
    assert len(chain.orders.messages) > 10 * seconds
    return any(order.twist.linear.x != 0.0 for order in chain.orders.messages)


def waits(chain: Chain) -> str:
    """What the mux says about the joystick."""
    chain.node.spin_for(0.6)
    assert chain.mux.last is not None
    assert chain.mux.last.active == "joystick"
    return str(chain.mux.last.sources[0].reason)


def release(chain: Chain) -> None:
    """The stick goes through zero, and is held again: now it is followed."""
    chain.joystick.message = drive(0.0)
    chain.node.spin_for(0.2)
    chain.joystick.message = drive(0.2)
    chain.wait_for_order(0.2)


def test_a_stick_held_while_the_driver_latches_or_restarts_is_not_followed_before_a_zero(chain: Chain) -> None:
    release(chain)
    chain.driver.message = LATCHED
    chain.node.spin_for(0.3)
    chain.driver.message = ENABLED  # the operator has reset it
    assert not followed(chain)
    assert waits(chain) == "waiting for zero (motor_driver is LATCHED)"
    release(chain)
    chain.driver.message = None  # the driver dies
    chain.node.spin_for(1.0)
    chain.driver.message = ENABLED
    assert not followed(chain)
    chain.joystick.message = None  # a radio gap of 0.45 s
    chain.node.spin_for(0.45)
    chain.joystick.message = drive(0.2)
    assert not followed(chain)
    assert waits(chain).startswith("waiting for zero (no recent message on motor_driver/status")
    release(chain)


def test_a_stick_held_over_the_emergency_stop_is_not_followed_before_a_zero(chain: Chain) -> None:
    release(chain)
    chain.estop.message = Bool(data=True)
    chain.wait_for_cause(SafetyState.CAUSE_ESTOP)
    chain.estop.message = Bool(data=False)
    chain.node.spin_for(0.3)
    done, sentence = reset(chain)
    assert (done, sentence.split(";")[0]) == (False, "refused: joystick orders a velocity")
    chain.joystick.message = None  # a radio gap, in which the operator resets
    chain.node.spin_for(0.45)
    assert reset(chain)[0] is True
    chain.joystick.message = drive(0.2)
    assert not followed(chain)
    release(chain)


def test_a_reset_while_no_scan_comes_does_not_release_a_held_stick(chain: Chain) -> None:
    release(chain)
    scan, chain.scan.message = chain.scan.message, None
    chain.wait_for_cause(SafetyState.CAUSE_SCAN_STALE)
    chain.driver.message = LATCHED
    chain.node.spin_for(0.3)
    chain.driver.message = ENABLED  # reset: behind the filter everything was zero
    chain.node.spin_for(0.3)
    chain.scan.message = scan  # and the scans return
    chain.wait_for_cause(SafetyState.CAUSE_NONE)
    assert not followed(chain)
    release(chain)


def test_scans_that_return_do_not_move_a_held_stick(chain: Chain) -> None:
    release(chain)
    scan, chain.scan.message = chain.scan.message, None
    chain.wait_for_cause(SafetyState.CAUSE_SCAN_STALE)
    chain.node.spin_for(1.5)  # somebody walks up to the base; nothing was stopped or reset
    chain.scan.message = scan
    chain.wait_for_cause(SafetyState.CAUSE_NONE)
    assert not followed(chain)
    assert waits(chain) == "waiting for zero (no usable scan for 1.0 s: scan_stale)"
    release(chain)


@pytest.mark.parametrize("held_s", [0.0, 1.0])
def test_a_lock_that_opens_does_not_move_a_held_stick(
    start: Callable[[Mapping[str, Any]], Chain], held_s: float
) -> None:
    chain = start({"mux": {"locks": {"gate": {"topic": "gate_lock", "priority": 200, "required": False}}}})
    gate = chain.node.node.create_publisher(Bool, "gate_lock", 2)
    chain.node.wait_for_subscriber(gate, count=2)
    release(chain)
    gate.publish(Bool(data=True))
    chain.node.spin_for(held_s)
    gate.publish(Bool(data=False))
    chain.node.spin_for(0.3)
    assert not followed(chain)
    assert waits(chain) == "waiting for zero (locked: gate holds)"
    release(chain)


def test_while_two_nodes_publish_on_the_topic_of_a_stick_neither_is_followed(chain: Chain) -> None:
    release(chain)
    second = chain.node.node.create_publisher(TwistStamped, "cmd_vel_joy", 2)
    chain.node.spin_for(1.0)
    for _ in range(5):
        second.publish(drive(0.0))
        assert not followed(chain, 0.2)
    assert waits(chain).startswith("2 publishers on cmd_vel_joy (")
    chain.node.node.destroy_publisher(second)
    chain.node.spin_for(1.0)
    assert not followed(chain)
    release(chain)


# armed ── the joystick's publisher ends ── 1 s ── another one with a pushed stick: not followed before a zero
def test_a_joystick_node_that_is_started_again_with_the_stick_held_is_not_followed(chain: Chain) -> None:
    release(chain)
    chain.joystick.message = drive(0.0)
    chain.node.spin_for(1.0)  # the mux has looked into the graph
    ended = chain.joystick
    ended.message = None
    chain.node.node.destroy_publisher(ended.publisher)
    chain.joystick = chain.node.repeat(TwistStamped, "cmd_vel_joy", 50.0)
    chain.node.wait_for_subscriber(chain.joystick.publisher)
    chain.node.spin_for(1.0)
    chain.joystick.message = drive(0.2)
    assert not followed(chain)
    assert waits(chain) == "waiting for zero (a publisher on cmd_vel_joy has ended)"
    release(chain)


def test_a_lock_with_two_publishers_holds(start: Callable[[Mapping[str, Any]], Chain]) -> None:
    chain = start({"mux": {"locks": {"gate": {"topic": "gate_lock", "priority": 200, "required": False}}}})
    gates = [chain.node.node.create_publisher(Bool, "gate_lock", 2) for _ in range(2)]
    for gate in gates:
        chain.node.wait_for_subscriber(gate, count=2)
    chain.node.spin_for(1.0)
    for gate, locked in zip(gates, (True, False), strict=True):
        gate.publish(Bool(data=locked))
    chain.joystick.message = drive(0.0)
    chain.node.spin_for(0.2)
    chain.joystick.message = drive(0.2)
    assert not followed(chain)
    assert chain.mux.last is not None
    assert chain.mux.last.sources[0].reason.startswith("locked: gate has 2 publishers on gate_lock (")


def test_without_the_drivers_state_nothing_moves(start: Callable[[Mapping[str, Any]], Chain]) -> None:
    chain = start({})
    chain.driver.message = None
    chain.node.spin_for(0.8)
    chain.joystick.message = drive(0.2)
    assert not followed(chain)
    assert chain.mux.last is not None
    assert (chain.mux.last.ready, chain.mux.last.not_ready) == (False, "no recent message on motor_driver/status")


def stamp_s(message: DriverStatus | MuxState) -> float:
    """When it was made, by the computer's clock: a loaded test reads what waited first."""
    return float(message.stamp.sec + message.stamp.nanosec * 1e-9)


@pytest.fixture(scope="module")
def running() -> Iterator[RunningRobot]:
    with own_domain() as domain, robot_on(domain) as robot:
        yield robot


@pytest.mark.parametrize("parts", [("driver",), ("velocity",), ("velocity", "driver")], ids=" and ".join)
def test_a_stick_held_while_parts_are_killed_and_started_again_moves_nothing(
    running: RunningRobot, parts: tuple[str, ...]
) -> None:
    robot = running
    robot.make_ready()
    mux = robot.node.record(MuxState, "velocity_mux/state", STATE)
    joystick = robot.node.source()
    try:
        joystick.message = drive(0.2)
        robot.wait_speed(0.19)
        for part in parts:
            robot.send(part, signal.SIGKILL)
        robot.wait_standing()
        for part in parts:
            assert robot.stack.end(part) == -signal.SIGKILL
        started_s = time.time()
        robot.stack.start()
        robot.node.wait_for(lambda: robot.status.last and stamp_s(robot.status.last) > started_s, 40.0, "the driver")
        robot.make_ready()
        robot.node.wait_for(lambda: mux.last and stamp_s(mux.last) > started_s and mux.last.ready, 40.0, "the mux")
        assert robot.moved_since(time.monotonic(), 2.0) < RESTS_M
        assert mux.messages[-1].sources[0].reason.startswith("waiting for zero (")
        robot.node.release(joystick)
        joystick.message = drive(0.2)
        robot.wait_speed(0.19)
    finally:
        joystick.message = None
        robot.wait_standing()


# driving with the stick held ── a stop that latches ── motor_driver/reset alone, which sees zeros ── enabled: stays
@pytest.mark.parametrize("stop", ["motor_driver/stop", "watchdog"])
def test_a_reset_of_the_driver_alone_does_not_release_a_held_stick(running: RunningRobot, stop: str) -> None:
    robot = running
    robot.make_ready()
    joystick = robot.node.source()
    try:
        joystick.message = drive(0.2)
        robot.wait_speed(0.19)
        if stop == "watchdog":
            robot.send("watchdog", signal.SIGKILL)
            assert robot.stack.end("watchdog") == -signal.SIGKILL
            robot.stack.start()
        else:
            robot.reset(stop)
        robot.wait_state(DriverStatus.LATCHED)
        robot.wait_standing()
        reset_s = time.monotonic()
        robot.make_ready()  # motor_driver/reset, which resets the watchdog too; the stick is held all the time
        assert robot.moved_since(reset_s, time.monotonic() - reset_s + 3.0) < RESTS_M
        robot.node.release(joystick)
        joystick.message = drive(0.2)
        robot.wait_speed(0.19)
    finally:
        joystick.message = None
        robot.wait_standing()
