"""A joystick behind a network that holds its messages back: a relay process between the joystick and the mux, over DDS.

stick      0.2 ────────────┐ 0
relay      0.2 ──── 2 s ───────────────┐ 0      all messages, in order, with their stamps
ordered    0.2 ───┐ 0                           not followed from the moment on when they are late

Shorter delays, and a network that recovers: unit/velocity/test_delay.py.
"""

from __future__ import annotations

import time

import pytest
from geometry_msgs.msg import TwistStamped
from std_msgs.msg import Float64

from ros.conftest import Spawn
from support.ros_harness import Repeater
from support.velocity_chain import START_S, Chain, drive

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

DELAY_S = 2.0
RELAY = """
import collections, time
import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from std_msgs.msg import Float64

rclpy.init()
node = Node("network")
out = node.create_publisher(TwistStamped, "cmd_vel_joy", 1)
held, delay_s = collections.deque(), [0.0]
node.create_subscription(TwistStamped, "stick", lambda message: held.append((time.monotonic(), message)), 100)
node.create_subscription(Float64, "delay", lambda message: delay_s.__setitem__(0, message.data), 1)

def pass_on():
    while held and time.monotonic() - held[0][0] >= delay_s[0]:
        out.publish(held.popleft()[1])

node.create_timer(0.005, pass_on)
rclpy.spin(node)
"""


@pytest.fixture
def delayed(chain: Chain, spawn: Spawn) -> Chain:
    """The joystick drives at 0.2 m/s through a network that is still in time.

    Whoever takes the place of another publisher needs a zero after the mux has seen that, which DDS tells it late.
    """
    chain.node.node.destroy_publisher(chain.joystick.publisher)
    chain.joystick = stick(chain)
    spawn(RELAY)
    chain.node.wait_for_subscriber(chain.joystick.publisher, START_S)
    chain.node.wait_for(lambda: chain.node.node.count_publishers("cmd_vel_joy") == 1, START_S, "the relay alone")
    chain.joystick.message = drive(0.2)
    chain.node.wait_for(lambda: "has ended" in reason(chain), START_S, "the mux to see that a publisher has ended")
    chain.node.release(chain.joystick)
    chain.joystick.message = drive(0.2)
    chain.wait_for_order(0.2, START_S)
    return chain


def reason(chain: Chain) -> str:
    """Why the joystick is not followed, as the mux says; empty: it is, or nobody orders anything."""
    last = chain.mux.last
    return next((source.reason for source in last.sources if source.name == "joystick"), "") if last else ""


def stick(chain: Chain) -> Repeater[TwistStamped]:
    """Stamped, 50 times a second."""
    made = chain.node.repeat(TwistStamped, "stick", 50.0, 100)

    def prepare(message: TwistStamped) -> TwistStamped:
        fresh = TwistStamped(twist=message.twist)
        fresh.header.stamp = chain.node.node.get_clock().now().to_msg()
        return fresh

    made.prepare = prepare
    return made


def delay(chain: Chain, seconds: float) -> None:
    """From now on the network holds each message back for so long."""
    publisher = chain.node.node.create_publisher(Float64, "delay", 1)
    chain.node.wait_for_subscriber(publisher, START_S)
    publisher.publish(Float64(data=seconds))


def test_the_release_of_a_stick_whose_messages_come_two_seconds_late_does_not_take_two_seconds(delayed: Chain) -> None:
    delay(delayed, DELAY_S)
    began_s = time.monotonic()
    assert delayed.wait_for_order(0.0, 1.5) < 1.0  # the gap: nothing comes for 2 s
    delayed.node.spin_for(DELAY_S + 0.3 - (time.monotonic() - began_s))
    delayed.orders.clear()
    delayed.node.spin_for(1.0)  # late messages come 50 times a second now, each orders 0.2 m/s
    assert delayed.joystick.sent > 100
    assert {order.twist.linear.x for order in delayed.orders.messages} == {0.0}
    assert delayed.mux.last is not None
    assert delayed.mux.last.sources[0].reason.startswith("delayed by 2.")
    delayed.joystick.message = drive(0.0)  # released: nothing moves, although 0.2 m/s comes for 2 s more
    delayed.orders.clear()
    delayed.node.spin_for(DELAY_S + 0.5)
    assert {order.twist.linear.x for order in delayed.orders.messages} == {0.0}
