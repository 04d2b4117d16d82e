"""A driver that was killed and is started again waits for a reset. Every other way out: test_exit_matrix.py."""

from __future__ import annotations

import signal
import time

import pytest
from canbase.msg import DriverStatus

from support.running_robot import RESTS_M, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(150)]

QUIET_S = 2.0


def test_a_driver_that_was_killed_can_be_started_again() -> None:
    with own_domain() as domain, robot_on(domain) as robot:
        robot.goal(4.0, 0.3)
        robot.wait_speed(0.29)
        robot.send("driver", signal.SIGKILL)
        robot.wait_standing()
        assert robot.stack.end("driver") == -signal.SIGKILL
        started_s = time.monotonic()
        robot.stack.start()
        robot.node.wait_for(lambda: robot.status.since(started_s), 20.0, "the new driver")
        assert robot.moved_since(started_s, QUIET_S) < RESTS_M
        assert robot.status.messages[-1].state != DriverStatus.ENABLED  # the watchdog has tripped: that needs a reset
        robot.make_ready()
        robot.wait_whole()  # goals wait until DDS has given up what was killed
