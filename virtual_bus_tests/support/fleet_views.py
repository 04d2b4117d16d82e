"""A healthy robot as a fleet sees it, and the same with something else about it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from canbase.msg import DriverStatus, DriveStatus, MuxLock, MuxSource, MuxState, SafetyState, ScannerState

from canbase_config.load import load_robot, sample
from canbase_config.mux import MuxLock as LockKeys
from canbase_config.robot import Robot
from canbase_fleet.robot_view import RobotView
from canbase_runtime.last_message import LastMessage


def _robot() -> Robot:
    robot = load_robot(sample("bench")).robot
    locks = {"pause": LockKeys(topic="pause", priority=200, timeout_s=0.5)}
    return robot.model_copy(update={"mux": robot.mux.model_copy(update={"locks": locks})})


ROBOT = _robot()
"""The bench with a lock."""


def drive(joint: str = "left_wheel", **changes: Any) -> DriveStatus:
    """One that is enabled and well."""
    well: dict[str, Any] = {
        "joint": joint, "node_id": 1, "nmt_state": "operational", "state": "operation enabled", "statusword": 0x637,
        "target_radps": 1.0, "velocity_radps": 0.9, "feedback_age_s": 0.01, "heartbeat_age_s": 0.1, "voltage_v": 24.0,
        "current_a": math.nan, "temperature_c": 40.0, "torque_share": 0.1, "stops_by_itself": True,
    }  # fmt: skip
    return DriveStatus(**(well | changes))


def driver(age_s: float | None = 0.1, **changes: Any) -> LastMessage:
    """motor_driver/status."""
    well: dict[str, Any] = {
        "state": DriverStatus.ENABLED, "cause": "none", "watchdog": "ok", "watchdog_cause": "none",
        "watchdog_age_s": 0.02, "watchdog_lease_age_s": 0.01, "watchdog_pause_max_s": 0.005, "command_age_s": 0.01,
        "command_fresh": True, "cycles": 1000, "overruns": 2, "cycle_lateness_max_s": 0.0005,
        "controller": "error active", "bus_load": 0.2, "drives": [drive(), drive("right_wheel", node_id=2)],
    }  # fmt: skip
    return LastMessage(DriverStatus(**(well | changes)), age_s)


def safety(age_s: float | None = 0.1, **changes: Any) -> LastMessage:
    """safety_filter/state."""
    scanner = ScannerState(topic="scan", required=True, fresh=True, age_s=0.05, usable_share=0.9, dropped=1)
    well: dict[str, Any] = {
        "action": SafetyState.PASS, "cause": "none", "clearance_ahead_m": 3.0, "clearance_behind_m": math.inf,
        "command_age_s": 0.01, "scan_age_s": 0.05, "ordered_linear_mps": 0.3, "scanners": [scanner],
    }  # fmt: skip
    return LastMessage(SafetyState(**(well | changes)), age_s)


def mux(age_s: float | None = 0.1, **changes: Any) -> LastMessage:
    """velocity_mux/state."""
    sources = [
        MuxSource(name="joystick", topic="cmd_vel_joy", priority=100, active=True, armed=True, age_s=0.01,
                  delay_s=math.nan, received=50, refused=1, standing=MuxSource.FOLLOWED),
        MuxSource(name="action", topic="cmd_vel_action", age_s=math.nan, delay_s=math.nan,
                  standing=MuxSource.NEVER_RECEIVED, reason="never received"),
    ]  # fmt: skip
    locks = [MuxLock(name="pause", topic="pause", priority=200, standing=MuxLock.FREE)]
    well: dict[str, Any] = {"active": "joystick", "ready": True, "sources": sources, "locks": locks}
    return LastMessage(MuxState(**(well | changes)), age_s)


def well(**changes: Any) -> RobotView:
    """A robot that drives, but for the changes."""
    return replace(RobotView(driver(), safety(), mux(), {("watchdog", "overspeed"): 2}), **changes)
