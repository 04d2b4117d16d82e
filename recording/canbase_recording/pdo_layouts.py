"""What each PDO contains, and how that is known. Pure; it guesses nothing without saying so.

In this order: robot.yaml; the mapping that the recording shows being written or read by SDO; canbase's own layout, in a
recording with canbase's watchdog; the default mapping of CiA 402-2, where the length of the frame fits it and nothing
refutes it: a device type (1000h) of another profile, or a TPDO of the same node with another length. A robot.yaml names
all drives: of other nodes nothing is assumed then.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Final

from canbase_config.drive_values import DriveValue, ValuePdo
from canbase_config.object_map import (
    AXIS_OFFSET,
    CONTROLWORD,
    CURRENT_ACTUAL,
    MODE,
    MODE_DISPLAY,
    POSITION_ACTUAL,
    STATUSWORD,
    TARGET_VELOCITY,
    TORQUE_ACTUAL,
    VELOCITY_ACTUAL,
    place,
)
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID, Robot
from canbase_driver.cia301.nmt import RPDO, TPDO
from canbase_driver.cia301.pdo import NodeLayout, node_layout

MOST_MAPPED: Final = 64
"""Objects in one PDO: one bit each (CiA 301)."""
MOST_LEARNED: Final = 2_000
"""PDOs whose settings are remembered: four of each node are about a thousand."""
OFF: Final = 1 << 31
DEVICE_TYPE: Final = 0x1000
DRIVES: Final = 402
"""The profile in the lower half of a device type: drives and motion control."""
TARGET_POSITION: Final = 0x607A
SIGNED: Final = frozenset(
    (0x6007, MODE, MODE_DISPLAY, POSITION_ACTUAL, VELOCITY_ACTUAL, TARGET_VELOCITY, TORQUE_ACTUAL, CURRENT_ACTUAL,
     0x6071, TARGET_POSITION)
)  # fmt: skip
_RPDO_COMMUNICATION, _RPDO_MAPPING = range(0x1400, 0x1600), range(0x1600, 0x1800)
_TPDO_COMMUNICATION, _TPDO_MAPPING = range(0x1800, 0x1A00), range(0x1A00, 0x1C00)


class Source(Enum):
    """How it is known what a PDO contains; the value is for people."""

    ROBOT = "robot.yaml"
    SDO = "mapping written or read by SDO in this recording"
    CANBASE = "assumed: canbase's layout of a generic drive"
    CIA_402 = "assumed: default mapping of CiA 402"

    @property
    def is_assumed(self) -> bool:
        """It is a guess."""
        return self in (Source.CANBASE, Source.CIA_402)


@dataclass(frozen=True, slots=True)
class Mapped:
    """One object in a PDO. `base`: the object of the first axis that it is, of `axis`; bits from the first one on.

    `named`: one of `values` of its drive in robot.yaml. Its `base` is 0: it is evidence of no command and no motion.
    """

    index: int
    sub: int
    base: int
    axis: int
    first_bit: int
    bits: int
    named: DriveValue | None = None

    def value(self, data: bytes) -> int:
        """Out of the PDO's bytes, which must be long enough."""
        raw = int.from_bytes(data, "little") >> self.first_bit & (1 << self.bits) - 1
        signed = self.named.signed if self.named else self.base in SIGNED
        negative = signed and self.bits > 1 and raw >> (self.bits - 1)
        return raw - (1 << self.bits) if negative else raw


@dataclass(frozen=True, slots=True)
class PdoLayout:
    """One PDO of one node. `bits`: the length of all that is mapped."""

    name: str
    node_id: int
    mapped: tuple[Mapped, ...]
    bits: int
    source: Source
    exact: bool = True
    """A frame of another length is not this PDO. An RPDO may be longer than its mapping (CiA 301); TPDOs are exact."""

    def fits(self, length: int) -> bool:
        """Whether a frame of so many bytes can be this PDO."""
        return 8 * length == self.bits if self.exact else 8 * length >= self.bits


@dataclass(slots=True)
class _Learned:
    """What SDO transfers have shown of one PDO of one node."""

    cob_id: int | None = None
    count: int | None = None
    entries: dict[int, int] = field(default_factory=dict)


