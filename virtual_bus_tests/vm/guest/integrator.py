"""What an integrator reads and runs on the robot: journal, support bundle and doctor, install again, uninstall."""

from __future__ import annotations

import json
import os
import re
import sys
import tarfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from canbase.msg import DriverStatus

from canbase_commissioning.can_interface import parse_link
from canbase_driver.supervision.bus_health import ControllerState
from vm.guest.robot import Robot
from vm.guest.scenario import Row
from vm.guest.system import PARTS, ROBOT_YAML, TARGET, BrokenPromiseError, pids, run, show, unit

CANBASE: Final = (sys.executable, "-m", "canbase_cli")
STOP: Final = ("env", "_ROS_WHEELS_BOOTSTRAP_COMPLETE=1", sys.executable, "-m", "canbase_watchdog.post_stop")
STOP_FILE: Final = "/run/canbase/robot/stop.json"
WARNING, NOTICE, INFO = "4", "5", "6"
"""Priorities of syslog, as the journal writes them."""
BUNDLE: Final = Path("/mnt/support-bundle.tar.gz")
"""In the host's folder, for people to look at."""
NOT_HERE: Final = {"system/usb.txt"}
"""The guest has no lsusb."""
MANIFEST: Final = Path("/etc/canbase/installed/robot.txt")
KEPT: Final = {ROBOT_YAML, ROBOT_YAML.with_suffix(".env")}
"""The owner's own files, which `canbase setup uninstall` leaves: docs/services.md."""
OPTIONS: Final = ("--hardware-watchdog", "5")
"""overlay.py installs with them."""

SANDBOX: Final = {
    "NoNewPrivileges": "yes",
    "PrivateTmp": "yes",
    "ProtectHome": "yes",
    "ProtectSystem": "strict",
    "RemoveIPC": "yes",
    "CapabilityBoundingSet": "",
}
LOCKED_KB: Final = 5_000
"""Of its memory a watchdog that could lock it has at least so much in place."""
EXPOSURE: Final = 1.2
"""Of the watchdog, as before there was one drop-in."""

Entry = dict[str, Any]


def journal(robot: Robot) -> Row:
    """A goal that is driven, then a trip: what docs/troubleshooting.md says of their entries."""
    robot.make_ready()
    robot.goal(0.05).wait(20.0)
    _trip(robot)
    driver, server = _entries("CANBASE_PART=motor_driver"), _entries("CANBASE_PART=drive_distance_server")
    _has(driver, PRIORITY=INFO, CANBASE_STATE="ENABLED", CANBASE_ROBOT="robot", _SYSTEMD_UNIT=unit("driver"))
    _has(driver, PRIORITY=WARNING, CANBASE_CAUSE=".+", CANBASE_STATE="(?!ENABLED).+")
    stop = {"CANBASE_STOPPED_BY": "watchdog|motor_driver", "CANBASE_LATCHED": "true", "CANBASE_STANDSTILL_S": r"[\d.]+"}
    _has(driver, PRIORITY=WARNING, **stop)
    _has(_entries("CANBASE_PART=velocity_mux"), PRIORITY=INFO, CANBASE_ACTIVE="action", CANBASE_BEFORE="")
    _has(_entries("CANBASE_PART=safety_filter"), PRIORITY=INFO, CANBASE_ACTION=".+")
    _has(server, PRIORITY=INFO, CANBASE_STEP="ended", CANBASE_ERROR_CODE="OK", CANBASE_GOAL=r"[0-9a-f-]{32,36}")
    _has(_entries("-u", unit("watchdog")), PRIORITY=WARNING, MESSAGE=".*tripped: .*")
    return Row("journal", "a goal, a trip", then="entries have their priorities and fields")


def support_bundle(robot: Robot) -> Row:
    """`canbase record bundle`: a recording of a trip is in it, and what `canbase doctor` reads of the interface."""
    robot.make_ready()
    _trip(robot)
    robot.make_ready()
    run(*CANBASE, "record", "bundle", "--config", str(ROBOT_YAML), "--output", str(BUNDLE))
    with tarfile.open(BUNDLE) as archive:
        files = {name.partition("/")[2]: _text(archive, name) for name in archive.getnames()}
    not_collected, _, _ = files["MANIFEST.txt"].partition("\nCOLLECTED\n")
    if set(re.findall(r"^  (\S+): ", not_collected, re.MULTILINE)) - NOT_HERE:
        raise BrokenPromiseError(f"not collected: {files['MANIFEST.txt']}")
    _says("\n".join(files), "black_box/stop_robot_")
    _link_is_read(files["can/interfaces.json"])
    _says(files["doctor.txt"], "bit rate", "500000 bit/s", "error active", "restart-ms 100, txqueuelen 64")
    _says(files["units/status.txt"], *(unit(part) for part in PARTS), "active (running)")
    _says(files["journal/canbase.json"], '"CANBASE_STATE": "ENABLED"')
    return Row("canbase record bundle", "after a trip", then=f"{len(files)} files; doctor reads can0")


