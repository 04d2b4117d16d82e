"""The object dictionary of one simulated node: what its EDS describes, and the values now.

Numbers are kept as plain integers under `key(index, sub-index)`, so that PDOs cost little. Every access by SDO is
checked here (existence, access, length, range); rules that belong to one service are its guards. CiA 301, 306.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any

from canopen import SdoAbortedError, import_od
from canopen.objectdictionary import ODArray, ODRecord, ODVariable, datatypes

from canbase_sim.cia301 import abort
from canbase_sim.personality import GENERIC, Extra, Personality

EDS_FILE = "eds/canbase_cia402.eds"
"""Our own EDS, in the package canbase_config."""
AXIS_STRIDE = 0x800
"""Objects of axis n are at 6000h + n × 800h (CiA 402-1)."""
FIRST_AXIS = range(0x6000, 0x6000 + AXIS_STRIDE)
"""Indexes of axis 0."""
NO_RTR = 1 << 30
"""Bit 30 of a PDO's COB-ID: no remote requests."""

MOST_TEXT = 1_000
"""Bytes of a text that the bus may write."""
VOLATILE = frozenset({0x1003, 0x6040, 0x60FF, 0x6840, 0x68FF})
"""Writable objects that 1010h does not keep: error history, controlwords and targets."""

CODECS = {
    datatypes.INTEGER8: "b",
    datatypes.INTEGER16: "h",
    datatypes.INTEGER32: "i",
    datatypes.UNSIGNED8: "B",
    datatypes.UNSIGNED16: "H",
    datatypes.UNSIGNED32: "I",
}
"""`struct` letter of each data type that the EDS uses (CiA 301, data type definition area)."""

Check = Callable[[int, int], None]
"""Called with sub-index and value; raises SdoAbortedError to refuse the write."""


