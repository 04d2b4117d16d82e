"""The bus for a tool that changes drives: alone on it, and canbase's driver cannot start on this computer meanwhile."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from canbase_base.single_instance import TakenError, bus_name, take
from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.onbus.bus_session import BusSession, open_line
from canbase_commissioning.onbus.moving import refuse_beside_masters
from canbase_commissioning.session import Session
from canbase_config.robot import Bus
from canbase_runtime.terminal import FAILED, agreed, fail


@contextmanager
def alone(bus: Bus) -> Iterator[tuple[BusSession, Listener]]:
    """The bus, and what was received in a second. Exits with 1 where a driver or another master has it."""
    try:
        held = take("driver", bus_name(bus.arguments()))
    except TakenError as error:
        fail(f"this bus is in use: {error}", FAILED)
    with held, open_line(bus) as line:
        yield line, refuse_beside_masters(line)


def run_alone(line: BusSession, heard: Listener, session: Session, on_turn: Callable[[], object] = lambda: None) -> str:
    """Runs the session. The first sign of another master ends it, and is returned; empty: there was none."""
    while not session.done:
        line.turn(session)
        on_turn()
        if masters := heard.masters(time.monotonic(), requests=False):
            return f"another master has come to this bus ({'; '.join(masters)})"
    return ""


def confirmed(question: str, *, yes: bool, option: str = "--yes") -> bool:
    """Whether a person agrees. Without a terminal only the option does; exits with 1 where nobody can be asked."""
    if yes:
        return True
    if not sys.stdin.isatty():
        fail(f"{question} Nobody is here to answer: add {option}", FAILED)
    return agreed(question)
