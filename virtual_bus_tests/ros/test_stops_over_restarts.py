"""A latched stop outlives its processes, for real: killed, started again, all of them at once as in a reboot."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator

import pytest
from canbase.msg import DriverStatus

from support.running_robot import RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(200)]

QUIET_S = 2.0


@pytest.fixture(scope="module")
def robot() -> Iterator[RunningRobot]:
    """The robot of all tests, in their order; each leaves it enabled."""
    with own_domain() as domain, robot_on(domain) as running:
        yield running


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


# driving ── SIGKILL of driver and watchdog at once ── start: latched ── reset ── power
def test_driver_and_watchdog_killed_with_power_come_back_latched(robot: RunningRobot) -> None:
    robot.goal(4.0, 0.3)
    robot.wait_speed(0.29)
    kill(robot, "driver", "watchdog")
    stays_latched(robot, "it ended while there was power")


# `canbase stop` ── SIGKILL of all, as in a reboot ── start: still latched ── reset ── power
def test_a_stop_outlives_its_driver_and_a_reboot(robot: RunningRobot) -> None:
    assert robot.run("stop") == 0
    robot.wait_state(DriverStatus.LATCHED)
    kill(robot, "driver", "watchdog", "velocity", "action-server")
    stays_latched(robot, "latched since before the start: service motor_driver/stop")


# SIGTERM in order ── start ── power, without a reset
def test_an_orderly_end_leaves_nothing_latched(robot: RunningRobot) -> None:
    assert set(robot.stack.stop().values()) == {0}
    robot.status.clear()
    robot.stack.start()
    robot.wait_enabled()
    assert all(status.state != DriverStatus.LATCHED for status in robot.status.messages)
