"""The whole computer: cold boot, a goal, a full disk, a reboot at speed, a frozen machine."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from dataclasses import asdict
from pathlib import Path
from typing import Final, NoReturn

from canbase.msg import DriverStatus

from exit_matrix import stop_limits as by
from vm.guest.robot import Robot
from vm.guest.scenario import Row, limit_s, timed
from vm.guest.shutdown_trace import FOLDER, MOMENT, WORDS
from vm.guest.standstill import Standstill, standstill
from vm.guest.system import PARTS, TARGET, BrokenPromiseError, run, set_priority, show, unit

GOAL_M: Final = 0.3
GOAL_ERROR_M: Final = 0.005
MEET_S: Final = 3.0
"""Until nodes that have just started know each other: that keeps this one processor busy, and odometry late."""
FILLER: Final = Path("/var/tmp/filler")
HARDWARE_PRIORITY, OURS, HOG = 98, 97, 90
"""SCHED_FIFO of the drives, which no computer can freeze, of this process, and of what freezes all others."""
LAST_SIGN: Final = FOLDER / "last_sign.json"
RESET_S: Final = (2.0, 12.0)
"""RuntimeWatchdogSec is 5 s: one that comes earlier has another cause, one that comes later is none."""


def cold_boot(robot: Robot) -> Row:
    """Nobody logs in, nobody types: the drives get power. Nothing listens for other computers."""
    robot.make_ready()  # an image that was made with --prefix has no records of stops yet: latched
    robot.wait("drives enabled", lambda: robot.state == DriverStatus.ENABLED)
    sockets = [line.split()[4] for line in run("ss", "-Htunl").splitlines()]
    if not sockets or any(not address.startswith(("127.0.0.", "[::1]")) for address in sockets):
        raise BrokenPromiseError(f"sockets listen on {sockets}")
    then = "drives enabled after the first reset; sockets on 127.0.0.1 alone"
    return Row("power on", "nobody logs in", again_s=_enabled_s(), then=then)


def goal(robot: Robot) -> Row:
    """A goal is driven and ends in a measured standstill."""
    robot.make_ready()
    return Row("drive_distance", f"a goal of {GOAL_M} m", again_s=_driven_s(robot), then="OK")


def full_disk(robot: Robot) -> Row:
    """No file can be written: a user has filled the disk, /var/log is read-only. All parts start anew.

    What ext4 keeps for root, 5 % unless somebody says otherwise, is free: systemd needs a folder in /tmp for a service.
    """
    robot.make_ready()
    logs = Path("/var/log")
    run("mount", "-t", "tmpfs", "-o", "ro", "unwritable", str(logs))
    try:
        _fill()
        run("systemctl", "restart", TARGET, *(unit(part) for part in PARTS))
        robot.make_ready()
        driven_s = _driven_s(robot)
    finally:
        FILLER.unlink(missing_ok=True)
        run("umount", "-l", str(logs))
    return Row("disk full, log unwritable", f"all restarted; a goal of {GOAL_M} m", again_s=driven_s, then="OK")


def reboot(robot: Robot) -> NoReturn:
    """`systemctl reboot` at speed. `after_reboot` tells the rest."""
    robot.make_ready()
    robot.drive()
    MOMENT.write_text(str(time.monotonic()))
    run("systemctl", "--no-block", "reboot")
    robot.spin(120.0)
    raise BrokenPromiseError("no reboot in 120 s")


def after_reboot(robot: Robot) -> Row:
    """What the drives saw until they lost power too; the robot is latched until a reset, and stands."""
    words = json.loads(WORDS.read_text())
    stop = Standstill(words["after_s"], words["way_m"])
    again_s = _up_and_still(robot)
    row = Row("computer", "reboot", again_s=again_s, then="latched until a reset, then drives enabled, stands")
    return timed(row, stop, limit_s(robot, (by.MUX_JOYSTICK, by.FILTER_SHUTDOWN, by.DRIVER_SHUTDOWN)), "systemd")


def freeze(robot: Robot) -> NoReturn:
    """No unit gets the processor any more, nor does systemd; only the drives go on. `after_freeze` tells the rest."""
    robot.make_ready()
    robot.drive()
    (drives,) = show("canbase-sim.service", "MainPID")
    set_priority(int(drives), HARDWARE_PRIORITY)
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(OURS))
    moment_s = time.monotonic()
    hog = subprocess.Popen(["/bin/sh", "-c", "while :; do :; done"], preexec_fn=_be_a_hog)
    while time.monotonic() < moment_s + 3.0 * RESET_S[1]:
        time.sleep(0.2)
        told = asdict(standstill(robot.sim.trace(moment_s), moment_s))
        LAST_SIGN.write_text(json.dumps(told | {"alive_s": time.monotonic() - moment_s}))
    hog.send_signal(signal.SIGKILL)
    raise BrokenPromiseError("the hardware watchdog did not reset the machine")


def after_freeze(robot: Robot) -> Row:
    """The drives had stopped by themselves; the machine was reset; the robot is latched until a reset, and stands."""
    sign = json.loads(LAST_SIGN.read_text())
    if not RESET_S[0] <= sign["alive_s"] <= RESET_S[1]:
        raise BrokenPromiseError(f"reset after {sign['alive_s']:.1f} s, expected one within {RESET_S} s")
    again_s = _up_and_still(robot)
    then = f"reset by the hardware watchdog after {sign['alive_s']:.1f} s; latched until a reset, then enabled, stands"
    row = Row("computer", "frozen", again_s=again_s, then=then)
    return timed(
        row, Standstill(sign["after_s"], sign["way_m"]), limit_s(robot, (by.DRIVES,)), "drives: heartbeat lost"
    )


def _be_a_hog() -> None:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(HOG))


def _up_and_still(robot: Robot) -> float:
    """The guest's disk is gone with each start, and the records of stops with it: latched, until a reset."""
    robot.stays_disarmed()
    robot.make_ready()
    robot.wait("drives enabled", lambda: robot.state == DriverStatus.ENABLED)
    enabled_s = _enabled_s()
    robot.spin(1.0)
    robot.stays(0.0)
    return enabled_s


def _enabled_s() -> float:
    """When the drives got power, since the kernel's start."""
    words = ("journalctl", "-b", "-o", "short-monotonic", "-u", unit("driver"), "-g", "ENABLED")
    return float(run(*words).splitlines()[0].split("]")[0].strip(" ["))


def _driven_s(robot: Robot) -> float:
    robot.spin(MEET_S)
    at_m = robot.truth().travel_m
    begun_s = time.monotonic()
    result = robot.goal(GOAL_M).wait(30.0)
    error_m = robot.truth().travel_m - at_m - GOAL_M
    if result is None or result.code.name != "OK" or abs(error_m) > GOAL_ERROR_M:
        raise BrokenPromiseError(f"{result}, really {error_m * 1000:+.1f} mm off")
    return time.monotonic() - begun_s


def _fill() -> None:
    """All that a user may write."""
    free = os.statvfs("/")
    size = free.f_bavail * free.f_frsize * 99 // 100
    run("setpriv", "--reuid=nobody", "--clear-groups", "fallocate", "-l", str(size), str(FILLER))
    run(
        "setpriv",
        "--reuid=nobody",
        "--clear-groups",
        "dd",
        "if=/dev/zero",
        f"of={FILLER}",
        "oflag=append",
        "conv=notrunc",
        check=False,
    )
    if os.statvfs("/").f_bavail:
        raise BrokenPromiseError(f"the disk is not full: {os.statvfs('/')}")
