"""The PDOs of docs/bus.md as data: which exist, with which identifiers and contents, and their packing.

The profile of the drive has the places and widths of its objects. Writing the layout into a drive is `pdo_mapping.py`.
The layout of the quick stop PDO is the watchdog's; its sender is too.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, replace

from canbase_config.drive import Drive
from canbase_config.drive_values import FIRST_SPARE_TPDO, ValuePdo, value_pdos
from canbase_config.object_map import (
    CONTROLWORD,
    POSITION_ACTUAL,
    STATUSWORD,
    TARGET_VELOCITY,
    TORQUE_OBJECTS,
    VELOCITY_ACTUAL,
    place,
)
from canbase_config.profile import Layout, Profile
from canbase_config.robot import Robot
from canbase_driver.cia301.nmt import RPDO, TPDO

EVERY_SYNC = 1
"""Transmission type: a TPDO goes out after each SYNC, an RPDO takes effect at the next one (CiA 301)."""
AT_ONCE, AT_ONCE_TOO = 255, 254
"""Transmission types: event driven, an RPDO takes effect when it arrives (CiA 301, profile's and vendor's event)."""
QUICK_STOP_RPDO = 4
"""The watchdog's PDO has this number, or the last one of a drive with fewer."""

GENERIC_PROFILE = Profile(title="generic")
GENERIC = GENERIC_PROFILE.layout
_SETPOINT = {16: struct.Struct("<Hh"), 32: struct.Struct("<Hi")}
_STATUS = {False: struct.Struct("<Hi"), True: struct.Struct("<Ii")}
"""By whether the statuswords of two axes are packed into one object."""
_STATUS_BYTES, _WITH_VELOCITY_BYTES = 6, 8
_VELOCITY = {16: struct.Struct("<h"), 32: struct.Struct("<i")}
_TORQUE = struct.Struct("<h")
TORQUE_BYTES = 2
LONGEST_INHIBIT = 0xFFFF
"""1800h:3 has 16 bits: 6.5 s."""
ROUNDING_MS = 1e-6
"""A cycle of 10 ms is one of 10.000000000000002 ms too."""
RATED = 1000.0
"""6077h and 6078h at rated torque (CiA 402-2)."""


@dataclass(frozen=True, slots=True)
class Pdo:
    """One PDO as it is written to a drive: `mapping` holds the entries of 1600h/1A00h in order."""

    kind: str
    """"RPDO" (to the drive) or "TPDO" (from it)."""
    number: int
    """1…512."""
    cob_id: int = 0
    transmission_type: int = EVERY_SYNC
    mapping: tuple[int, ...] = ()
    optional: int = 0
    """This many at the end of the mapping may be missing."""
    inhibit_100us: int | None = None
    """1800h:3, None: not written."""
    event_timer_ms: int | None = None
    """1400h:5 or 1800h:5, None: not written."""

    @property
    def name(self) -> str:
        """RPDO1, TPDO2, …"""
        return f"{self.kind}{self.number}"

    @property
    def is_received(self) -> bool:
        """Whether the driver receives it: whether it is on, and how long it is, shows by itself."""
        return self.kind == "TPDO"

    @property
    def size(self) -> int:
        """Bytes that are mapped."""
        return sum(entry & 0xFF for entry in self.mapping) // 8

    @property
    def communication(self) -> int:
        """Index of its communication parameters, 1400h… or 1800h…"""
        return (0x1400 if self.kind == "RPDO" else 0x1800) + self.number - 1

    @property
    def mapping_object(self) -> int:
        """Index of its mapping parameters, 1600h… or 1A00h…"""
        return self.communication + 0x200


@dataclass(frozen=True, slots=True)
class Timing:
    """What the times in PDOs follow from: the period of the control cycle, and how long setpoints may be missing."""

    cycle_s: float = 0.01
    deadline_s: float = 0.3


