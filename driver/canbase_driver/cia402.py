"""CiA 402, power state machine: statusword 6041h to state, state and goal to controlword 6040h. No frames, no time.

Rules of the goals
1. OFF and QUICK_STOP are the same word in every state, an unknown one included: stopping needs no knowledge.
   They never set bit 3 (enable operation), so no way down leads through OPERATION ENABLED.
2. OFF is disable voltage: the motor coasts. The caller brings the wheels to standstill first.
3. ON goes up one step at a time and stays in OPERATION ENABLED. It never interrupts a quick stop: in QUICK STOP ACTIVE
   it keeps the word; a drive that stays there when it stands (605Ah = 5…8) needs OFF first. In an unknown state it is
   a quick stop too.
   READY goes up to switched on, which needs main voltage and no STO, and is OFF in every state with torque.
   LET_GO is READY, but for one step down: disable operation, from operation enabled to switched on (605Ch).
4. ON never resets a fault. Only RESET sets bit 7, and only in FAULT; in every other state RESET is OFF.
5. The drive acts on the 0 → 1 edge of bit 7 (transition 15), not on its level. Before RESET hold OFF, which keeps
   bit 7 at 0, for FAULT_RESET_CYCLES; then hold RESET until the state is no longer FAULT, at least FAULT_RESET_CYCLES.
   Each further try needs OFF again.
"""

from __future__ import annotations

from collections.abc import Collection
from enum import Enum

FAULT_RESET_CYCLES = 3
"""SYNC cycles for each level of bit 7: synchronous RPDOs act one SYNC late, some drives need three to see an edge."""

WARNING = 1 << 7
"""Statusword bit 7: something is not as it should be, but no fault."""
INTERNAL_LIMIT = 1 << 11
"""Statusword bit 11; some drives set it from the start. Never a fault."""
REMOTE = 1 << 9
"""Statusword bit 9: 0 means that the drive is in local mode and ignores the controlword."""


class DriveState(Enum):
    """State of the power drive system; the value is its name in CiA 402-2."""

    __hash__ = object.__hash__  # that of Enum is written in Python, and tables are looked up in every cycle

    NOT_READY_TO_SWITCH_ON = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY_TO_SWITCH_ON = "ready to switch on"
    SWITCHED_ON = "switched on"
    OPERATION_ENABLED = "operation enabled"
    QUICK_STOP_ACTIVE = "quick stop active"
    FAULT_REACTION_ACTIVE = "fault reaction active"
    FAULT = "fault"

    @property
    def text(self) -> str:
        """The state in the standard's words."""
        return self.value

    @property
    def has_torque(self) -> bool:
        """Whether the drive may be turning the motor by itself: enabled, or on its way down a ramp."""
        return self in _WITH_TORQUE


_WITH_TORQUE = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE)
PREPARED = (DriveState.SWITCHED_ON, DriveState.OPERATION_ENABLED)
"""At least switched on: nothing but the enable is missing."""

STATUSWORD_STATES = (
    (0x4F, 0x00, DriveState.NOT_READY_TO_SWITCH_ON),
    (0x4F, 0x40, DriveState.SWITCH_ON_DISABLED),
    (0x6F, 0x21, DriveState.READY_TO_SWITCH_ON),
    (0x6F, 0x23, DriveState.SWITCHED_ON),
    (0x6F, 0x27, DriveState.OPERATION_ENABLED),
    (0x6F, 0x07, DriveState.QUICK_STOP_ACTIVE),
    (0x4F, 0x0F, DriveState.FAULT_REACTION_ACTIVE),
    (0x4F, 0x08, DriveState.FAULT),
)
"""(mask, value, state) of CiA 402-2, statusword 6041h. No word matches two rows."""


def decode_statusword(word: int) -> DriveState | None:
    """State that statusword 6041h shows; None when its bits match no state. Only bits 0…3, 5 and 6 count."""
    return _BY_BITS[word & 0x6F]


_BY_BITS = tuple(
    next((state for mask, value, state in STATUSWORD_STATES if bits & mask == value), None) for bits in range(0x70)
)


