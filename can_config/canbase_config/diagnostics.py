"""The entries of /diagnostics by name and hardware id: those who publish them and an aggregator share them. Pure.

An entry is called "<robot>: <part>", so that the entries of several robots in one ROS graph stay apart.
"""

from __future__ import annotations

from typing import Final

from canbase_config.drive import Drive
from canbase_config.robot import Robot

PERIOD_S: Final = 1.0
"""Between two messages of a node."""
TIMEOUT_S: Final = 5.0
"""After so long without a message an entry is stale; the usual value of diagnostic_aggregator."""
MOTOR_DRIVER, BUS, WATCHDOG = "motor_driver", "bus", "watchdog"
"""Published by motor_driver, as are the drives; the watchdog has no ROS."""
VELOCITY_MUX, SAFETY_FILTER = "velocity_mux", "safety_filter"
GROUPS: Final = {"Driver": (MOTOR_DRIVER, BUS), "Safety": (WATCHDOG, SAFETY_FILTER, VELOCITY_MUX)}
"""The parts in groups. The drives are a third one."""
DRIVES: Final = "Drives"


def entry_name(robot: str, part: str) -> str:
    """The name of the entry of a part."""
    return f"{robot}: {part}"


def drive_prefix(robot: str) -> str:
    """What the names of all drives of a robot begin with; the joint follows."""
    return entry_name(robot, "drive ")


def drive_name(robot: str, joint: str) -> str:
    """The name of the entry of a drive."""
    return drive_prefix(robot) + joint


def entry_names(robot: Robot) -> tuple[str, ...]:
    """Every entry that the robot publishes."""
    parts = (entry_name(robot.name, part) for group in GROUPS.values() for part in group)
    return *parts, *(drive_name(robot.name, drive.joint) for drive in robot.drives)


def hardware_id(robot: str, drive: Drive) -> str:
    """Which piece of hardware an axis is. With vendor, product and serial number in robot.yaml it is the device
    itself, whatever robot it is in; the boot compares them (1018h). Else its place: robot, node and axis.
    """
    device = drive.identity.vendor_id, drive.identity.product_code, drive.identity.serial
    if None in device:
        return f"{robot} node {drive.node_id} axis {drive.axis}"
    return f"{':'.join(f'{number:08X}' for number in device)} axis {drive.axis}"
