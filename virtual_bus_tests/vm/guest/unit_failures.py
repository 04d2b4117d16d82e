"""A unit ends at speed: killed, hung, stopped, restarted, or never there."""

from __future__ import annotations

import json
import time
from signal import SIGKILL, SIGSTOP, Signals

from exit_matrix import stop_limits as by
from exit_matrix.stop_limits import Layer
from vm.guest.robot import SPEED_MPS, Robot
from vm.guest.scenario import LATCHED, STANDS, Row, Scenario, elapsed, judged
from vm.guest.system import PARTS, TARGET, BrokenPromiseError, run, send_signal, show, unit

SERVER = "action-server"
"""The only part whose end does not stop a robot that somebody else drives."""
HOLDS_STICK = ("driver", "watchdog")
"""What is restarted while somebody orders motion: the driver waits for a zero first, a dead watchdog latches."""
LAST_ACTS = ("driver", "watchdog")
"""Their ExecStopPost sends stop frames."""
DIES: dict[str, tuple[Layer, ...]] = {
    "driver": (by.WATCHDOG_DRIVER, by.DRIVES),
    "watchdog": (by.DRIVER_WATCHDOG, by.DRIVES),
    "velocity": (by.WATCHDOG_LEASE,),
    SERVER: (by.MUX_ACTION,),
}
ENDS: dict[str, tuple[Layer, ...]] = {
    "driver": (by.DRIVER_SHUTDOWN,),
    "watchdog": (by.WATCHDOG_ENDED,),
    "velocity": (by.FILTER_SHUTDOWN,),
    SERVER: (by.SERVER_SHUTDOWN,),
    "target": (by.FILTER_SHUTDOWN, by.DRIVER_SHUTDOWN),
}


def killed(part: str, number: Signals) -> Scenario:
    """A process ends or hangs; systemd starts it again, and it does not move before a reset."""

    def scenario(robot: Robot) -> Row:
        _at_speed(robot, part)
        moment_s, before = send_signal(part, number)
        stop = robot.stands(moment_s)
        stood_s = time.monotonic()
        again_s = robot.restarted(part, before) - moment_s
        if part in LAST_ACTS:
            _stop_frames_were_sent(part, moment_s)
        if part == SERVER:
            robot.spin(1.0)
        else:
            robot.stays_disarmed()
        robot.stays(stood_s)
        then = "goal gone" if part == SERVER else LATCHED
        row = Row(f"canbase-{part}", number.name, again_s=again_s, then=then)
        return judged(row, robot, moment_s, stop, DIES[part])

    return scenario


def stopped(part: str) -> Scenario:
    """`systemctl stop`: an orderly end, no failure."""

    def scenario(robot: Robot) -> Row:
        _at_speed(robot, part)
        moment_s = time.monotonic()
        run("systemctl", "--no-block", "stop", _name(part))
        stop = robot.stands(moment_s)
        stood_s = time.monotonic()
        _wait_until_ended(robot, part)
        robot.spin(0.5)
        robot.stays(stood_s)
        row = judged(Row(_title(part), "systemctl stop", then=STANDS), robot, moment_s, stop, ENDS[part])
        robot.order(None)
        run("systemctl", "start", TARGET)
        return row

    return scenario


def restarted(part: str) -> Scenario:
    """`systemctl restart`: it comes up again and stands. After driver and watchdog also with the stick held on; a
    new mux follows whoever orders, so that otherwise the hand lets go when the robot stands."""

    def scenario(robot: Robot) -> Row:
        _at_speed(robot, part)
        parts = PARTS if part == "target" else (part,)
        before = {each: show(unit(each), "MainPID")[0] for each in parts}
        moment_s = time.monotonic()
        run("systemctl", "--no-block", "restart", _name(part))
        stop = robot.stands(moment_s)
        stood_s = time.monotonic()
        if part not in HOLDS_STICK:
            robot.order(None)
        again_s = max(robot.restarted(each, before[each]) for each in parts) - moment_s
        robot.spin(1.0)
        robot.stays(stood_s)
        row = Row(_title(part), "systemctl restart", again_s=again_s, then=STANDS)
        return judged(row, robot, moment_s, stop, ENDS[part])

    return scenario


def masked(robot: Robot) -> Row:
    """No watchdog: the driver runs, says so, and gives no power."""
    robot.order(None)
    run("systemctl", "stop", unit("driver"), unit("watchdog"))
    run("systemctl", "mask", "--runtime", unit("watchdog"))
    since_s = time.monotonic()
    try:
        run("systemctl", "start", unit("driver"))
        robot.wait("the driver", lambda: robot.state is not None and robot.status_at > since_s)
        robot.order(SPEED_MPS)
        robot.stays_disarmed(3.0)
        robot.stays(since_s)
        told = robot.told()
    finally:
        robot.order(None)
        run("systemctl", "unmask", "--runtime", unit("watchdog"))
        run("systemctl", "start", TARGET)
    if "watchdog" not in told:
        raise BrokenPromiseError(f"the driver does not say that it is the watchdog: {told}")
    ready_s = elapsed(since_s)
    robot.make_ready()
    return Row("canbase-watchdog", "masked; driver started", again_s=ready_s, then="no power, and says why")


def _stop_frames_were_sent(part: str, since_s: float) -> None:
    """By the process that systemd starts when this unit has ended, inside its sandbox."""
    microseconds = round(since_s * 1e6)
    told = [json.loads(line) for line in run("journalctl", "-b", "-q", "-o", "json", "-u", unit(part)).splitlines()]
    since = [str(each.get("MESSAGE")) for each in told if int(each["__MONOTONIC_TIMESTAMP"]) > microseconds]
    if "stop frames sent" not in since:
        raise BrokenPromiseError(f"nobody sent stop frames after {part}; its journal since then: {since[-10:]}")


def _at_speed(robot: Robot, part: str) -> None:
    robot.make_ready()
    if part == SERVER:
        robot.drive_by_goal()
    else:
        robot.drive()


def _wait_until_ended(robot: Robot, part: str) -> None:
    names = [unit(each) for each in PARTS] if part == "target" else [_name(part)]
    until_s = time.monotonic() + 20.0
    while states := {name: state for name in names if (state := show(name, "ActiveState")[0]) != "inactive"}:
        if "failed" in states.values() or time.monotonic() > until_s:
            raise BrokenPromiseError(f"systemctl stop ended so: {states}")
        robot.spin(0.4)


def _name(part: str) -> str:
    return TARGET if part == "target" else unit(part)


def _title(part: str) -> str:
    return "canbase.target" if part == "target" else f"canbase-{part}"


KILLS: dict[str, Scenario] = {
    f"{part} {number.name}": killed(part, number) for number in (SIGKILL, SIGSTOP) for part in DIES
}
ORDERLY: dict[str, Scenario] = {f"stop {part}": stopped(part) for part in ENDS} | {
    f"restart {part}": restarted(part) for part in ENDS
}