class Command(Enum):
    """Controlword 6040h for each command of CiA 402-2. Halt (bit 8) stays 0 throughout."""

    DISABLE_VOLTAGE = 0x00
    QUICK_STOP = 0x02
    SHUTDOWN = 0x06
    SWITCH_ON = 0x07
    """In operation enabled the same word is "disable operation"."""
    ENABLE_OPERATION = 0x0F
    FAULT_RESET = 0x80


VL_RAMP = 0x70
"""Bits 4 to 6 of 6040h in mode 2 (vl): the ramp runs, is not locked, and leads to the target. With one of them 0 the
motor does not follow 6042h; a locked ramp keeps its speed. Enabled they are all 1, in all other words 0."""


class PowerGoal(Enum):
    """Where one axis is to be taken. The rules are at the head of this file."""

    __hash__ = object.__hash__

    OFF = "off"
    """Switch on disabled: no torque."""
    ON = "on"
    """Operation enabled."""
    READY = "ready"
    """Switched on: no torque, but nothing that forbids it either."""
    RELEASE = "let go"
    """Switched on, from operation enabled: for a moment without torque."""
    QUICK_STOP = "quick stop"
    """Down the ramp 6085h and then, with 605Ah = 2, to switch on disabled."""
    RESET = "fault reset"
    """Out of fault, to switch on disabled."""


_UP = {
    None: Command.QUICK_STOP,
    DriveState.NOT_READY_TO_SWITCH_ON: Command.DISABLE_VOLTAGE,
    DriveState.SWITCH_ON_DISABLED: Command.SHUTDOWN,
    DriveState.READY_TO_SWITCH_ON: Command.SWITCH_ON,
    DriveState.SWITCHED_ON: Command.ENABLE_OPERATION,
    DriveState.OPERATION_ENABLED: Command.ENABLE_OPERATION,
    DriveState.QUICK_STOP_ACTIVE: Command.QUICK_STOP,
    DriveState.FAULT_REACTION_ACTIVE: Command.DISABLE_VOLTAGE,
    DriveState.FAULT: Command.DISABLE_VOLTAGE,
}
_STATES: tuple[DriveState | None, ...] = (None, *DriveState)

_READY = (
    dict.fromkeys(_STATES, Command.DISABLE_VOLTAGE)
    | {DriveState.SWITCH_ON_DISABLED: Command.SHUTDOWN}
    | dict.fromkeys((DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON), Command.SWITCH_ON)
)

COMMANDS: dict[PowerGoal, dict[DriveState | None, Command]] = {
    PowerGoal.OFF: dict.fromkeys(_STATES, Command.DISABLE_VOLTAGE),
    PowerGoal.ON: _UP,
    PowerGoal.READY: _READY,
    PowerGoal.RELEASE: _READY | {DriveState.OPERATION_ENABLED: Command.SWITCH_ON},
    PowerGoal.QUICK_STOP: dict.fromkeys(_STATES, Command.QUICK_STOP),
    PowerGoal.RESET: dict.fromkeys(_STATES, Command.DISABLE_VOLTAGE) | {DriveState.FAULT: Command.FAULT_RESET},
}
"""The command for each goal in each state (None: unknown statusword, or none received)."""
_WORDS = {goal: {state: command.value for state, command in row.items()} for goal, row in COMMANDS.items()}


def next_controlword(state: DriveState | None, goal: PowerGoal) -> int:
    """Controlword 6040h that takes an axis one step from `state` (None: unknown) towards `goal`, or keeps it there."""
    return _WORDS[goal][state]


def common_controlword(states: Collection[DriveState | None], goal: PowerGoal) -> int:
    """The one word for motors that share 6040h: of the words for each, that which gives the least power.

    A motor in fault has no voice unless the goal is RESET: it does not act on the others' words, and its own would
    let them coast.
    """
    if goal is PowerGoal.RESET:
        return max(next_controlword(state, goal) for state in states)
    voices: list[DriveState | None] = [state for state in states if state not in _IN_FAULT] or list(states)
    return min(next_controlword(state, goal) for state in voices)


_IN_FAULT = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)
