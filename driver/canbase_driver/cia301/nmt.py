"""CiA 301: identifiers, NMT commands and states, SYNC and heartbeat."""

from __future__ import annotations

from enum import IntEnum

from canbase_driver.cia301.frame import Frame

# CiA 301, predefined connection set: the node id is added to these.
EMCY = 0x080
TPDO = (0x180, 0x280, 0x380, 0x480)
RPDO = (0x200, 0x300, 0x400, 0x500)
SDO_TO_CLIENT = 0x580
SDO_TO_SERVER = 0x600
HEARTBEAT = 0x700
# Broadcast.
NMT = 0x000
ALL_NODES = 0
"""Node id of an NMT command to every node."""
MAX_NODE_ID = 127

SYNC = Frame(0x080)
"""SYNC without a counter byte (CiA 301, 1019h = 0)."""


class NmtState(IntEnum):
    """NMT state as a heartbeat carries it (CiA 301)."""

    INITIALISING = 0
    """Boot-up message, sent once after power on and after each reset."""
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127

    @property
    def text(self) -> str:
        """The state in the standard's words."""
        return self.name.lower().replace("_", "-")


class NmtCommand(IntEnum):
    """NMT command specifier (CiA 301)."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


def nmt(command: NmtCommand, node_id: int) -> Frame:
    """The NMT frame for one node, 1…127. `node_id` 0 addresses every node. Raises ValueError outside 0…127."""
    if not 0 <= node_id <= MAX_NODE_ID:
        raise ValueError(f"node id {node_id} is outside 0…127 (0 means every node)")
    return Frame(NMT, bytes((command, node_id)))


def heartbeat(node_id: int, state: NmtState) -> Frame:
    """The heartbeat of node 1…127. Raises ValueError for any other node id."""
    if not 1 <= node_id <= MAX_NODE_ID:
        raise ValueError(f"node id {node_id} is outside 1…127")
    return Frame(HEARTBEAT + node_id, bytes((state,)))


def parse_heartbeat(frame: Frame) -> tuple[int, NmtState | None] | None:
    """Node id and state of a heartbeat or boot-up; the state is None when its byte has no meaning in CiA 301.

    None for every other frame, and for a heartbeat that is not exactly one byte long: to be dropped and counted.
    """
    node_id = frame.cob_id - HEARTBEAT
    if not 1 <= node_id <= MAX_NODE_ID or len(frame.data) != 1:
        return None
    return node_id, _STATES.get(frame.data[0])


_STATES = {state.value: state for state in NmtState}


class SyncProducer:
    """The SYNC of each cycle: empty, or with a byte that counts from 1 to `overflow`, 2…240 (CiA 301, 1019h)."""

    def __init__(self, overflow: int | None) -> None:
        self._overflow = overflow
        self._count = 0

    def next(self) -> Frame:
        """The frame that is due now."""
        if self._overflow is None:
            return SYNC
        self._count = self._count % self._overflow + 1
        return Frame(SYNC.cob_id, bytes((self._count,)))