def installed_again(robot: Robot) -> Row:
    """`canbase setup install` with nothing new changes nothing; `canbase setup uninstall` leaves the owner's files
    alone."""
    robot.make_ready()
    before = pids()
    for _ in range(2):
        told = run(*CANBASE, "setup", "install", "--config", str(ROBOT_YAML), *OPTIONS)
        changed = [line for line in told.splitlines() if line.split()[0] in ("wrote", "replaced", "linked", "removed")]
        if changed:
            raise BrokenPromiseError(f"installed a second time it changes: {changed}")
    robot.spin(0.5)
    if pids() != before or robot.state != DriverStatus.ENABLED:
        raise BrokenPromiseError(f"the robot noticed a second installation: {robot.told()}")
    sandboxed()
    _uninstalled()
    run(*CANBASE, "setup", "install", "--config", str(ROBOT_YAML), *OPTIONS)
    run("systemctl", "start", TARGET)
    robot.make_ready()
    return Row(
        "canbase setup install", "twice; uninstall; install", then="nothing changed; nothing left; drives enabled"
    )


def sandboxed() -> None:
    """The one drop-in is in force for every part, and leaves the watchdog its punctuality."""
    for part in PARTS:
        found = show(unit(part), "User", *SANDBOX)
        if found != ["canbase", *SANDBOX.values()]:
            raise BrokenPromiseError(f"{unit(part)} is not in its sandbox: {found}")
    (pid,) = show(unit("watchdog"), "MainPID")
    locked = re.search(r"VmLck:\s*(\d+)", Path(f"/proc/{pid}/status").read_text())
    if os.sched_getscheduler(int(pid)) != os.SCHED_FIFO or locked is None or int(locked[1]) < LOCKED_KB:
        raise BrokenPromiseError(f"the watchdog is not punctual: policy {os.sched_getscheduler(int(pid))}, {locked}")
    exposed = run("systemd-analyze", "security", "--no-pager", unit("watchdog")).splitlines()[-1]
    if not (level := re.search(r"level for .*: ([\d.]+)", exposed)) or float(level[1]) > EXPOSURE:
        raise BrokenPromiseError(f"systemd-analyze security: {exposed}")


def _trip(robot: Robot) -> None:
    """By the stop frames of a process that the watchdog does not know; until the driver has told of the stop: by the
    watchdog, or by its drives that have no power, whichever it hears of first."""
    before = len(_entries("CANBASE_LATCHED=true"))
    run(*STOP, STOP_FILE)
    robot.wait("the trip", lambda: robot.state not in (None, DriverStatus.ENABLED))
    robot.wait("the stop's entry", lambda: len(_entries("CANBASE_LATCHED=true")) > before, 10.0)


def _uninstalled() -> None:
    files = {Path(line) for line in MANIFEST.read_text().splitlines()} | {MANIFEST}
    run(*CANBASE, "setup", "uninstall", "robot")
    if left := sorted(str(path) for path in files if path.exists() or path.is_symlink()):
        raise BrokenPromiseError(f"canbase setup uninstall leaves {left}")
    if gone := sorted(str(path) for path in KEPT if not path.exists()):
        raise BrokenPromiseError(f"canbase setup uninstall takes the owner's {gone}")
    listed = run("systemctl", "list-units", "--all", "--plain", "--no-legend", "canbase*@robot*").splitlines()
    if loaded := [line for line in listed if line.split()[1] != "not-found"]:
        raise BrokenPromiseError(f"canbase setup uninstall leaves units: {loaded}")


def _entries(*match: str) -> list[Entry]:
    """Of this boot's journal."""
    return [json.loads(line) for line in run("journalctl", "-b", "-q", "-o", "json", *match).splitlines()]


def _has(entries: Iterable[Entry], **fields: str) -> None:
    """One entry whose fields match these expressions."""
    listed = list(entries)
    if not any(all(re.fullmatch(want, str(entry.get(name, ""))) for name, want in fields.items()) for entry in listed):
        raise BrokenPromiseError(f"no entry with {fields} among {len(listed)}; the last: {listed[-1:]}")


def _link_is_read(text: str) -> None:
    """What `ip` of this system tells is understood."""
    link = parse_link(json.dumps([entry for entry in json.loads(text) if entry.get("ifname") == "can0"]))
    if link is None or (link.kind, link.is_up, link.bitrate) != ("can", True, 500_000):
        raise BrokenPromiseError(f"can0 is read as {link} from {text}")
    if (link.state, link.restart_ms, link.queue_length) != (ControllerState.ERROR_ACTIVE, 100, 64):
        raise BrokenPromiseError(f"can0 is read as {link} from {text}")


def _says(text: str, *wanted: str) -> None:
    if missing := [each for each in wanted if each not in text]:
        raise BrokenPromiseError(f"{missing} not in: {text[-2000:]}")


def _text(archive: tarfile.TarFile, name: str) -> str:
    file = archive.extractfile(name)
    return "" if file is None else file.read().decode()