def key(index: int, subindex: int = 0) -> int:
    """Address of one value: index in the high bits, sub-index in the low byte."""
    return index << 8 | subindex


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of the EDS. `code` is the `struct` letter of a number; None is a string."""

    code: str | None
    readable: bool
    writable: bool
    mappable: bool
    low: int | None
    high: int | None
    default: int | bytes
    places: tuple[int, ...]
    """Where its value is kept: one address, or those of both axes for what they share."""

    @property
    def place(self) -> int:
        """The address that is read."""
        return self.places[0]

    @property
    def size(self) -> int:
        """Bytes of a number on the bus; 0 for a string."""
        return struct.calcsize("<" + self.code) if self.code else 0


@lru_cache(maxsize=256)
def read_eds(node_id: int, axes: int) -> Mapping[int, Entry]:
    """The entries of our EDS by `key`, for a node with one or two axes; COB-IDs are those of `node_id`."""
    described = import_od(str(files("canbase_config").joinpath(EDS_FILE)), node_id)
    end_of_profile = 0x6000 + axes * AXIS_STRIDE
    return {
        key(variable.index, variable.subindex): _entry(variable)
        for index in described
        if index < end_of_profile
        for variable in _variables(described[index])
    }


def _variables(described: ODVariable | ODArray | ODRecord) -> Iterator[ODVariable]:
    if isinstance(described, ODVariable):
        yield described
    else:
        yield from (described[subindex] for subindex in described)


def _entry(variable: Any) -> Entry:
    """Of an ODVariable, whose `default` canopen annotates as int: of texts it is a str."""
    code = CODECS.get(variable.data_type or 0)
    default = variable.default if variable.default is not None else 0
    return Entry(
        code=code,
        readable=variable.readable,
        writable=variable.writable,
        mappable=variable.pdo_mappable,
        low=variable.min,
        high=variable.max,
        default=default if code else str(default).encode("ascii"),
        places=(key(variable.index, variable.subindex),),
    )


PER_MOTOR = (0x60FF, 0x606C, 0x6064, 0x6083, 0x6084, 0x6085, 0x6077, 0x6078)
"""What each motor has of its own where both are behind one controlword, at sub-index 1 and 2."""
SHARED = (0x6040, 0x6060, 0x6061)
"""What both have in common there."""
PACKED = (0x6041, 0x603F)
"""What holds both there, the first axis in the lower 16 bits."""
COUNT, PAIR = 0xFD, 0xFE
"""Sub-indexes under which their number and the pair are kept; the bus sees both at 0."""


def visible(node_id: int, axes: int, personality: Personality) -> Mapping[int, Entry]:
    """The entries that the bus sees, by `key`: those of our EDS, with the changes of the personality."""
    if personality is GENERIC:
        return read_eds(node_id, axes)
    entries = dict(read_eds(node_id, axes))
    if personality.motors_by_sub_index:
        entries = _by_sub_index(entries, axes)
    if personality.vl:
        entries = _as_vl(entries)
    for k in list(entries):
        index = k >> 8
        first = index - AXIS_STRIDE if index - AXIS_STRIDE in FIRST_AXIS else index
        late = index == 0x1016 and k & 0xFF > personality.heartbeat_entries
        if first in personality.missing or k in personality.missing_subs or late:
            del entries[k]
    for k in [k for k in entries if k >> 8 in personality.widths]:
        entries[k] = replace(entries[k], code=personality.widths[k >> 8])
    for subindex in range(3, personality.heartbeat_entries + 1):
        k = key(0x1016, subindex)
        entries[k] = replace(entries[key(0x1016, 1)], default=0, places=(k,))
    return entries | {k: _extra(k, extra) for k, extra in personality.extras.items()}


def _by_sub_index(entries: Mapping[int, Entry], axes: int) -> dict[int, Entry]:
    """The objects of all motors as a drive shows them that has one controlword."""
    shown = {k: entry for k, entry in entries.items() if k >> 8 < FIRST_AXIS.stop}
    second = AXIS_STRIDE * (axes - 1)
    for index in PER_MOTOR:
        whole = shown[key(index)]
        shown[key(index)] = Entry("B", True, False, False, None, None, axes, (key(index, COUNT),))
        for axis in range(axes):
            shown[key(index, axis + 1)] = replace(whole, places=(key(index + axis * AXIS_STRIDE),))
    for index in SHARED:
        shown[key(index)] = replace(shown[key(index)], places=(key(index), key(index + second))[:axes])
    for index in PACKED:
        shown[key(index)] = replace(shown[key(index)], code="I", places=(key(index, PAIR),))
    return shown


VL_PLACES = {0x6042: 0x60FF, 0x6044: 0x606C}
"""Velocities of mode 2, and where the motor has them."""
VL_PAIRS: Mapping[int, tuple[str, str, int, int]] = {
    0x6046: ("I", "I", 0, 30_000),
    0x6048: ("I", "H", 100, 1),
    0x6049: ("I", "H", 100, 1),
    0x604A: ("I", "H", 100, 1),
    0x604C: ("i", "i", 1, 1),
}
"""What mode 2 has at sub-index 1 and 2: `struct` letters, and soft values after power on."""


NOT_OF_VL = frozenset((0x606C, 0x6083, 0x6084, 0x6085, 0x60C2, 0x60FF))
"""What mode 2 has no use for."""


def _as_vl(entries: Mapping[int, Entry]) -> dict[int, Entry]:
    """The objects of mode 2 in place of those of modes 3 and 9 (CiA 402-2)."""
    shown = {k: entry for k, entry in entries.items() if k >> 8 not in NOT_OF_VL}
    for index, place in VL_PLACES.items():
        shown[key(index)] = replace(entries[key(place)], code="h")
    for index, (first, second, *defaults) in VL_PAIRS.items():
        shown[key(index)] = Entry("B", True, False, False, None, None, 2, (key(index),))
        for sub, code in ((1, first), (2, second)):
            shown[key(index, sub)] = Entry(code, True, True, False, None, None, defaults[sub - 1], (key(index, sub),))
    return shown


def _extra(k: int, extra: Extra) -> Entry:
    return Entry(extra.code, True, extra.writable, False, None, None, extra.value, (k,))


class Dictionary:
    """Values, guards and reactions of one node.

    `values` may be written directly by the node's own services; what comes from the bus goes through `set_data` (SDO)
    or a `writer` (RPDO). `fixed` overrides defaults of the EDS, for example the identity 1018h.
    """

    def __init__(
        self,
        node_id: int,
        axes: int = 1,
        fixed: Mapping[int, int] | None = None,
        personality: Personality = GENERIC,
    ) -> None:
        self.personality = personality
        self.entries: Mapping[int, Entry] = MappingProxyType(visible(node_id, axes, personality))
        self._axes, self._fixed = axes, dict(fixed or {})
        self._factory = _factory(node_id, axes, personality) | self._fixed
        self._saved: dict[int, int] = {}
        self.texts: dict[int, bytes] = {}
        """What was written in place of the texts of the EDS."""
        self._saved_texts: dict[int, bytes] = {}
        self.values: dict[int, int] = dict(self._factory)
        self.before_read: Callable[[], None] = _nothing
        self._indexes = {k >> 8 for k in self.entries}
        self._pairs = [
            (key(index, PAIR), key(index), key(index + AXIS_STRIDE * (axes - 1)))
            for index in (PACKED if personality.motors_by_sub_index else ())
        ]
        self._guards: dict[int, Check] = {}
        self._reactions: dict[int, Check] = {}

    def pack(self) -> None:
        """Bring the objects up to date that hold both axes in one value."""
        for place, low, high in self._pairs:
            self.values[place] = self.values[low] & 0xFFFF | (self.values[high] & 0xFFFF) << 16

    def guard(self, index: int, check: Check) -> None:
        """Call `check` before each write from the bus to `index`."""
        self._guards[index] = check

    def on_write(self, index: int, reaction: Check) -> None:
        """Call `reaction` after each write from the bus to `index`."""
        self._reactions[index] = reaction

    def renumber(self, node_id: int) -> None:
        """COB-IDs after the next reset are those of another node id; saved ones stay as they are (CiA 301)."""
        self._factory = _factory(node_id, self._axes, self.personality) | self._fixed

    def reset(self, first: int, last: int) -> None:
        """Give the indexes from `first` to `last` their saved values (1010h), else those of the EDS."""
        for k, value in self._factory.items():
            if first <= k >> 8 <= last:
                self.values[k] = self._saved.get(k, value)
        others = {k: text for k, text in self.texts.items() if not first <= k >> 8 <= last}
        self.texts = others | {k: text for k, text in self._saved_texts.items() if first <= k >> 8 <= last}

    def save(self) -> None:
        """Keep the writable values over resets and power cycles, as 1010h:1 orders."""
        kept = {place for entry in self.entries.values() if entry.writable for place in entry.places}
        self._saved = {k: v for k, v in self.values.items() if k in kept and k >> 8 not in VOLATILE}
        self._saved_texts = dict(self.texts)

    def forget(self) -> None:
        """Drop what was saved, as 1011h:1 orders; it counts from the next reset."""
        self._saved, self._saved_texts = {}, {}

    def get_data(self, index: int, subindex: int, check_readable: bool = False) -> bytes:
        """The bytes of one value for an SDO upload. Raises SdoAbortedError."""
        entry = self._find(index, subindex)
        if check_readable and not entry.readable:
            raise SdoAbortedError(abort.WRITE_ONLY)
        if isinstance(entry.default, bytes):
            return self.texts.get(entry.place, entry.default)
        self.before_read()
        return struct.pack(f"<{entry.code}", self.values[entry.place])

    def set_data(self, index: int, subindex: int, data: bytes, check_writable: bool = False) -> None:
        """Take the bytes of an SDO download. Raises SdoAbortedError and changes nothing when it is refused."""
        entry = self._find(index, subindex)
        if check_writable and not entry.writable:
            raise SdoAbortedError(abort.READ_ONLY)
        if entry.code is None:
            self._take_text(entry, data)
            return
        if len(data) != entry.size:
            raise SdoAbortedError(abort.LENGTH)
        (value,) = struct.unpack(f"<{entry.code}", data)
        self._take(key(index, subindex), value)

    def writer(self, address: int) -> Callable[[int], None]:
        """A function that takes a value from an RPDO, with the same checks as by SDO. It may raise SdoAbortedError."""
        entry = self.entries[address]
        place = entry.place
        reaction = self._reactions.get(place >> 8)
        bounded = entry.low is not None or entry.high is not None
        if place >> 8 in self._guards or bounded or len(entry.places) > 1:
            return lambda value: self._take(address, value)
        values = self.values
        if reaction is None:
            return lambda value: values.__setitem__(place, value)
        subindex = place & 0xFF

        def store_and_react(value: int) -> None:
            values[place] = value
            reaction(subindex, value)

        return store_and_react

    def _find(self, index: int, subindex: int) -> Entry:
        if index not in self._indexes:
            raise SdoAbortedError(abort.NO_OBJECT)
        entry = self.entries.get(key(index, subindex))
        if entry is None:
            raise SdoAbortedError(abort.NO_SUBINDEX)
        return entry

    def _take_text(self, entry: Entry, data: bytes) -> None:
        if len(data) > MOST_TEXT:
            raise SdoAbortedError(abort.TOO_LONG)
        self.texts[entry.place] = data

    def _take(self, address: int, value: int) -> None:
        entry = self.entries[address]
        if entry.low is not None and value < entry.low:
            raise SdoAbortedError(abort.TOO_LOW)
        if entry.high is not None and value > entry.high:
            raise SdoAbortedError(abort.TOO_HIGH)
        for place in entry.places:
            if place >> 8 in self._guards:
                self._guards[place >> 8](place & 0xFF, value)
        for place in entry.places:
            self.values[place] = value
            if place >> 8 in self._reactions:
                self._reactions[place >> 8](place & 0xFF, value)


def _factory(node_id: int, axes: int, personality: Personality) -> dict[int, int]:
    """Values after power on, of what the bus sees and of what the drive keeps for itself."""
    hidden = {k: e.default for k, e in read_eds(node_id, axes).items() if isinstance(e.default, int)}
    shown = {e.place: e.default for e in visible(node_id, axes, personality).values() if isinstance(e.default, int)}
    factory = hidden | shown | dict(personality.defaults) | {key(0x1016): personality.heartbeat_entries}
    for pdo in range(4) if personality.sets_no_rtr else ():
        for communication in (0x1400, 0x1800):
            factory[key(communication + pdo, 1)] |= NO_RTR
    if axes > 1:
        factory |= {k + (AXIS_STRIDE << 8): v for k, v in personality.defaults.items() if k >> 8 in FIRST_AXIS}
    return factory


def _nothing() -> None:
    """Nothing to refresh."""
