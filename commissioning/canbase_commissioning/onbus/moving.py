"""Runs a script that moves wheels, and stops them on every way out: its end, an error, a signal, Enter, no terminal."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from canbase_commissioning.bus_monitor import Listener, ListenSession
from canbase_commissioning.guide import CommissionError, Guide, Script
from canbase_commissioning.onbus.bus_session import BusSession
from canbase_commissioning.onbus.operator import Person, unbroken
from canbase_commissioning.powered_drives import PoweredDrives
from canbase_commissioning.safe_stop import SafeStop
from canbase_config.robot import Robot
from canbase_runtime.terminal import FAILED, fail

T = TypeVar("T")
LISTEN_S = 1.0


def refuse_beside_masters(line: BusSession) -> Listener:
    """What it received meanwhile. Exits with 1 when anybody else commands this bus: a CANopen bus has one master."""
    listening = ListenSession(LISTEN_S)
    line.run(listening)
    masters = listening.heard.masters(listening.now_s)
    if masters:
        signs = "; ".join(masters)
        fail(f"another master is on this bus ({signs}). End canbase up, or sudo systemctl stop 'canbase-*'", FAILED)
    return listening.heard


def run_script(line: BusSession, robot: Robot, script: Callable[[PoweredDrives], Script[T]], person: Person) -> T:
    """The script to its end, then the farewell. What it raises comes after the farewell."""
    rig = PoweredDrives(robot)
    guide = Guide(rig, script(rig), person.tell)
    try:
        while not guide.done:
            line.turn(guide)
            if guide.question is not None:
                _answer(line, guide, person)
            elif person.interrupts():
                raise CommissionError("stopped by Enter")
    finally:
        with unbroken():
            line.run(SafeStop(rig))
    if guide.result is None:
        raise RuntimeError("the script ended without a result")
    return guide.result


def _answer(line: BusSession, guide: Guide[T], person: Person) -> None:
    question = guide.question
    while question is not None and question is guide.question:
        try:
            guide.answer(person.ask(question, lambda: line.turn(guide)))
        except ValueError as error:
            person.again(question, error)
