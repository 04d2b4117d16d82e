"""What is done to the robot in the guest, and what must come of it. Each scenario is a row of the table.

Run by job, after boot. Which ones: SCENARIOS in the environment of the kernel command line, or all, in this order.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from canbase.msg import DriverStatus

from vm.guest.last_words import FOLDER
from vm.guest.robot import PARTS, BrokenPromiseError, Robot, Standstill, run, show, unit

STANDS_WITHIN_S = 1.0
HEARTBEATS_S = 0.3
"""timeouts.drive_heartbeat_s: what a drive that stops by itself waits first."""


@dataclass(frozen=True, slots=True)
class Row:
    """What was measured. Times in seconds, ways in metres; NaN does not occur: what there is not is None."""

    scenario: str
    what: str
    stands_s: float | None = None
    way_m: float | None = None
    again_s: float | None = None
    then: str = ""
    failure: str = ""


def cold_boot(robot: Robot) -> Row:
    """Nobody logs in, nobody types: the drives get power."""
    robot.wait("drives enabled", lambda: robot.state == DriverStatus.ENABLED)
    enabled_s = float(
        run("journalctl", "-b", "-o", "short-monotonic", "-u", unit("driver"), "-g", "ENABLED")
        .splitlines()[-1]
        .split("]")[0]
        .strip(" [")
    )
    return Row("cold boot", "drives enabled after the kernel's start", again_s=enabled_s, then="enabled by itself")


def goal_driven(robot: Robot) -> Row:
    """A goal of 0.3 m is driven and ends in a measured standstill."""
    robot.make_ready()
    at_m = robot.truth().travel_m
    begun_s = time.monotonic()
    result = robot.goal(0.3).wait(30.0)
    error_m = robot.truth().travel_m - at_m - 0.3
    if result is None or result.code.name != "OK" or abs(error_m) > 0.005:
        raise BrokenPromiseError(f"{result}, really {error_m * 1000:+.1f} mm off")
    return Row("goal", f"0.3 m driven, {error_m * 1000:+.1f} mm off", again_s=time.monotonic() - begun_s, then="OK")


def killed(part: str, number: signal.Signals) -> Callable[[Robot], Row]:
    """A process ends or hangs at speed."""

    def scenario(robot: Robot) -> Row:
        robot.make_ready()
        by_goal = part == "action-server"
        if by_goal:
            robot.drive_by_goal()
        else:
            robot.drive()
        before = show(unit(part), "MainPID")
        moment_s = robot.signal(part, number)
        stop = robot.stands(moment_s)
        stood_s = time.monotonic()
        again_s = robot.restarted(part, before) - moment_s
        then = "no goal any more" if by_goal else "disarmed until reset"
        if by_goal:
            robot.spin(1.0)
        else:
            robot.stays_disarmed()
        robot.stays(stood_s)
        return measured(f"{part} {number.name}", "at 0.3 m/s", stop, again_s, then)

    return scenario


def commanded(what: str, *units: str) -> Callable[[Robot], Row]:
    """`systemctl stop` or `restart` at speed: an orderly end."""

    def scenario(robot: Robot) -> Row:
        robot.make_ready()
        robot.drive()
        moment_s = time.monotonic()
        run("systemctl", "--no-block", what, *units)
        stop = robot.stands(moment_s)
        stood_s = time.monotonic()
        if what == "stop":
            robot.wait("the end", lambda: all(show(name, "ActiveState") != "deactivating" for name in units))
            robot.spin(1.0)
            states = ", ".join(f"{show(name, 'ActiveState')}" for name in units)
            if "failed" in states:
                raise BrokenPromiseError(f"systemctl stop ended {units} as {states}")
        else:
            robot.spin(3.0)
        robot.stays(stood_s)
        robot.order_mps = None
        run("systemctl", "start", "canbase@robot.target")
        again_s = time.monotonic() - moment_s
        return measured(f"systemctl {what} {units[0].split('@')[0]}", "at 0.3 m/s", stop, again_s, "stands")

    return scenario


def link_down(robot: Robot) -> Row:
    """Driver and watchdog are both cut off: the drives' own heartbeat consumers stop the wheels."""
    robot.make_ready()
    robot.drive()
    moment_s = time.monotonic()
    run("ip", "link", "set", "can0", "down")
    stop = robot.stands(moment_s)
    stood_s = time.monotonic()
    robot.spin(2.0)
    run("ip", "link", "set", "can0", "up")
    up_s = time.monotonic()
    robot.stays_disarmed(3.0)
    robot.stays(stood_s)
    robot.make_ready()
    return measured("can0 down, up", "at 0.3 m/s", stop, time.monotonic() - up_s, "disarmed until reset")