@dataclass(frozen=True, slots=True)
class NodeLayout:
    """The PDOs of one node with one or two used axes. Raises ValueError for any other set of axes."""

    node_id: int
    axes: tuple[int, ...]
    """Used axes in rising order; the first has RPDO1, TPDO1 and TPDO2, the second RPDO2, TPDO3 and TPDO4 (TPDO2 alone
    where the velocity is joined)."""
    profile: Profile = GENERIC_PROFILE
    timing: Timing = Timing()
    with_torque: bool = True
    """False: the drive refuses to map its torque."""
    joins_velocity: bool = False
    """True: the node has no velocity TPDO, its status TPDO carries the velocity too. Only where `fits_one_tpdo`."""
    values: tuple[ValuePdo, ...] = ()
    """Named values that its spare TPDOs carry."""

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

    @property
    def torque_objects(self) -> tuple[int, ...]:
        """6077h or 6078h where the velocity TPDO carries it behind 606Ch, else nothing."""
        index = TORQUE_OBJECTS.get(self.profile.options.torque)
        return () if index is None or not self.with_torque or self.joins_velocity else (index,)

    def torque_places(self) -> tuple[tuple[int, int], ...]:
        """Index and sub-index of the torque of each axis."""
        places = [place(self.profile, index, axis) for index in self.torque_objects for axis in self.axes]
        return tuple((at.index, at.sub) for at in places)

    def pdos(self) -> tuple[Pdo, ...]:
        """Every PDO in use, as docs/bus.md has them."""
        return (*self._setpoints(), self._quick_stop(), *self._feedback())

    def value_pdos(self) -> tuple[Pdo, ...]:
        """The spare TPDOs with named values, in the order of `values`. The node does without those that it refuses."""
        pdos = []
        for i, carried in enumerate(self.values):
            number = FIRST_SPARE_TPDO + i
            entries = tuple(value.index << 16 | value.sub << 8 | value.bits for value in carried.values)
            pdo = Pdo("TPDO", number, TPDO[number - 1] + self.node_id, carried.every, entries)
            pdos.append(pdo if self.profile.pdo.synchronous else self.by_event(pdo))
        return tuple(pdos)

    def _setpoints(self) -> list[Pdo]:
        has_deadline = self.profile.self_stop.rpdo_timer != "no"
        deadline_ms = round(1000 * self.timing.deadline_s) if has_deadline else None
        kind = EVERY_SYNC if self.profile.pdo.synchronous else AT_ONCE
        return [
            Pdo(
                "RPDO",
                1 + i,
                self.setpoint_cob_id(axis),
                kind,
                self._entries(axis, CONTROLWORD, TARGET_VELOCITY),
                event_timer_ms=deadline_ms,
            )
            for i, axis in enumerate(self.axes)
        ]

    def _quick_stop(self) -> Pdo:
        entries = dict.fromkeys(entry for axis in self.axes for entry in self._entries(axis, CONTROLWORD))
        number = min(QUICK_STOP_RPDO, self.profile.pdo.rpdos)
        return Pdo("RPDO", number, RPDO[3] + self.node_id, AT_ONCE, tuple(entries))

    def _feedback(self) -> list[Pdo]:
        pdos = []
        for i, axis in enumerate(self.axes):
            if self.joins_velocity:
                joined = self._entries(axis, STATUSWORD, POSITION_ACTUAL, VELOCITY_ACTUAL)
                pdos.append(self._tpdo(i + 1, self.status_cob_id(axis), joined))
                continue
            status = self._entries(axis, STATUSWORD, POSITION_ACTUAL)
            velocity = self._entries(axis, VELOCITY_ACTUAL, *self.torque_objects)
            pdos.append(self._tpdo(2 * i + 1, self.status_cob_id(axis), status))
            pdos.append(self._tpdo(2 * i + 2, self.velocity_cob_id(axis), velocity, len(self.torque_objects)))
        return pdos

    def feedback_pdo(self, axis: int, which: int) -> Pdo:
        """0: the TPDO with the status of this axis, 1: with its velocity."""
        cob_id = (self.status_cob_id(axis), self.velocity_cob_id(axis))[which and not self.joins_velocity]
        return next(pdo for pdo in self._feedback() if pdo.cob_id == cob_id)

    def _tpdo(self, number: int, cob_id: int, mapping: tuple[int, ...], optional: int = 0) -> Pdo:
        pdo = Pdo("TPDO", number, cob_id, mapping=mapping, optional=optional)
        return pdo if self.profile.pdo.synchronous else self.by_event(pdo)

    def by_event(self, pdo: Pdo) -> Pdo:
        """The same PDO without SYNC: an RPDO acts when it arrives, a TPDO goes by its timer, as often as by SYNC."""
        if pdo.kind == "RPDO":
            return replace(pdo, transmission_type=AT_ONCE)
        ms = max(1, math.ceil(1000.0 * self.timing.cycle_s * pdo.transmission_type - ROUNDING_MS))
        return replace(pdo, transmission_type=AT_ONCE, inhibit_100us=min(10 * ms, LONGEST_INHIBIT), event_timer_ms=ms)

    def _entries(self, axis: int, *indexes: int) -> tuple[int, ...]:
        return tuple(place(self.profile, index, axis).mapping_entry for index in indexes)


