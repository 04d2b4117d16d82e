"""NMT slave: states, commands, and which services live in which state (CiA 301, NMT). The node acts on it."""

from __future__ import annotations

from enum import IntEnum

COB_ID = 0x000
"""NMT commands: [command, node id], node id 0 means all."""


class NmtState(IntEnum):
    """States as the heartbeat shows them; INITIALISING shows in the boot-up message only."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


class NmtCommand(IntEnum):
    """Command specifiers of the NMT frame."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


ENTERS = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
    NmtCommand.RESET_NODE: NmtState.INITIALISING,
    NmtCommand.RESET_COMMUNICATION: NmtState.INITIALISING,
}
"""The state that each command leads to, from every state but INITIALISING."""

HAS_SDO = frozenset({NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL})
"""States with SDO, SYNC and EMCY. Heartbeat and NMT work in STOPPED too, PDOs in OPERATIONAL only."""


def command_for(node_id: int, data: bytes) -> NmtCommand | None:
    """The command that an NMT frame gives to `node_id`; None: for another node, or no such command."""
    if len(data) != 2 or data[1] not in (0, node_id) or data[0] not in NmtCommand.__members__.values():
        return None
    return NmtCommand(data[0])