class PdoLayouts:
    """All PDOs of a recording, by COB-ID."""

    def __init__(self, robot: Robot | None = None) -> None:
        self._robot = robot
        self._known: dict[int, list[PdoLayout]] = {}
        self._learned: dict[tuple[int, bool, int], _Learned] = {}
        self._is_canbase = False
        self._by_length: dict[tuple[int, int], PdoLayout | None] = {}
        self.refuted: set[int] = set()
        """Nodes that do not have the default mapping of CiA 402: nothing is assumed of them."""
        self._own: set[int] = set()
        """Nodes whose layout robot.yaml gives."""
        if robot is not None:
            self._take_robot(robot)

    def of(self, cob_id: int, length: int) -> PdoLayout | None:
        """The layout of a frame of `length` bytes; None: it is no PDO, or nobody knows what is in it."""
        key = (cob_id, length)
        if key not in self._by_length:
            self._by_length[key] = self._find(cob_id, length)
        return self._by_length[key]

    def on_canbase(self) -> None:
        """The recording has frames of canbase's watchdog."""
        if not self._is_canbase:
            self._is_canbase = True
            self.refuted.clear()
            self._by_length.clear()

    def on_object(self, node_id: int, index: int, sub: int, value: int) -> None:
        """An SDO transfer has written or read this value, and the node confirmed it."""
        if index == DEVICE_TYPE and value & 0xFFFF != DRIVES and not self._is_canbase:
            self._refute(node_id)
        where = next((each for each in _PLACES if index in each[0]), None)
        if where is None:
            return
        objects, is_rpdo, is_mapping = where
        key = (node_id, is_rpdo, index - objects.start + 1)
        if key not in self._learned and len(self._learned) >= MOST_LEARNED:
            return
        learned = self._learned.setdefault(key, _Learned())
        if not is_mapping and sub == 1:
            learned.cob_id = value & 0x7FF if not value & OFF else -1
        elif is_mapping and sub == 0:
            learned.count = value
        elif is_mapping and sub <= MOST_MAPPED:
            learned.entries[sub] = value
        self._rebuild(node_id, is_rpdo, index - objects.start + 1, learned)

    @property
    def sources(self) -> Mapping[int, Source]:
        """By COB-ID: how the contents of the PDOs that were asked for are known."""
        return {cob_id: found.source for (cob_id, _), found in self._by_length.items() if found is not None}

    def _find(self, cob_id: int, length: int) -> PdoLayout | None:
        for known in self._known.get(cob_id, ()):
            if known.fits(length):
                return known
        if cob_id in self._known:
            return None
        return self._assume(cob_id, length)

    def _take_robot(self, robot: Robot) -> None:
        for node_id in sorted({drive.node_id for drive in robot.drives}):
            self._own.add(node_id)
            drives = tuple(drive for drive in robot.drives if drive.node_id == node_id)
            for layout in _of_robot(node_layout(node_id, drives, robot)):
                self._known.setdefault(layout[0], []).append(layout[1])

    def _rebuild(self, node_id: int, is_rpdo: bool, number: int, learned: _Learned) -> None:
        if node_id in self._own:
            return
        cob_id = learned.cob_id
        if cob_id is None and number <= 4:
            cob_id = (RPDO if is_rpdo else TPDO)[number - 1] + node_id
        count = learned.count
        if cob_id is None or cob_id < 0 or not count or any(sub + 1 not in learned.entries for sub in range(count)):
            return
        name = f"{'RPDO' if is_rpdo else 'TPDO'}{number}"
        entries = [learned.entries[sub + 1] for sub in range(count)]
        self._known[cob_id] = [_layout(name, node_id, entries, Source.SDO, exact=not is_rpdo)]
        self._forget(lambda each: each == cob_id)

    def _assume(self, cob_id: int, length: int) -> PdoLayout | None:
        node_id, function = cob_id & 0x7F, cob_id & 0x780
        if self._robot is not None or node_id in (0, DRIVER_NODE_ID, WATCHDOG_NODE_ID) or node_id in self.refuted:
            return None
        table = _CANBASE if self._is_canbase else _DEFAULT
        source = Source.CANBASE if self._is_canbase else Source.CIA_402
        for at, name, objects in table:
            entries = [index << 16 | bits for index, bits in objects]
            if function == at and 8 * length == sum(entry & 0xFF for entry in entries):
                return _layout(name, node_id, entries, source)
        if function in TPDO and not self._is_canbase:
            self._refute(node_id)
        return None

    def _refute(self, node_id: int) -> None:
        self.refuted.add(node_id)
        self._forget(lambda cob_id: cob_id & 0x7F == node_id)

    def _forget(self, is_meant: Callable[[int], bool]) -> None:
        """What was found for these COB-IDs is looked up again."""
        self._by_length = {key: found for key, found in self._by_length.items() if not is_meant(key[0])}


_PLACES: Final = (
    (_RPDO_COMMUNICATION, True, False), (_RPDO_MAPPING, True, True),
    (_TPDO_COMMUNICATION, False, False), (_TPDO_MAPPING, False, True),
)  # fmt: skip

_STATUS = ((STATUSWORD, 16), (POSITION_ACTUAL, 32))
_SPEED, _TORQUE = (VELOCITY_ACTUAL, 32), (TORQUE_ACTUAL, 16)
_SETPOINT = ((CONTROLWORD, 16), (TARGET_VELOCITY, 32))


def _second(objects: tuple[tuple[int, int], ...]) -> tuple[tuple[int, int], ...]:
    return tuple((index + AXIS_OFFSET, bits) for index, bits in objects)