def node_layout(node_id: int, drives: tuple[Drive, ...], robot: Robot) -> NodeLayout:
    """The PDOs of a node whose used axes are `drives`, all of one profile. Raises ValueError when there is none."""
    if not drives:
        raise ValueError(f"node {node_id} has no axes")
    timing = Timing(1.0 / robot.rates.control_hz, robot.timeouts.drive_heartbeat_s)
    axes = tuple(sorted(drive.axis for drive in drives))
    values = value_pdos(drives[0].values, robot.rates.control_hz) if len(drives) == 1 else ()
    profile = drives[0].kind
    joins = profile.layout.fits_one_tpdo and profile.pdo.tpdos < 2 * len(axes)
    return NodeLayout(node_id, axes, profile, timing, joins_velocity=joins, values=values)


def pack_setpoint(controlword: int, target_raw: int, layout: Layout = GENERIC) -> bytes:
    """6040h and 60FFh for `setpoint_cob_id`. Raises struct.error when a value does not fit its object."""
    return _SETPOINT[layout.target_bits].pack(controlword, target_raw)


def unpack_status(data: bytes, layout: Layout = GENERIC, axis: int = 0) -> tuple[int, int] | None:
    """Statusword 6041h of an axis and position 6064h [increments], with or without a velocity behind them.

    None when the length is wrong: to be dropped and counted.
    """
    is_packed = layout.statusword == "packed"
    form = _STATUS[is_packed]
    if len(data) != form.size and not joined_velocity(data, layout):
        return None
    statusword, position = form.unpack_from(data)
    return (statusword >> 16 * axis & 0xFFFF if is_packed else statusword), position


def joined_velocity(data: bytes, layout: Layout = GENERIC) -> bytes:
    """The part of a status TPDO for `unpack_velocity`; empty: the velocity has a TPDO of its own."""
    joins = len(data) == _WITH_VELOCITY_BYTES and layout.fits_one_tpdo
    return data[_STATUS_BYTES:] if joins else b""


def unpack_velocity(data: bytes, layout: Layout = GENERIC) -> int | None:
    """Velocity 606Ch [raw], with or without a torque behind it; None when the length is wrong: to be dropped and
    counted."""
    form = _VELOCITY[layout.velocity_bits]
    beyond = len(data) - form.size
    return int(form.unpack_from(data)[0]) if beyond == 0 or beyond == TORQUE_BYTES else None


def unpack_torque(data: bytes, layout: Layout = GENERIC) -> float | None:
    """Torque behind the velocity, as a share of the rated one; None: the drive does not report it."""
    form = _VELOCITY[layout.velocity_bits]
    size = form.size
    return _TORQUE.unpack_from(data, size)[0] / RATED if len(data) == size + TORQUE_BYTES else None
