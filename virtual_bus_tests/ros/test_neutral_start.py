"""Neutral start with a real velocity process: a stick that is held while something stops the base."""

from __future__ import annotations

import pytest
from canbase.msg import DriverStatus, SafetyState
from geometry_msgs.msg import TwistStamped
from std_msgs.msg import Bool

from support.velocity_chain import Chain, drive

pytestmark = [pytest.mark.ros, pytest.mark.timeout(60)]
ENABLED = DriverStatus(state=DriverStatus.ENABLED)
LATCHED = DriverStatus(state=DriverStatus.LATCHED)
CHANGES = {"mux": {"locks": {"gate": {"topic": "gate_lock", "priority": 200, "required": False}}}}


@pytest.fixture
def chain(module_chain: Chain) -> Chain:
    """At rest, and then with its stick held: the stick is followed."""
    module_chain.rest()
    release(module_chain)
    return module_chain


def followed(chain: Chain, seconds: float = 1.0) -> bool:
    """Whether anything but zero is commanded from now on."""
    return chain.ordered_for(seconds) != {0.0}


def wait_reason(chain: Chain, reason: str, active: str = "joystick") -> None:
    """What the mux reports about the joystick, which has priority unless it is locked, begins so."""

    def reported() -> bool:
        state = chain.mux.messages[-1]
        return bool(state.active == active and state.sources[0].reason.startswith(reason))

    chain.node.wait_for(reported, 5.0, reason)


def release(chain: Chain) -> None:
    """The stick goes through zero, and is held again: now it is followed."""
    chain.joystick.message = drive(0.0)
    chain.node.spin_for(0.2)
    chain.joystick.message = drive(0.2)
    chain.wait_for_order(0.2)


def test_a_stick_held_while_the_driver_latches_or_restarts_is_not_followed_before_a_zero(chain: Chain) -> None:
    chain.driver.message = LATCHED
    chain.node.spin_for(0.3)
    chain.driver.message = ENABLED  # the operator has reset it
    assert not followed(chain)
    wait_reason(chain, "waiting for zero (motor_driver is LATCHED)")
    release(chain)
    chain.driver.message = None  # the driver dies
    chain.node.wait_for(lambda: not chain.mux.messages[-1].ready, 2.0, "no driver")
    assert chain.mux.messages[-1].not_ready == "no recent message on motor_driver/status"
    assert not followed(chain)
    chain.driver.message = ENABLED
    assert not followed(chain)
    chain.joystick.message = None  # a radio gap of 0.45 s
    chain.node.spin_for(0.45)
    chain.joystick.message = drive(0.2)
    assert not followed(chain)
    wait_reason(chain, "waiting for zero (no recent message on motor_driver/status")
    release(chain)


def test_a_stick_held_over_the_emergency_stop_is_not_followed_before_a_zero(chain: Chain) -> None:
    chain.estop.message = Bool(data=True)
    chain.wait_for_cause(SafetyState.CAUSE_ESTOP)
    chain.estop.message = Bool(data=False)
    chain.node.spin_for(0.3)
    done, sentence = chain.reset()
    assert (done, sentence.split(";")[0]) == (False, "refused: joystick orders a velocity")
    chain.joystick.message = None  # a radio gap, in which the operator resets
    chain.node.spin_for(0.45)
    assert chain.reset()[0] is True
    chain.joystick.message = drive(0.2)
    assert not followed(chain)
    release(chain)


def test_scans_that_return_do_not_move_a_held_stick(chain: Chain) -> None:
    scan, chain.scan.message = chain.scan.message, None
    chain.wait_for_cause(SafetyState.CAUSE_SCAN_STALE)
    waiting = "waiting for zero (no usable scan for 1.0 s: scan_stale)"
    wait_reason(chain, waiting)  # somebody walks up to the base; nothing was stopped or reset
    chain.scan.message = scan
    chain.wait_for_cause(SafetyState.CAUSE_NONE)
    assert not followed(chain)
    wait_reason(chain, waiting)
    release(chain)


# both messages wait in the queue of the mux at once
def test_a_lock_that_opens_does_not_move_a_held_stick(chain: Chain) -> None:
    gate = chain.node.node.create_publisher(Bool, "gate_lock", 2)
    chain.node.wait_for_subscriber(gate, count=2)
    gate.publish(Bool(data=True))
    gate.publish(Bool(data=False))
    chain.node.spin_for(0.3)
    assert not followed(chain)
    wait_reason(chain, "waiting for zero (locked: gate holds)")
    release(chain)
    chain.node.node.destroy_publisher(gate)


def test_a_lock_with_two_publishers_holds(chain: Chain) -> None:
    gates = [chain.node.node.create_publisher(Bool, "gate_lock", 2) for _ in range(2)]
    for gate in gates:
        chain.node.wait_for_subscriber(gate, count=2)
    wait_reason(chain, "locked: gate has 2 publishers on gate_lock (", active="")
    for gate, locked in zip(gates, (True, False), strict=True):
        gate.publish(Bool(data=locked))
    chain.joystick.message = drive(0.0)
    chain.node.spin_for(0.2)
    chain.joystick.message = drive(0.2)
    assert not followed(chain)
    wait_reason(chain, "locked: gate has 2 publishers on gate_lock (", active="")
    for gate in gates:
        gate.publish(Bool(data=False))
        chain.node.node.destroy_publisher(gate)
    chain.node.spin_for(1.0)
    release(chain)


def test_while_two_nodes_publish_on_the_topic_of_a_stick_neither_is_followed(chain: Chain) -> None:
    second = chain.node.node.create_publisher(TwistStamped, "cmd_vel_joy", 2)
    chain.node.spin_for(1.0)
    for _ in range(5):
        second.publish(drive(0.0))
        assert not followed(chain, 0.2)
    wait_reason(chain, "2 publishers on cmd_vel_joy (")
    chain.node.node.destroy_publisher(second)
    chain.node.spin_for(1.0)
    assert not followed(chain)
    release(chain)


# armed ── the joystick's publisher ends ── 1 s ── another one with a pushed stick: not followed before a zero
def test_a_joystick_node_that_is_started_again_with_the_stick_held_is_not_followed(chain: Chain) -> None:
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
    wait_reason(chain, "waiting for zero (a publisher on cmd_vel_joy has ended)")
    release(chain)
