"""LSS slave: node id, bit rate and identity of one drive over 7E5h and 7E4h (CiA 305 version 3). Pure.

A drive keeps each setting three times: stored (survives power off), pending (set by LSS, not in use yet) and active.
Pending node ids become active with NMT reset communication, pending bit rates with *activate bit timing*. 255 (FFh)
is the node id of a drive that has none: it answers LSS alone, and only such drives take part in fastscan.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from enum import Enum

from canbase_sim.cia305.bit_timing import BIT_RATES
from canbase_sim.frame import Frame

REQUEST, ANSWER = 0x7E5, 0x7E4
"""COB-IDs: from the LSS master, and to it."""
UNCONFIGURED = 0xFF
"""The node id of a drive that has none."""
MAX_NODE_ID = 127

SWITCH_GLOBAL = 0x04
SELECT = (0x40, 0x41, 0x42, 0x43)
"""Vendor, product code, revision, serial of the drive that is to be configured."""
SELECTED, IDENTIFIED = 0x44, 0x4F
SET_NODE_ID, SET_BIT_TIMING, ACTIVATE_BIT_TIMING, STORE = 0x11, 0x13, 0x15, 0x17
IDENTIFY_UNCONFIGURED, IDENTIFIED_UNCONFIGURED = 0x4C, 0x50
FASTSCAN = 0x51
INQUIRE = (0x5A, 0x5B, 0x5C, 0x5D)
INQUIRE_NODE_ID = 0x5E
ALL_AGAIN = 0x80
"""BitCheck of fastscan: every drive without a node id answers, and begins the scan again."""
OUT_OF_RANGE = 1
"""Error code of SET_NODE_ID and SET_BIT_TIMING."""
NOT_STORED = 2
"""Error code of STORE: the memory cannot be written."""


class LssState(Enum):
    """LSS states of a drive."""

    WAITING = 0
    CONFIGURATION = 1


class LssSlave:
    """`send` takes the answers; `apply` is called when a pending node id is to become active by itself.

    `node_id` and `bitrate` [bit/s] are the active ones. `memory_fails`: a fault, STORE is refused.
    `answers_every_scan`: in LSS configuration it answers each fastscan request, as that of CANopenNode does.
    """

    def __init__(
        self,
        identity: Callable[[int], int],
        node_id: int,
        bitrate: int,
        send: Callable[[Frame], None],
        apply: Callable[[], None],
    ) -> None:
        """`identity`: of sub-indexes 1 to 4 of 1018h. Both settings are what is stored when the drive is new."""
        self._identity, self._send, self._apply = identity, send, apply
        self._stored = (node_id, bitrate)
        self.memory_fails = self.answers_every_scan = False
        self.power_on()

    def power_on(self) -> None:
        """What is stored counts."""
        self.pending_node_id, self._pending_bitrate = self._stored
        self.node_id, self.bitrate = self._stored
        self.state = LssState.WAITING
        self._address = [0, 0, 0, 0]
        self._scan_at = 0
        """The part of the identity that fastscan looks at now."""
        self.switch_at: float | None = None
        """When the next step of a change of the bit rate is due; None: there is none under way."""
        self._switch_s = 0.0

    def reset_communication(self) -> None:
        """The pending node id becomes active. The bit rate does not change."""
        self.node_id = self.pending_node_id

    @property
    def is_unconfigured(self) -> bool:
        """It has no node id."""
        return self.node_id == UNCONFIGURED

    @property
    def is_on_bus(self) -> bool:
        """False while the bit rate changes: it neither sends nor receives then."""
        return self.switch_at is None

    def on_frame(self, data: bytes, now_s: float) -> None:
        """One request. LSS frames have eight bytes; others are ignored."""
        if len(data) != 8:
            return
        command = data[0]
        if command == SWITCH_GLOBAL:
            self._switch_global(data[1])
        elif command == IDENTIFY_UNCONFIGURED and self._scannable:
            self._answer(IDENTIFIED_UNCONFIGURED)
        elif self.state is LssState.CONFIGURATION:
            self._configure(command, data, now_s)
        elif command in SELECT:
            self._select(SELECT.index(command), _number(data))
        elif command == FASTSCAN and self._scannable:
            self._fastscan(_number(data), *data[5:8])

    def tick(self, now_s: float) -> None:
        """Goes on with a change of the bit rate: silence, the new rate, silence of the same length."""
        if self.switch_at is None or now_s < self.switch_at:
            return
        if self.bitrate != self._pending_bitrate:
            self.bitrate, self.switch_at = self._pending_bitrate, self.switch_at + self._switch_s
        else:
            self.switch_at = None

    @property
    def _scannable(self) -> bool:
        return self.is_unconfigured and self.pending_node_id == UNCONFIGURED

    def _switch_global(self, mode: int) -> None:
        if mode == LssState.CONFIGURATION.value:
            self.state = LssState.CONFIGURATION
        elif mode == LssState.WAITING.value:
            is_done = self.state is LssState.CONFIGURATION
            self.state, self._address, self._scan_at = LssState.WAITING, [0, 0, 0, 0], 0
            if is_done and self.is_unconfigured and self.pending_node_id != UNCONFIGURED:
                self._apply()

    def _select(self, part: int, number: int) -> None:
        self._address[part] = number
        if part == 3 and self._address == [self._identity(sub) for sub in range(1, 5)]:
            self.state = LssState.CONFIGURATION
            self._answer(SELECTED)

    def _fastscan(self, number: int, bit: int, part: int, following: int) -> None:
        """Answers while the identity has the same bits as `number` from `bit` on upward (CiA 305, fastscan)."""
        if bit == ALL_AGAIN:
            self._scan_at = 0
        elif (
            bit > 31 or part > 3 or following > 3 or part != self._scan_at or (self._identity(part + 1) ^ number) >> bit
        ):
            return
        else:
            self._scan_at = following
            if bit == 0 and part == 3 and following == 0:
                self.state = LssState.CONFIGURATION
        self._answer(IDENTIFIED)

    def _configure(self, command: int, data: bytes, now_s: float) -> None:
        if command == SET_NODE_ID:
            self._set_node_id(data[1])
        elif command == SET_BIT_TIMING:
            self._set_bit_timing(data[1], data[2])
        elif command == ACTIVATE_BIT_TIMING:
            self._activate(int.from_bytes(data[1:3], "little") / 1000.0, now_s)
        elif command == STORE:
            self._store()
        elif command in INQUIRE:
            self._answer(command, struct.pack("<I", self._identity(INQUIRE.index(command) + 1)))
        elif command == INQUIRE_NODE_ID:
            self._answer(command, bytes((self.node_id,)))
        elif command == FASTSCAN and self.answers_every_scan:
            self._answer(IDENTIFIED)

    def _set_node_id(self, node_id: int) -> None:
        fits = 1 <= node_id <= MAX_NODE_ID or node_id == UNCONFIGURED
        if fits:
            self.pending_node_id = node_id
        self._answer(SET_NODE_ID, bytes((0 if fits else OUT_OF_RANGE, 0)))

    def _set_bit_timing(self, table: int, index: int) -> None:
        fits = table == 0 and index in BIT_RATES
        if fits:
            self._pending_bitrate = BIT_RATES[index]
        self._answer(SET_BIT_TIMING, bytes((0 if fits else OUT_OF_RANGE, 0)))

    def _activate(self, delay_s: float, now_s: float) -> None:
        self._switch_s, self.switch_at = delay_s, now_s + delay_s

    def _store(self) -> None:
        if not self.memory_fails:
            self._stored = (self.pending_node_id, self._pending_bitrate)
        self._answer(STORE, bytes((NOT_STORED if self.memory_fails else 0, 0)))

    def _answer(self, command: int, rest: bytes = b"") -> None:
        self._send(Frame(ANSWER, (bytes((command,)) + rest).ljust(8, b"\0")))


def _number(data: bytes) -> int:
    number: int = struct.unpack_from("<I", data, 1)[0]
    return number
