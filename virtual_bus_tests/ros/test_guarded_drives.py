"""A robot of guarded drives as real processes: the watchdog's remote frames keep it driving, and nothing else does."""

from __future__ import annotations

import signal

import pytest
from canbase.msg import DriverStatus

from canbase_config.watchdog import LIFE_TIME_FACTOR, guard_time_ms
from support.crews import robot_with
from support.running_robot import PATIENT, RunningRobot, own_domain, robot_on
from support.velocity_chain import drive

pytestmark = [pytest.mark.ros, pytest.mark.timeout(200)]
GUARDED = [drive.model_dump(exclude_none=True) for drive in robot_with("technosoft").drives]
LATE_S = 1.0
"""Processes that wait for a processor."""


def said_by_the_drives(robot: RunningRobot) -> str:
    return (robot.folder / "sim.log").read_text(errors="replace")


# driving ── SIGKILL of driver and watchdog ── their guard is missed ── stands ── start: latched ── reset ── drives
def test_guarded_drives_stop_when_the_watchdog_dies_and_drive_again_after_a_reset() -> None:
    with own_domain() as domain, robot_on(domain, changes={**PATIENT, "drives": GUARDED}) as robot:
        assert "life guarding lost" not in said_by_the_drives(robot)
        robot.goal(4.0, 0.3)
        robot.wait_speed(0.29)
        moment_s = robot.send("watchdog", signal.SIGKILL)
        robot.send("driver", signal.SIGKILL)
        robot.wait_standing()
        limits, timeouts = robot.robot.limits, robot.robot.timeouts
        life_s = LIFE_TIME_FACTOR * guard_time_ms(timeouts.drive_heartbeat_s) / 1000.0
        assert robot.standstill_after(moment_s).after_s < life_s + 0.3 / limits.emergency_deceleration_mps2 + LATE_S
        assert "life guarding lost" in said_by_the_drives(robot)
        for part in ("watchdog", "driver"):
            assert robot.stack.end(part) == -signal.SIGKILL
        robot.status.clear()
        robot.stack.start()
        robot.wait_state(DriverStatus.LATCHED)
        robot.make_ready()
        joystick = robot.node.source()  # goals wait until DDS has given up what was killed
        joystick.message = drive(0.1)
        robot.wait_speed(0.09)
