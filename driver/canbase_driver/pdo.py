"""The PDOs of docs/bus.md as data: which exist, with which identifiers and contents, and their packing.

Writing the layout into a drive is `boot.py`. The layout of the quick stop PDO is the watchdog's; its sender is too.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from canbase_driver.cia301 import RPDO, TPDO
from canbase_driver.cia402 import axis_object

EVERY_SYNC = 1
"""Transmission type: a TPDO goes out after each SYNC, an RPDO takes effect at the next one (CiA 301)."""
AT_ONCE = 255
"""Transmission type: event driven, an RPDO takes effect when it arrives (CiA 301, profile event)."""

CONTROLWORD, STATUSWORD = 0x6040, 0x6041
POSITION_ACTUAL, VELOCITY_ACTUAL, TARGET_VELOCITY = 0x6064, 0x606C, 0x60FF

_SETPOINT = struct.Struct("<Hi")
_STATUS = struct.Struct("<Hi")
_VELOCITY = struct.Struct("<i")


@dataclass(frozen=True, slots=True)
class Pdo:
    """One PDO as a drive is to be told: `mapping` holds the entries of 1600h/1A00h in order."""

    kind: str
    """"RPDO" (to the drive) or "TPDO" (from it)."""
    number: int
    """1…512."""
    cob_id: int = 0
    transmission_type: int = EVERY_SYNC
    mapping: tuple[int, ...] = ()

    @property
    def name(self) -> str:
        """RPDO1, TPDO2, …"""
        return f"{self.kind}{self.number}"

    @property
    def communication(self) -> int:
        """Index of its communication parameters, 1400h… or 1800h…"""
        return (0x1400 if self.kind == "RPDO" else 0x1800) + self.number - 1

    @property
    def mapping_object(self) -> int:
        """Index of its mapping parameters, 1600h… or 1A00h…"""
        return self.communication + 0x200


@dataclass(frozen=True, slots=True)
class NodeLayout:
    """The PDOs of one node with one or two used axes. Raises ValueError for any other set of axes."""

    node_id: int
    axes: tuple[int, ...]
    """Used axes in rising order; the first has RPDO1, TPDO1 and TPDO2, the second RPDO2, TPDO3 and TPDO4."""

    def __post_init__(self) -> None:
        if self.axes not in ((0,), (1,), (0, 1)):
            raise ValueError(f"axes {self.axes} of node {self.node_id}: expected (0,), (1,) or (0, 1)")

    def setpoint_cob_id(self, axis: int) -> int:
        """Identifier of the RPDO that takes `pack_setpoint` for this axis. Raises ValueError for an unused axis."""
        return RPDO[self.axes.index(axis)] + self.node_id

    def status_cob_id(self, axis: int) -> int:
        """Identifier of the TPDO for `unpack_status` of this axis. Raises ValueError for an unused axis."""
        return TPDO[2 * self.axes.index(axis)] + self.node_id

    def velocity_cob_id(self, axis: int) -> int:
        """Identifier of the TPDO for `unpack_velocity` of this axis. Raises ValueError for an unused axis."""
        return TPDO[2 * self.axes.index(axis) + 1] + self.node_id

    def pdos(self) -> tuple[Pdo, ...]:
        """Every PDO in use, as docs/bus.md has them."""
        setpoints = [
            Pdo(
                "RPDO", 1 + i, self.setpoint_cob_id(axis), EVERY_SYNC, self._entries(axis, CONTROLWORD, TARGET_VELOCITY)
            )
            for i, axis in enumerate(self.axes)
        ]
        quick_stop = Pdo("RPDO", 4, RPDO[3] + self.node_id, AT_ONCE, self._quick_stop_entries())
        return (*setpoints, quick_stop, *self._feedback())

    def _feedback(self) -> list[Pdo]:
        pdos = []
        for i, axis in enumerate(self.axes):
            status, velocity = self._entries(axis, STATUSWORD, POSITION_ACTUAL), self._entries(axis, VELOCITY_ACTUAL)
            pdos.append(Pdo("TPDO", 2 * i + 1, self.status_cob_id(axis), mapping=status))
            pdos.append(Pdo("TPDO", 2 * i + 2, self.velocity_cob_id(axis), mapping=velocity))
        return pdos

    def _quick_stop_entries(self) -> tuple[int, ...]:
        return tuple(entry for axis in self.axes for entry in self._entries(axis, CONTROLWORD))

    @staticmethod
    def _entries(axis: int, *indexes: int) -> tuple[int, ...]:
        return tuple(mapping_entry(axis_object(index, axis), 0, _BITS[index]) for index in indexes)


_BITS = {CONTROLWORD: 16, STATUSWORD: 16, POSITION_ACTUAL: 32, VELOCITY_ACTUAL: 32, TARGET_VELOCITY: 32}


def mapping_entry(index: int, sub: int, bits: int) -> int:
    """An entry of 1600h/1A00h (CiA 301): index, sub-index and length in bits."""
    return index << 16 | sub << 8 | bits


def pack_setpoint(controlword: int, target_raw: int) -> bytes:
    """6040h and 60FFh for `setpoint_cob_id`. Raises struct.error when a value does not fit 16 and 32 bits."""
    return _SETPOINT.pack(controlword, target_raw)


def unpack_status(data: bytes) -> tuple[int, int] | None:
    """Statusword 6041h and position 6064h [increments]; None when the length is wrong: to be dropped and counted."""
    if len(data) != _STATUS.size:
        return None
    statusword, position = _STATUS.unpack(data)
    return statusword, position


def unpack_velocity(data: bytes) -> int | None:
    """Velocity 606Ch [raw]; None when the length is wrong: to be dropped and counted."""
    if len(data) != _VELOCITY.size:
        return None
    (velocity,) = _VELOCITY.unpack(data)
    return int(velocity)
