"""Writes of another client to what the boot of a node has set or compared: a tool, another master. CiA 301.

An SDO answer goes to all that listen. One that confirms a write which the boot did not make shows such a client.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from canbase_config.drive import Drive
from canbase_config.object_map import AXIS_OFFSET
from canbase_config.profile import SDO_SERVERS, STOPPED_BY, Profile
from canbase_config.scale_objects import SCALE_OBJECTS
from canbase_driver.boot.node_boot import NodeBoot
from canbase_driver.boot.vl_settings import FACTOR
from canbase_driver.cia301.frame import Frame

PDOS: Final = range(0x1400, 0x1C00)
"""Which PDOs the drive obeys and sends, and what they contain."""
RAMPS: Final = (0x6083, 0x6084, 0x6085)
VL: Final = (0x6046, 0x6048, 0x6049, 0x604A)
"""Limits and ramps of mode 2."""
_WRITTEN: Final = 3 << 5
"""First byte of the answer to a Write (CiA 301, SDO download)."""
_COMMAND: Final = 7 << 5
_BLOCK: Final = (0xA0, 0xA4)
"""The same where it writes a block, without and with a checksum."""


def is_of_scale(index: int, drives: Sequence[Drive] = ()) -> bool:
    """Whether the boot only compares this object, with `expects` of these drives, and does not set it as 604Ch."""
    noted = {each.index for drive in drives for each in drive.expects}
    of_an_axis = SCALE_OBJECTS.keys() - {FACTOR}
    return index in of_an_axis or index - AXIS_OFFSET in of_an_axis or index in noted


def set_by_boot(index: int, kind: Profile, drives: Sequence[Drive] = ()) -> bool:
    """Whether another client's write to this object makes the driver boot a node of this kind anew.

    `drives`: of that node, whose `expects` count too.
    """
    return index in PDOS or index in SDO_SERVERS or index in _objects(kind, drives)


def _objects(kind: Profile, drives: Sequence[Drive]) -> frozenset[int]:
    own = kind.self_stop.vendor_watchdog
    axis = (*RAMPS, *VL, *SCALE_OBJECTS, *(index for index in STOPPED_BY if index >= 0x6000))
    makers = () if own is None or own.index is None else (own.index,)
    besides = (each.index for each in (*kind.writes.before_mapping, *kind.writes.after_mapping))
    noted = (each.index for drive in drives for each in drive.expects)
    return frozenset({*STOPPED_BY, *axis, *(index + AXIS_OFFSET for index in axis), *makers, *besides, *noted})


class ForeignWrites:
    """Looks at the SDO answers of one node that belong to no request of ours."""

    def __init__(self, drives: Sequence[Drive]) -> None:
        """`drives`: of this node, all of one kind."""
        self._watched = _objects(drives[0].kind, drives)

    def take(self, frame: Frame) -> str:
        """The object that another client has written, as "1016h:1"; empty: this answer shows none."""
        data = frame.data
        if len(data) != 8 or (data[0] & _COMMAND != _WRITTEN and data[0] not in _BLOCK):
            return ""
        index = int.from_bytes(data[1:3], "little")
        is_watched = index in self._watched or index in PDOS or index in SDO_SERVERS
        return f"{index:04X}h:{data[3]}" if is_watched else ""


class WritesInBoot:
    """Looks at them while a boot runs.

    What the boot has not dealt with yet it sets or compares later. What it never deals with counts when it has ended.
    """

    def __init__(self, foreign: ForeignWrites) -> None:
        self._foreign = foreign
        self._early: dict[bytes, str] = {}
        self._written = ""

    def take(self, frame: Frame, boot: NodeBoot) -> None:
        """An SDO answer, before `boot` takes it in."""
        at = frame.data[1:4]
        name = "" if boot.may_confirm(at) else self._foreign.take(frame)
        if name and boot.has_requested(at):
            self._written = name
        elif name:
            self._early[at] = name

    def left_by(self, boot: NodeBoot) -> str:
        """The object that another client has written and this boot, now at its end, has not set again; empty: none."""
        undone = (name for at, name in self._early.items() if not boot.has_requested(at))
        return self._written or next(undone, "")
