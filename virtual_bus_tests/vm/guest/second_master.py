"""CANopenNode's gateway (CiA 309-3) on the bus of a canbase that drives: as long as it reads, nothing happens; when it
writes a setpoint, or takes a drive out of NMT operational, it is a second master, and the watchdog stops the base.
"""

from __future__ import annotations

import time
from typing import Final

from canbase.msg import DriverStatus

from exit_matrix import stop_limits as by
from vm.guest.canopennode import MASTER, Gateway, gateway, targets
from vm.guest.robot import SPEED_MPS, Robot
from vm.guest.scenario import LATCHED, Row, judged
from vm.guest.system import BrokenPromiseError

BUS: Final = "can1"
"""The controller of the simulated drives: all that canbase receives of the gateway comes over the bus."""
READS: Final = (
    ("1 r 0x1008 0 vs", '"canbase simulated drive"'),
    ("2 r 0x1018 1 x32", "0x00000000"),
    ("1 r 0x6041 0 u16", ""),
    ("2 r 0x606C 0 i32", ""),
    ("1 r 0x6064 0 i32", ""),
)
"""Commands and how their answers begin; of what changes at speed, no value is expected."""
FOR_S: Final = 2.0
"""So long it reads."""


def writes_a_setpoint(robot: Robot) -> Row:
    """It sends its boot-up, its heartbeat and an EMCY, reads from both drives at speed, then writes 60FFh: backward."""
    backward = -next(targets(robot.config))
    return _interferes(robot, f"1 w 0x60FF 0 i32 {backward}", "reads at speed, then writes 60FFh")


def takes_a_drive_out(robot: Robot) -> Row:
    """NMT pre-operational: the drive processes no PDO any more, neither setpoints nor the watchdog's quick stop."""
    return _interferes(robot, "1 preop", "reads at speed, then NMT pre-operational")


def _interferes(robot: Robot, command: str, how: str) -> Row:
    robot.make_ready()
    with gateway(robot, BUS) as commands:
        commands.gets(f"{MASTER} w 0x1017 0 u16 100", "OK")
        robot.drive()
        reads = _reads(robot, commands)
        moment_s = time.monotonic()
        commands.gets(command, "OK")
        stop = robot.stands(moment_s)
        robot.stays_disarmed()
    robot.order(None)
    row = Row("CANopenNode beside canbase", how, then=f"{reads} reads; {LATCHED}")
    return judged(row, robot, moment_s, stop, (by.WATCHDOG_FOREIGN,))


def _reads(robot: Robot, commands: Gateway) -> int:
    """How often it has read. Raises BrokenPromiseError when the base does not drive on."""
    reads, until_s = 0, time.monotonic() + FOR_S
    while time.monotonic() < until_s:
        for command, answer in READS:
            commands.gets(command, answer)
            reads += 1
            robot.spin(0.05)
    speed_mps = robot.truth().linear_mps
    if robot.state != DriverStatus.ENABLED or speed_mps < 0.97 * SPEED_MPS:
        raise BrokenPromiseError(f"reading stops it: {speed_mps:.3f} m/s; driver: {robot.told()}")
    return reads
