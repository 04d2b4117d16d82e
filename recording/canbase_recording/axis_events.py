"""What a statusword or a controlword changes at a CiA 402 axis, as an event. Pure.

An axis that loses its power though nobody ordered that, one that goes to fault, and one that is switched off in motion
are alarms.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from canbase_driver.cia402 import Command, DriveState, decode_statusword
from canbase_recording.event import Event, EventKind, Level
from canbase_recording.frame_words import CONTROLWORDS, controlword_command
from canbase_recording.node_seen import AxisSeen

HALTED_S: Final = 0.5
"""The watchdog repeats its quick stop every 0.01 s; a pause of this length is a new one [s]."""
OnWord = Callable[[float, AxisSeen, str, int, int], Event | None]
"""Time [s], axis, its name, its node, the word."""
_POWERED: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE)
_FAULTS: Final = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)


def on_statusword(at_s: float, axis: AxisSeen, who: str, node_id: int, word: int) -> Event | None:
    """The new state; None: it is the old one, or none."""
    state = decode_statusword(word)
    before, axis.state = axis.state, state
    if state is before or state is None:
        return None
    level = _level(axis, before, state, at_s)
    was = f", before {before.text}" if before else ""
    own = " by itself" if level is Level.ALARM and state not in _FAULTS else ""
    return Event(at_s, EventKind.DRIVE_STATE, level, who, f"{state.text}{own}{was}", node_id)


def on_controlword(at_s: float, axis: AxisSeen, who: str, node_id: int, word: int) -> Event | None:
    """The new command of the master; None: it is the old one, or none."""
    command = controlword_command(word)
    before, axis.command = axis.command, command
    if command is before or command is None:
        return None
    stops = axis.is_enabled and command is not Command.ENABLE_OPERATION
    level = Level.ALARM if stops and axis.moves else Level.INFO
    text = f"ordered: {CONTROLWORDS[command]}{' in motion' if level is Level.ALARM else ''}"
    return Event(at_s, EventKind.CONTROL, level, who, text, node_id)


def on_watchdog_word(at_s: float, axis: AxisSeen, who: str, node_id: int, word: int) -> Event | None:
    """The begin of a quick stop or power-off by canbase's watchdog, in the PDO that is its own; None: it goes on."""
    command = controlword_command(word)
    is_first, axis.halted_s = at_s - axis.halted_s > HALTED_S, at_s
    if not is_first or command is None:
        return None
    level = Level.ALARM if axis.is_enabled else Level.INFO
    return Event(at_s, EventKind.WATCHDOG, level, "watchdog", f"orders {CONTROLWORDS[command]}: {who}", node_id)


def _level(axis: AxisSeen, before: DriveState | None, state: DriveState, at_s: float) -> Level:
    """Of a new state: a fault, and a power-off that nobody ordered, are alarms."""
    if state in _FAULTS:
        return Level.ALARM if before is not None and before not in _FAULTS else Level.WARNING
    if before is not DriveState.OPERATION_ENABLED or state in _POWERED or at_s - axis.halted_s <= HALTED_S:
        return Level.INFO
    if axis.command is None:
        return Level.WARNING
    return Level.ALARM if axis.command is Command.ENABLE_OPERATION else Level.INFO
