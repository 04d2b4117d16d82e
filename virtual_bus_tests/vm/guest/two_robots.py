"""Two robots on one computer, installed side by side: both drive at once, and neither notices the other.

The second one is on a virtual interface, its simulated drives on the same one.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Final

from canbase.msg import DriverStatus

from vm.guest.integrator import CANBASE, STOP
from vm.guest.robot import SPEED_MPS, Robot
from vm.guest.scenario import Row
from vm.guest.system import PARTS, ROBOT_YAML, BrokenPromiseError, pids, run, show, unit

NAME: Final = "robot2"
BUS: Final = "vcan0"
CONFIG: Final = Path(f"/run/{NAME}.yaml")
CONTROL: Final = f"/run/sim_{NAME}.sock"
DRIVES: Final = f"{NAME}-drives.service"


def two_robots(robot: Robot) -> Row:
    """One is stopped by its watchdog, then uninstalled, while the other one drives on."""
    robot.make_ready()
    _second_is_installed()
    _say("the second is installed")
    try:
        second = Robot(f"{NAME}/", robot, CONTROL)
        second.make_ready()
        _say("both are ready")
        robot.make_ready()
        first = pids()
        for each in (robot, second):
            each.drive()
        robot.spin(1.0)
        _drive_on(robot, second)
        moment_s = time.monotonic()
        _say("both drive")
        run(*STOP, f"/run/canbase/{NAME}/stop.json")
        second.stands(moment_s)
        robot.spin(1.0)
        _drive_on(robot)
        second.stays_disarmed()
        second.order(None)
        second.make_ready()
        second.drive()
        _say("the second drives again")
        run(*CANBASE, "setup", "uninstall", NAME, "--purge")
        _say("the second is uninstalled")
        _drive_on(robot)
        _is_gone(robot)
        if pids() != first:
            raise BrokenPromiseError("a part of the first robot was started again")
    finally:
        robot.order(None)
        run("systemctl", "stop", DRIVES, check=False)
        run("ip", "link", "del", BUS, check=False)
    how = "both drive; the second is stopped, then uninstalled"
    return Row("two robots", how, then="the first drives on")


def _second_is_installed() -> None:
    text = ROBOT_YAML.read_text().replace("name: robot", f"name: {NAME}").replace("channel: can0", f"channel: {BUS}")
    CONFIG.write_text(text.replace("/run/canbase/robot/lease.sock", f"/run/canbase/{NAME}/lease.sock"))
    run("ip", "link", "add", BUS, "type", "vcan")
    run("ip", "link", "set", BUS, "up")
    fifo = ("-p", "CPUSchedulingPolicy=fifo", "-p", "CPUSchedulingPriority=60")
    environment = ("--setenv=_ROS_WHEELS_BOOTSTRAP_COMPLETE=1", "--setenv=PYTHONUNBUFFERED=1")
    sim = (*CANBASE, "serve", "sim", "--config", str(CONFIG), "--control", CONTROL)
    run("systemd-run", f"--unit={DRIVES}", *fifo, *environment, *sim)
    run(*CANBASE, "setup", "install", "--config", str(CONFIG), "--no-can", "--namespace", NAME)
    run("systemctl", "start", f"canbase@{NAME}.target")


def _say(what: str) -> None:
    """The host takes a guest that is silent for long for dead, and no scenario takes longer than this one."""
    print(what, flush=True)


def _drive_on(*robots: Robot) -> None:
    for each in robots:
        each.spin(0.2)
        speed_mps = each.truth().linear_mps
        if each.state != DriverStatus.ENABLED or speed_mps < 0.97 * SPEED_MPS:
            raise BrokenPromiseError(f"does not drive on: {speed_mps:.3f} m/s; driver: {each.told()}")


def _is_gone(robot: Robot) -> None:
    """Its units and files; those of the first robot, which it shared, are there."""
    robot.wait("its end", lambda: pids(NAME) == ["0"] * len(PARTS))
    left = [str(path) for path in Path("/etc").rglob(f"*{NAME}*")]
    if left:
        raise BrokenPromiseError(f"canbase setup uninstall {NAME} --purge leaves {left}")
    for part in PARTS:
        if show(unit(part), "ActiveState") != ["active"]:
            raise BrokenPromiseError(f"{unit(part)} ended with the other robot")
    if not Path("/etc/systemd/system/canbase-driver@.service.d/00-hardening.conf").exists():
        raise BrokenPromiseError("the sandbox went with the other robot")
