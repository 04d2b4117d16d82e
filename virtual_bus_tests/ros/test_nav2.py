"""What a controller of Nav2 publishes, through mux and filter: a stream at 20 Hz with its bursts, gaps, zeros and ways
back. The sample is synthesised after controller_server, velocity_smoother and the behaviours (spin, back up).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from canbase.msg import DriverStatus, MuxState
from geometry_msgs.msg import Twist, TwistStamped

from support.ros_harness import Process, TestNode

pytestmark = [pytest.mark.ros, pytest.mark.timeout(60)]
START_S = 20.0
PERIOD_S = 0.05
RUN = """
import sys
from canbase_config.load import load_robot
from canbase_velocity.main import run
from pathlib import Path
sys.exit(run(load_robot(Path({path!r})).robot, []))
"""
Sample = tuple[float, float, float]


def controller() -> Iterator[Sample]:
    """(seconds to wait, forward speed, turning speed), as cmd_vel_nav carries them."""
    for step in range(20):  # regulated pure pursuit: speeds up into a curve
        yield PERIOD_S, min(0.3, 0.02 * step), 0.2 * math.sin(step / 5.0)
    yield 0.12, 0.3, 0.1  # a late cycle of the controller …
    for _ in range(3):
        yield 0.001, 0.28, 0.1  # … and what it makes up for, in a burst
    yield 0.4, 0.25, 0.0  # a gap within the timeout of the source, 0.5 s
    for step in range(10):  # rotate to heading: no forward speed at all
        yield PERIOD_S, 0.0, 0.6 - 0.05 * step
    for _ in range(6):  # back up
        yield PERIOD_S, -0.05, 0.0
    for _ in range(4):  # the smoother ends with zeros
        yield PERIOD_S, 0.0, 0.0


def test_a_stream_of_a_controller_is_followed_on_cmd_vel(
    spawn: Callable[..., Process],
    make_robot: Callable[[Mapping[str, Any]], Path],
    test_node: TestNode,
) -> None:
    navigation = {"topic": "cmd_vel_nav", "priority": 50, "timeout_s": 0.5, "stamped": False}
    changes = {"safety": {"scan": {"required": False}}, "mux": {"sources": {"navigation": navigation}}}
    spawn(RUN.format(path=str(make_robot(changes))))
    publisher = test_node.node.create_publisher(Twist, "cmd_vel_nav", 1)  # TwistStamped: test_nav2_wiring.py
    orders = test_node.record(TwistStamped, "cmd_vel")
    mux = test_node.record(MuxState, "velocity_mux/state")
    test_node.wait_for(lambda: publisher.get_subscription_count() == 1 and orders.messages, START_S, "mux and filter")
    driver = test_node.repeat(DriverStatus, "motor_driver/status", 20.0, owner="motor_driver")
    driver.message = DriverStatus(state=DriverStatus.ENABLED)
    test_node.wait_for(lambda: mux.last is not None and mux.last.sources[0].armed, START_S, "2 s of silence")
    asked: list[tuple[float, float]] = []
    began_s = time.monotonic()
    for wait_s, linear_mps, angular_radps in controller():
        test_node.spin_for(wait_s)
        message = Twist()
        message.linear.x, message.angular.z = linear_mps, angular_radps
        publisher.publish(message)
        asked.append((linear_mps, angular_radps))
    test_node.spin_for(0.1)
    got = [(order.twist.linear.x, order.twist.angular.z) for order in orders.since(began_s)]
    assert set(got) <= {*asked, (0.0, 0.0)}, "an order that nobody asked for"
    single = [each for each in asked if each not in ((0.28, 0.1),)]
    missed = set(single) - set(got)
    assert len(missed) <= 2, missed  # depth 1: only what comes faster than it is read may be passed over
    firsts = [got.index(each) for each in dict.fromkeys(single[:20]) if each in got and each != (0.0, 0.0)]
    assert firsts == sorted(firsts)
    assert got[-1] == (0.0, 0.0)
    gap = [each for each in got if each == (0.25, 0.0) or each == (0.28, 0.1)]
    assert len(gap) > 10, "the gap is bridged by repeating what holds"
    test_node.wait_for(lambda: mux.messages[-1].active == "", 3.0, "silence after the last command")
