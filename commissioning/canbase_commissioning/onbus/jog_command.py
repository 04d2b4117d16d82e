"""`canbase bus jog` on the bus and on the terminal. What a held key means is in `commissioning/jog_session.py`."""

from __future__ import annotations

import os
import select
import sys
import termios
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from canbase_commissioning.guide import CommissionError, Guide, Script
from canbase_commissioning.jog_session import JogSession
from canbase_commissioning.onbus.bus_session import BusSession, open_line
from canbase_commissioning.onbus.moving import refuse_beside_masters
from canbase_commissioning.onbus.operator import Stopped, stopping_signals, unbroken
from canbase_commissioning.powered_drives import PoweredDrives, RigError
from canbase_commissioning.safe_stop import SafeStop
from canbase_commissioning.self_stop_test import get_ready
from canbase_config.robot import Robot
from canbase_runtime.terminal import FAILED, WRONG_INPUT, agreed, fail, load_config, warn, with_cursor

SHOW_S: Final = 0.2
CANNOT_STOP: Final = (
    "this drive does NOT stop by itself when this program is killed (SIGKILL) or the computer dies: "
    "only STO stops it then. Hand on the emergency stop, wheels up"
)
STOPS: Final = "killed (SIGKILL), it leaves the wheel to the drive, which stops by itself: {}"


def run(config: Path | None, joint: str, speed_mps: float, *, yes: bool) -> None:
    """Until q; the exit codes are in `canbase bus jog --help`."""
    robot = load_config(config).robot
    joints = [drive.joint for drive in robot.drives]
    if joint not in joints:
        fail(f"there is no wheel {joint!r} in robot.yaml, expected one of {', '.join(joints)}", WRONG_INPUT)
    if not sys.stdin.isatty():
        fail("jog needs an interactive terminal", WRONG_INPUT)
    if not yes and not agreed(
        f"{robot.name}, {robot.bus.channel}: WHEELS UP, nothing near them, the emergency stop (STO) at hand and tried?"
    ):
        fail("not confirmed", FAILED)
    with open_line(robot.bus) as line, stopping_signals():
        refuse_beside_masters(line)
        try:
            _jog(line, robot, joint, speed_mps)
        except (RigError, CommissionError, OSError) as error:
            fail(f"{error}. The wheel was stopped, its power is off", FAILED)
        except Stopped as stopped:
            fail(f"{stopped}: the wheel was stopped, its power is off", 128 + stopped.number)


def _jog(line: BusSession, robot: Robot, joint: str, speed_mps: float) -> None:
    rig = PoweredDrives(robot)
    try:
        line.run(Guide(rig, _boot(rig), lambda told: print(told.text)))
        _say_what_happens_after_a_kill(rig, joint)
        session = JogSession(rig, joint, speed_mps)
        with _single_keys():
            _hold(line, session)
    finally:
        with unbroken():
            line.run(SafeStop(rig))


def _boot(rig: PoweredDrives) -> Script[bool]:
    yield from get_ready(rig)
    return True


def _hold(line: BusSession, session: JogSession) -> None:
    shown_at = 0.0
    while not session.done:
        line.turn(session)
        now_s = time.monotonic()
        if select.select([sys.stdin], [], [], 0.0)[0]:
            text = os.read(sys.stdin.fileno(), 64).decode("latin-1")
            if not text:
                raise CommissionError("the terminal was closed")
            session.press(text, now_s)
        if now_s - shown_at >= SHOW_S:
            shown_at = now_s
            with_cursor(sys.stdout).write(f"\r{session.line:<78}")
            with_cursor(sys.stdout).flush()
    sys.stdout.write("\n")


def _say_what_happens_after_a_kill(rig: PoweredDrives, joint: str) -> None:
    report = rig.report(joint)
    if report is None or not report.stops_by_itself:
        warn(CANNOT_STOP)
    else:
        print(STOPS.format(report.self_stop.text))
    print("hold w (forward) or s (backward); release stops; q ends")


@contextmanager
def _single_keys() -> Iterator[None]:
    """Keys come one by one and unseen; Ctrl-C stays a signal. What was pressed before does not count."""
    number = sys.stdin.fileno()
    before = termios.tcgetattr(number)
    tty.setcbreak(number)
    termios.tcflush(number, termios.TCIFLUSH)
    try:
        yield
    finally:
        termios.tcsetattr(number, termios.TCSADRAIN, before)
