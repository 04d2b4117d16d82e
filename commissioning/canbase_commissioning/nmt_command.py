"""`canbase bus nmt`: what each NMT command does to a motor, and whether the nodes did it. CiA 301, CiA 402-2. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

from canbase_commissioning.bus_monitor import HeardNode
from canbase_commissioning.object_dictionary import Address, statuswords
from canbase_config.object_map import STATUSWORD
from canbase_driver.boot.steps import Steps, unsigned
from canbase_driver.cia301.nmt import NmtCommand, NmtState
from canbase_driver.cia301.sdo_client import NO_OBJECT, NO_SUB_INDEX, Read, SdoAborted, SdoTimeout
from canbase_driver.cia402 import decode_statusword

ABORT_CONNECTION: Final = 0x6007
ABORT_TEXTS: Final = {
    0: "6007h is 0: the motor goes on as before",
    1: "6007h is 1: the drive goes into fault, and stops as by 605Eh",
    2: "6007h is 2: power off, the motor coasts",
    3: "6007h is 3: quick stop",
}
ABSENT: Final = (NO_OBJECT, NO_SUB_INDEX)


class Order(str, Enum):
    """As it is written on the command line."""

    START = "start"
    STOP = "stop"
    PREOP = "preop"
    RESET = "reset"
    RESET_COMM = "reset-comm"

    @property
    def command(self) -> NmtCommand:
        """The NMT command."""
        return _COMMANDS[self]

    @property
    def reached(self) -> tuple[NmtState, ...]:
        """The states of a node that has obeyed. Some drives become operational by themselves after a reset."""
        return _REACHED[self]

    @property
    def effect(self) -> str:
        """What it does to power and motion, in a sentence."""
        return EFFECTS[self]


_COMMANDS: Final = {
    Order.START: NmtCommand.START,
    Order.STOP: NmtCommand.STOP,
    Order.PREOP: NmtCommand.ENTER_PRE_OPERATIONAL,
    Order.RESET: NmtCommand.RESET_NODE,
    Order.RESET_COMM: NmtCommand.RESET_COMMUNICATION,
}
_AFTER_RESET: Final = (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL)
_REACHED: Final = {
    Order.START: (NmtState.OPERATIONAL,),
    Order.STOP: (NmtState.STOPPED,),
    Order.PREOP: (NmtState.PRE_OPERATIONAL,),
    Order.RESET: _AFTER_RESET,
    Order.RESET_COMM: _AFTER_RESET,
}
EFFECTS: Final = {
    Order.START: "it gives no power; PDOs begin, so a motor that has power follows the next setpoint on the bus",
    Order.STOP: "it ends PDOs and SDO; a motor with power stops only as 6007h orders. It is no emergency stop",
    Order.PREOP: "it ends PDOs; most drives do nothing else, and a motor with power goes on as it was ordered",
    Order.RESET: "the drive starts anew with its stored parameters; its power goes, and a motor that turns coasts",
    Order.RESET_COMM: "communication starts anew; a motor with power stops only as 6007h orders",
}


@dataclass(frozen=True, slots=True)
class NodePower:
    """One node before the command. `states`: by statusword, in words; `powered`: those with torque.

    `unknown`: why its power is not known; empty: it is. `on_loss`: what it does when the connection ends.
    """

    node_id: int
    states: Mapping[Address, str]
    powered: tuple[Address, ...] = ()
    unknown: str = ""
    on_loss: str = ""

    @property
    def needs_a_person(self) -> bool:
        """Whether the command may move or stop a motor, as far as is known."""
        return bool(self.powered or self.unknown)

    def __str__(self) -> str:
        if self.unknown:
            return f"node {self.node_id}: whether a motor has power is unknown: {self.unknown}"
        if not self.states:
            return f"node {self.node_id}: no statusword, so no CiA 402 drive"
        shown = ", ".join(f"{at} {text}" for at, text in self.states.items())
        return f"node {self.node_id}: {shown}{f'; HAS POWER; {self.on_loss}' if self.powered else '; no power'}"


def power_of(node_id: int, status_at: Sequence[Address]) -> Steps[NodePower]:
    """Reads statuswords and, where a motor has power, 6007h. A node that does not answer is no error."""
    states: dict[Address, str] = {}
    powered: list[Address] = []
    try:
        for at in status_at:
            data = yield from _read(at)
            for word in statuswords(data):
                state = decode_statusword(word)
                states[at] = "unknown state" if state is None else state.text
                powered += [at] if state is None or state.has_torque else []
        on_loss = (yield from _on_loss(powered[0])) if powered else ""
    except SdoTimeout:
        return NodePower(node_id, states, unknown="it does not answer SDO (NMT stopped?)")
    except SdoAborted as refused:
        return NodePower(node_id, states, unknown=refused.text)
    return NodePower(node_id, states, tuple(dict.fromkeys(powered)), "", on_loss)


def _on_loss(at: Address) -> Steps[str]:
    data = yield from _read(Address(at.index - STATUSWORD + ABORT_CONNECTION))
    if not data:
        return "it has no 6007h, and may keep its last speed"
    code = int.from_bytes(data[:2], "little", signed=True)
    return ABORT_TEXTS.get(code, f"6007h is {unsigned(data)}, which the maker defines")


def _read(at: Address) -> Steps[bytes]:
    """Empty: the drive has no such object."""
    try:
        data: bytes = yield Read(at.index, at.sub)
    except SdoAborted as refused:
        if refused.code in ABSENT:
            return b""
        raise
    return data


def outcome(order: Order, node: HeardNode | None, node_id: int) -> tuple[bool, str]:
    """Whether a node has obeyed as far as it shows, and a line about it. `node`: what came since the command."""
    state = None if node is None else node.nmt_state
    if state in order.reached:
        return True, f"node {node_id}: {state.text}"
    if state is not None:
        return False, f"node {node_id}: {state.text}, not {order.reached[0].text}"
    if order in (Order.RESET, Order.RESET_COMM):
        return False, f"node {node_id}: no boot-up message"
    return True, f"node {node_id}: sent; it produces no heartbeat (1017h), so its state does not show"
