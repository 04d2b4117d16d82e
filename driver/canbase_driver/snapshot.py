"""What the driver knows at one moment, as plain frozen data: one report of each of its parts, put together by the core.

No ROS, no behaviour; `ros/messages.py` makes messages of it. SI units at the wheel and the base; ages are local
monotonic seconds, NaN: nothing received yet. A new counter is one line in the report of its part, and in the message.
"""

from __future__ import annotations

from dataclasses import dataclass

from canbase_driver.causes import Finding
from canbase_driver.drives.drive_snapshot import DriveSnapshot
from canbase_driver.drives.odometry_feed import OdometryReport
from canbase_driver.motion.velocity_command import CommandReport
from canbase_driver.supervision.bus_health import BusReport
from canbase_driver.supervision.cycle_stats import CycleReport
from canbase_driver.supervision.watchdog_link import WatchdogReport
from canbase_runtime.driver_state import DriverState


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverSnapshot:
    """The driver, its drives, the watchdog as it sees it, and the base's pose and motion."""

    time_s: float
    """Local monotonic time of the snapshot [s]."""
    state: DriverState
    finding: Finding
    """Why it is not ENABLED; its cause is NONE when it is."""
    standstill: bool
    """All wheels are at standstill, by encoder and velocity; or that is assumed."""
    standstill_assumed: str = ""
    """Why it is assumed and not measured, for /diagnostics; empty: it is measured, or a wheel turns."""
    watchdog: WatchdogReport
    command: CommandReport
    cycle: CycleReport
    bus: BusReport
    odometry: OdometryReport
    drives: tuple[DriveSnapshot, ...]
    """In the order of robot.yaml."""
