"""A latched stop outlives its processes, for real: killed, started again, all of them at once as in a reboot."""

from __future__ import annotations

import signal
import time

import pytest
from canbase.msg import DriverStatus

from support.running_robot import RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(200)]

QUIET_S = 2.0


def kill(robot: RunningRobot, *parts: str) -> None:
    """All of them at once, then each is started again."""
    for part in parts:
        robot.send(part, signal.SIGKILL)
    for part in parts:
        assert robot.stack.end(part) == -signal.SIGKILL
    robot.status.clear()
    robot.stack.start()


def stays_latched(robot: RunningRobot, cause: str) -> None:
    """Started again it is latched for that cause, and stays so; then a reset frees it."""
    robot.wait_state(DriverStatus.LATCHED)
    began_s = time.monotonic()
    assert robot.moved_since(began_s, QUIET_S) < RESTS_M
    status = robot.wait_state(DriverStatus.LATCHED)
    assert cause in f"{status.cause}: {status.detail}", status
    assert all(each.state == DriverStatus.LATCHED for each in robot.status.since(began_s))
    robot.make_ready()
    robot.wait_whole()  # goals wait until DDS has given up what was killed


# `canbase stop` ── SIGKILL of the driver ── start: still latched ── reset ── drives
def test_a_stop_outlives_its_driver_and_a_reboot() -> None:
    with own_domain() as domain, robot_on(domain) as robot:
        assert robot.run("stop") == 0
        robot.wait_state(DriverStatus.LATCHED)
        kill(robot, "driver")
        stays_latched(robot, "latched since before the start: service motor_driver/stop")
        assert robot.run("stop") == 0
        robot.wait_state(DriverStatus.LATCHED)
        kill(robot, "driver", "watchdog", "velocity", "action-server")
        stays_latched(robot, "latched since before the start: service motor_driver/stop")


# driving ── SIGKILL of driver and watchdog at once ── start: latched ── reset ── drives
def test_driver_and_watchdog_killed_with_power_come_back_latched() -> None:
    with own_domain() as domain, robot_on(domain) as robot:
        robot.goal(4.0, 0.3)
        robot.wait_speed(0.29)
        kill(robot, "driver", "watchdog")
        stays_latched(robot, "it ended while there was power")


# SIGTERM in order ── start ── drives, without a reset
def test_an_orderly_end_leaves_nothing_latched() -> None:
    with own_domain() as domain, robot_on(domain) as robot:
        assert set(robot.stack.stop().values()) == {0}
        robot.status.clear()
        robot.stack.start()
        robot.wait_enabled()
        assert all(status.state != DriverStatus.LATCHED for status in robot.status.messages)
