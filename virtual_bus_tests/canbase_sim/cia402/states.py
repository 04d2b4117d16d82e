"""The CiA 402 state machine as tables: commands by controlword 6040h, transitions 1 to 16 (CiA 402-2).

Rule 1: everything about which state follows which is in `TRANSITIONS` and `EVENTS`; option codes only decide how the
motor stops and are `axis.py`. Rule 2: a command that the table does not list in a state is ignored, as drives do; an
event that it does not list is our own mistake and raises.
"""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import NamedTuple


class State(Enum):
    """States; the value is the statusword's bits 0–3, 5 and 6."""

    __hash__ = object.__hash__  # that of Enum is written in Python

    NOT_READY_TO_SWITCH_ON = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY_TO_SWITCH_ON = 0x21
    SWITCHED_ON = 0x23
    OPERATION_ENABLED = 0x27
    QUICK_STOP_ACTIVE = 0x07
    FAULT_REACTION_ACTIVE = 0x0F
    FAULT = 0x08


class Command(Enum):
    """What a controlword orders by bits 7, 3, 2, 1 and 0. The fault reset is an edge and not among them."""

    __hash__ = object.__hash__

    NONE = "bit 7 is set"
    DISABLE_VOLTAGE = "0xx0x"
    QUICK_STOP = "0x01x"
    SHUTDOWN = "0x110"
    SWITCH_ON = "00111, also: disable operation"
    ENABLE_OPERATION = "01111"


class Event(Enum):
    """What happens in the drive without a controlword, and the edge of bit 7."""

    BOOTED = "self-test done"
    ERROR = "a fault came"
    REACTION_DONE = "the fault reaction has ended"
    FAULT_RESET = "bit 7 rose and every cause is gone"
    STOP_DONE = "the quick stop has ended"


class Transition(NamedTuple):
    """Number in the standard, and the state that it leads to."""

    number: int
    target: State


class Bit(IntEnum):
    """Bits of controlword and statusword that are not part of the state."""

    FAULT_RESET = 0x0080
    HALT = 0x0100
    VOLTAGE_ENABLED = 0x0010
    REMOTE = 0x0200
    TARGET_REACHED = 0x0400
    INTERNAL_LIMIT = 0x0800
    MODE_SPECIFIC = 0x1000


_SOD, _READY, _ON = State.SWITCH_ON_DISABLED, State.READY_TO_SWITCH_ON, State.SWITCHED_ON
_ENABLED, _STOP = State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE

TRANSITIONS: dict[tuple[State, Command], Transition] = {
    (_SOD, Command.SHUTDOWN): Transition(2, _READY),
    (_READY, Command.SWITCH_ON): Transition(3, _ON),
    (_READY, Command.ENABLE_OPERATION): Transition(3, _ON),  # and 4 follows: the controlword is a level
    (_READY, Command.DISABLE_VOLTAGE): Transition(7, _SOD),
    (_READY, Command.QUICK_STOP): Transition(7, _SOD),
    (_ON, Command.ENABLE_OPERATION): Transition(4, _ENABLED),
    (_ON, Command.SHUTDOWN): Transition(6, _READY),
    (_ON, Command.DISABLE_VOLTAGE): Transition(10, _SOD),
    (_ON, Command.QUICK_STOP): Transition(10, _SOD),
    (_ENABLED, Command.SWITCH_ON): Transition(5, _ON),
    (_ENABLED, Command.SHUTDOWN): Transition(8, _READY),
    (_ENABLED, Command.DISABLE_VOLTAGE): Transition(9, _SOD),
    (_ENABLED, Command.QUICK_STOP): Transition(11, _STOP),
    (_STOP, Command.DISABLE_VOLTAGE): Transition(12, _SOD),
    (_STOP, Command.ENABLE_OPERATION): Transition(16, _ENABLED),  # only with 605Ah 5 to 8
}
"""What each command does in each state; what is not listed is ignored."""

EVENTS: dict[tuple[State, Event], Transition] = {
    (State.NOT_READY_TO_SWITCH_ON, Event.BOOTED): Transition(1, _SOD),
    (State.FAULT_REACTION_ACTIVE, Event.REACTION_DONE): Transition(14, State.FAULT),
    (State.FAULT, Event.FAULT_RESET): Transition(15, _SOD),
    (_STOP, Event.STOP_DONE): Transition(12, _SOD),
} | {
    (state, Event.ERROR): Transition(13, State.FAULT_REACTION_ACTIVE)
    for state in State
    if state not in (State.FAULT, State.FAULT_REACTION_ACTIVE)
}
"""What each event does in each state; another one is refused."""

POWERED = frozenset({State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE})
"""The states in which the power stage may drive the motor."""


def decode(controlword: int) -> Command:
    """The command in a controlword (CiA 402-2, object 6040h)."""
    if controlword & 0x80:
        return Command.NONE
    if not controlword & 0x02:
        return Command.DISABLE_VOLTAGE
    if not controlword & 0x04:
        return Command.QUICK_STOP
    if not controlword & 0x01:
        return Command.SHUTDOWN
    return Command.ENABLE_OPERATION if controlword & 0x08 else Command.SWITCH_ON


def after(state: State, event: Event) -> Transition:
    """The transition of an event. Raises ValueError where the standard has none."""
    transition = EVENTS.get((state, event))
    if transition is None:
        raise ValueError(f"no transition for {event.name} in {state.name}")
    return transition
