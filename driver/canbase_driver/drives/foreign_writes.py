"""Writes of another client to a node of ours: a tool, another master. CiA 301.

An SDO answer goes to all that listen. One that confirms a write which the driver did not make shows such a client.
Every object counts, because no list of those by which a drive stops or measures would be complete; but not what the
driver commands by SDO itself, and the watchdog's "disable voltage".
"""

from __future__ import annotations

from typing import Final

from canbase_config.object_map import AXIS_OFFSET, CONTROLWORD, TARGET_VELOCITY, VL_TARGET_VELOCITY
from canbase_driver.boot.node_boot import NodeBoot
from canbase_driver.cia301.frame import Frame

COMMANDED: Final = frozenset(
    index + offset for index in (CONTROLWORD, TARGET_VELOCITY, VL_TARGET_VELOCITY) for offset in (0, AXIS_OFFSET)
)
"""What the driver sends itself, of both axes: 6040h, 60FFh, and 6042h of mode 2."""
_WRITTEN: Final = 3 << 5
"""First byte of the answer to a Write (CiA 301, SDO download)."""
_COMMAND: Final = 7 << 5
_BLOCK: Final = (0xA0, 0xA4)
"""The same where it writes a block, without and with a checksum."""
_SENDS_BLOCK, _BEGINS_BLOCK = 0xE1, 0xC0
"""The node begins to send a block (CiA 301, upload: scs 6, ss 0): segments follow, which begin with their number."""
_NUMBER: Final = 0x7F


class ForeignWrites:
    """Takes every SDO answer of one node, and finds the writes in them."""

    def __init__(self) -> None:
        self._segment: int | None = None
        """Number of the last segment of a block that another client reads from the node; None: no block is read."""

    def take_sdo_answer(self, frame: Frame) -> str:
        """The object that this answer shows as written, like "1016h:1"; empty: none.

        The caller knows that it answers no request of ours: outside of a boot the driver writes only `COMMANDED`.
        """
        data = frame.data
        if len(data) != 8 or self._is_segment(data[0]):
            return ""
        if data[0] & _COMMAND != _WRITTEN and data[0] not in _BLOCK:
            return ""
        index = int.from_bytes(data[1:3], "little")
        return "" if index in COMMANDED else f"{index:04X}h:{data[3]}"

    def _is_segment(self, first: int) -> bool:
        """Segments are numbered from 1, again after each that the client has confirmed; another answer ends them."""
        number = first & _NUMBER
        if self._segment is not None and number in (self._segment + 1, 1):
            self._segment = number
            return True
        self._segment = 0 if first & _SENDS_BLOCK == _BEGINS_BLOCK else None
        return False


class WritesInBoot:
    """Looks at them while a boot runs.

    What the boot has not dealt with yet it sets or compares later. What it never deals with counts when it has ended.
    """

    def __init__(self, foreign: ForeignWrites) -> None:
        self._foreign = foreign
        self._early: dict[bytes, str] = {}
        self._written = ""

    def take_sdo_answer(self, frame: Frame, boot: NodeBoot) -> None:
        """An SDO answer, before `boot` takes it in."""
        at = frame.data[1:4]
        name = self._foreign.take_sdo_answer(frame)
        name = "" if boot.may_confirm(at) else name
        if name and boot.has_requested(at):
            self._written = name
        elif name:
            self._early[at] = name

    def left_by(self, boot: NodeBoot) -> str:
        """The object that another client has written and this boot, now at its end, has not set again; empty: none."""
        undone = (name for at, name in self._early.items() if not boot.has_requested(at))
        return self._written or next(undone, "")