def watchdog_masked(robot: Robot) -> Row:
    """No watchdog: the driver runs, says so, and gives no power."""
    robot.order_mps = None
    run("systemctl", "stop", "canbase@robot.target", *(unit(part) for part in PARTS))
    run("systemctl", "mask", "--runtime", unit("watchdog"))
    since_s = time.monotonic()
    try:
        run("systemctl", "start", "canbase@robot.target")
        robot.wait("the driver", lambda: robot.state is not None and robot.status_at > since_s)
        robot.order_mps = 0.3
        robot.stays_disarmed(3.0)
        robot.stays(since_s)
        told = robot.told()
    finally:
        robot.order_mps = None
        run("systemctl", "unmask", "--runtime", unit("watchdog"))
        run("systemctl", "start", "canbase@robot.target")
    if "watchdog" not in told:
        raise BrokenPromiseError(f"the driver does not say that it is the watchdog: {told}")
    return Row("watchdog masked", "driver started without it", then="no power, says so")


def drive_cut(robot: Robot) -> Row:
    """A drive loses its supply for half a second."""
    robot.make_ready()
    robot.drive()
    moment_s = time.monotonic()
    robot.sim.fault(1, "power_cycle")
    stop = robot.stands(moment_s)
    stood_s = time.monotonic()
    robot.spin(1.5)
    robot.stays_disarmed()
    robot.stays(stood_s)
    return measured("drive's power cut", "one of two, for 0.5 s", stop, None, "disarmed until reset")


def unplugged(robot: Robot) -> Row:
    """The adapter is gone, and comes back: the host does it when it reads these lines."""
    robot.make_ready()
    robot.drive()
    print("@host device_del", flush=True)
    robot.wait("can0 to go", lambda: not Path("/sys/class/net/can0").exists())
    gone_s = time.monotonic()
    stop = robot.stands(gone_s)
    stood_s = time.monotonic()
    print("@host device_add", flush=True)
    robot.wait("can0 to come back up", lambda: "UP" in run("ip", "link", "show", "can0", check=False))
    back_s = time.monotonic()
    robot.stays_disarmed()
    robot.stays(stood_s)
    robot.make_ready()
    ready_s = time.monotonic() - back_s
    return measured("adapter unplugged, plugged in", "at 0.3 m/s", stop, ready_s, "disarmed until reset")


def log_full(robot: Robot) -> Row:
    """No file can be written anywhere: logs are lost, nothing else."""
    robot.make_ready()
    folders = ("/var/log", "/tmp", "/var/tmp")
    for folder in folders:
        run("mount", "-t", "tmpfs", "-o", "size=4k", "full", folder)
        run("sh", "-c", f"cat /dev/zero > {folder}/filler", check=False)
    try:
        for part in PARTS:
            run("systemctl", "restart", unit(part))
        robot.make_ready()
        row = goal_driven(robot)
    finally:
        for folder in folders:
            run("umount", "-l", folder)
    return Row("disk full", f"all parts restarted; {row.what}", again_s=row.again_s, then=row.then)


def measured(name: str, what: str, stop: Standstill, again_s: float | None, then: str) -> Row:
    """A row, if the wheels stood in time. Raises BrokenPromiseError if not."""
    if stop.after_s > STANDS_WITHIN_S:
        raise BrokenPromiseError(f"stood only after {stop.after_s:.3f} s, {stop.way_m:.3f} m, too late")
    return Row(name, what, stop.after_s, stop.way_m, again_s, then)


KILLS = {
    f"{part} {number.name}": killed(part, number)
    for number in (signal.SIGKILL, signal.SIGSTOP)
    for part in ("driver", "watchdog", "velocity", "action-server")
}
ORDERLY = {
    f"systemctl {what} {part}": commanded(what, unit(part)) for what in ("stop", "restart") for part in PARTS
} | {f"systemctl {what} target": commanded(what, "canbase@robot.target") for what in ("stop", "restart")}
SCENARIOS: dict[str, Callable[[Robot], Row]] = {
    "cold boot": cold_boot,
    "goal": goal_driven,
    **KILLS,
    **ORDERLY,
    "can0 down": link_down,
    "watchdog masked": watchdog_masked,
    "power cut": drive_cut,
    "unplugged": unplugged,
    "disk full": log_full,
}


def main() -> int:
    """Exit code 0: every scenario came out as promised."""
    FOLDER.mkdir(exist_ok=True)
    wanted = json.loads(Path("/run/wanted.json").read_text()) or list(SCENARIOS)
    robot = Robot()
    bad = 0
    for name in wanted:
        begun_s = time.monotonic()
        try:
            row = SCENARIOS[name](robot)
        except Exception as error:  # noqa: BLE001 - the next scenario may tell more
            traceback.print_exc()
            row = Row(name, "", failure=f"{type(error).__name__}: {error}")
            bad += 1
        robot.order_mps = None
        took_s = time.monotonic() - begun_s
        print(json.dumps(asdict(row) | {"took_s": round(took_s, 1)}), flush=True)
        with (FOLDER / "rows.jsonl").open("a") as file:
            file.write(json.dumps(asdict(row)) + "\n")
    os.sync()
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