_CANBASE: Final = (
    (TPDO[0], "TPDO1", _STATUS), (TPDO[1], "TPDO2", (_SPEED, _TORQUE)), (TPDO[1], "TPDO2", (_SPEED,)),
    (TPDO[2], "TPDO3", _second(_STATUS)), (TPDO[3], "TPDO4", _second((_SPEED, _TORQUE))),
    (TPDO[3], "TPDO4", _second((_SPEED,))),
    (RPDO[0], "RPDO1", _SETPOINT), (RPDO[1], "RPDO2", _second(_SETPOINT)),
    (RPDO[3], "RPDO4", ((CONTROLWORD, 16),)), (RPDO[3], "RPDO4", ((CONTROLWORD, 16), (CONTROLWORD + AXIS_OFFSET, 16))),
)  # fmt: skip
"""docs/bus.md, for a drive with the objects of CiA 402-2."""
_DEFAULT: Final = (
    (TPDO[0], "TPDO1", ((STATUSWORD, 16),)), (TPDO[1], "TPDO2", ((STATUSWORD, 16), (MODE_DISPLAY, 8))),
    (TPDO[2], "TPDO3", ((STATUSWORD, 16), (POSITION_ACTUAL, 32))),
    (TPDO[3], "TPDO4", ((STATUSWORD, 16), (VELOCITY_ACTUAL, 32))),
    (RPDO[0], "RPDO1", ((CONTROLWORD, 16),)), (RPDO[1], "RPDO2", ((CONTROLWORD, 16), (MODE, 8))),
    (RPDO[2], "RPDO3", ((CONTROLWORD, 16), (TARGET_POSITION, 32))), (RPDO[3], "RPDO4", _SETPOINT),
)  # fmt: skip
"""CiA 402-2, default mapping of the PDOs."""


def _of_robot(node: NodeLayout) -> list[tuple[int, PdoLayout]]:
    """The PDOs of a node of robot.yaml, in each length that its boot can choose."""
    where = {
        (at.index, at.sub): (base, axis, at.shift)
        for axis in reversed(node.axes)
        for base in (CONTROLWORD, STATUSWORD, POSITION_ACTUAL, VELOCITY_ACTUAL, TARGET_VELOCITY, *node.torque_objects)
        for at in (place(node.profile, base, axis),)
    }
    found = []
    for pdo in node.pdos():
        for missing in range(pdo.optional + 1):
            entries = list(pdo.mapping[: len(pdo.mapping) - missing])
            axis = node.axes[min((pdo.number - 1) // 2, len(node.axes) - 1)] if pdo.kind == "TPDO" else node.axes[0]
            layout = _layout(pdo.name, node.node_id, entries, Source.ROBOT, where=where, packed_axis=axis)
            found.append((pdo.cob_id, layout))
    for pdo, carried in zip(node.value_pdos(), node.values, strict=True):
        found.append((pdo.cob_id, _of_values(pdo.name, node.node_id, carried)))
    if node.profile.layout.fits_one_tpdo and not node.joins_velocity:
        joined = _of_robot(replace(node, joins_velocity=True, values=()))
        found += [(cob_id, layout) for cob_id, layout in joined if layout.name.startswith("TPDO")]
    return found


def _of_values(name: str, node_id: int, carried: ValuePdo) -> PdoLayout:
    mapped, bit = [], 0
    for value in carried.values:
        mapped.append(Mapped(value.index, value.sub, 0, 0, bit, value.bits, value))
        bit += value.bits
    return PdoLayout(name, node_id, tuple(mapped), bit, Source.ROBOT)


def _layout(
    name: str,
    node_id: int,
    entries: list[int],
    source: Source,
    *,
    where: Mapping[tuple[int, int], tuple[int, int, int]] | None = None,
    packed_axis: int = 0,
    exact: bool = True,
) -> PdoLayout:
    """Out of the entries of 1600h or 1A00h (CiA 301): index, sub-index, length in bits."""
    mapped, bit = [], 0
    for entry in entries:
        index, sub, bits = entry >> 16 & 0xFFFF, entry >> 8 & 0xFF, entry & 0xFF
        base, axis, _ = (where or {}).get((index, sub), (*_by_offset(index), 0))
        if base == STATUSWORD and bits == 32:  # two statuswords in one object: the half of this PDO's axis
            mapped.append(Mapped(index, sub, base, packed_axis, bit + 16 * packed_axis, 16))
        else:
            mapped.append(Mapped(index, sub, base, axis, bit, bits))
        bit += bits
    return PdoLayout(name, node_id, tuple(each for each in mapped if each.bits), bit, source, exact)


def _by_offset(index: int) -> tuple[int, int]:
    """Object of the first axis and axis, where axis n is n * 800h further (CiA 402-2)."""
    if not 0x6000 <= index < 0xA000:
        return index, 0
    return 0x6000 + (index - 0x6000) % AXIS_OFFSET, (index - 0x6000) // AXIS_OFFSET
