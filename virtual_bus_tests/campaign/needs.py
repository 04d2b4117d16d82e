"""What each safeguard is needed for: the faults in which a property does not hold without it.

Each name of campaign/without.py has a row. Where several layers hold the same, each of them has a row with the others
`beside` it: without all of them the property does not hold, with this one alone it does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from campaign.robots import RELY_ON_OTHERS
from canbase_config.robot import Robot


def any_robot(robot: Robot) -> bool:
    """Every robot can show it."""
    return True


def relies_on_others(robot: Robot) -> bool:
    """Its drives do not watch the heartbeats of their masters."""
    return robot.drives[0].profile in RELY_ON_OTHERS


@dataclass(frozen=True, slots=True)
class Need:
    """One row. `faults`: those that scenarios are drawn from. `beside`: layers that hold the same, with + between."""

    safeguard: str
    faults: tuple[str, ...]
    beside: str = ""
    robots: Callable[[Robot], bool] = any_robot

    @property
    def taken_out(self) -> str:
        """All of it."""
        return f"{self.safeguard}+{self.beside}" if self.beside else self.safeguard


_SILENT = ("feedback_lost", "cable_cut_from_drives", "drive_silent")
_DRIVER_GONE = ("driver_dies", "driver_hangs")
_MAD = ("straight_to_cmd_vel", "driver_repeats", "driver_ignores_zero")

NEEDS: tuple[Need, ...] = (
    # watchdog: rows of canbase_watchdog.policy.CHECKS
    Need("watchdog:lease_lost", ("velocity_dies", "velocity_hangs", "lease_lost"), "driver:command_timeout"),
    Need(
        "watchdog:driver_silent", ("driver_dies", "driver_hangs"), "watchdog:target_outside+drives:heartbeat_consumer"
    ),
    Need("watchdog:drive_silent", _SILENT, "driver:drive_silent"),
    Need("watchdog:target_outside", _MAD),
    Need("watchdog:motion_missing", ("encoder_lost", "wheel_blocked", "stick_held")),
    Need("watchdog:twist_outside", ("wheel_limited", "motor_weak", "stick_held")),
    Need("watchdog:all", (*_MAD, "lease_lost")),
    Need("watchdog:latch", ("velocity_hangs", "lease_lost", "driver_hangs")),
    # driver
    Need("driver:latch", ("watchdog_hangs", "drive_fault")),
    Need("driver:asks_for_watchdog", ("watchdog_dies", "watchdog_hangs"), "drives:heartbeat_consumer"),
    Need("driver:watchdog_missing", ("watchdog_dies", "watchdog_hangs"), "drives:heartbeat_consumer"),
    Need("driver:command_timeout", ("velocity_dies", "velocity_hangs"), "watchdog:lease_lost"),
    Need("driver:stop_record", ("driver_dies", "drive_fault", "all_processes_restart")),
    # drives
    Need("drives:heartbeat_consumer", ("cable_cut", "cable_cut_to_drives", "cable_cut_one_drive")),
    # velocity
    Need("mux:timeout", ("action_dies", "action_hangs")),
    Need("mux:neutral_start", ("estop_pressed", "stick_held"), "filter:zero_after_estop"),
    Need("filter:zero_after_estop", ("estop_pressed", "stick_held"), "mux:neutral_start"),
    Need("filter:command", ("mux_lossy",)),
    Need("filter:estop", ("estop_pressed", "estop_stale")),
    Need("filter:obstacle", ("obstacle",)),
    Need("filter:blind", ("scanner_blind_ahead", "scanner_one_beam", "scanner_zero_ahead")),
    Need("filter:frozen", ("scanner_frozen", "scanner_by_turns")),
)
