"""A latched stop outlives its processes, for real: killed, started again, all of them at once as in a reboot."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator

import pytest
from canbase.msg import DriverStatus

from support.running_robot import PATIENT, RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(200)]

QUIET_S = 2.0
STANDS_AFTER_S = PATIENT["timeouts"]["drive_heartbeat_s"] + 1.0
"""With driver and watchdog killed, the drives stop by 1016h; then their ramp, and a loaded computer [s]."""


@pytest.fixture(scope="module")
def robot() -> Iterator[RunningRobot]:
    """The robot of all tests, in their order; each leaves it enabled."""
    with own_domain() as domain, robot_on(domain) as running:
        yield running


def kill(robot: RunningRobot, *parts: str) -> float:
    """All of them at once, then each is started again; when they were killed (time.monotonic)."""
    killed_s = time.monotonic()
    for part in parts:
        robot.send(part, signal.SIGKILL)
    for part in parts:
        assert robot.stack.end(part) == -signal.SIGKILL
    robot.status.clear()
    robot.stack.start()
    return killed_s


def stays_latched(robot: RunningRobot, cause: str) -> None:
    """Started again it is latched for that cause, and stays so; then a reset frees it."""
    robot.wait_state(DriverStatus.LATCHED)
    began_s = time.monotonic()
    assert robot.moved_since(began_s, QUIET_S) < RESTS_M
    status = robot.wait_state(DriverStatus.LATCHED)
    assert cause in f"{status.cause}: {status.detail}", status
    assert all(each.state == DriverStatus.LATCHED for each in robot.status.since(began_s))
    robot.make_ready()


# driving ── SIGKILL of driver and watchdog at once ── 1016h: standstill ── start: latched ── reset ── power
def test_driver_and_watchdog_killed_with_power_come_back_latched(robot: RunningRobot) -> None:
    robot.goal(4.0, 0.3)
    robot.wait_speed(0.29)
    killed_s = kill(robot, "driver", "watchdog")
    robot.wait_standing()
    assert robot.standstill_after(killed_s).after_s < STANDS_AFTER_S
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
