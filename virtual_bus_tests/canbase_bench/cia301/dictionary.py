"""The object dictionary of one simulated node: what its EDS describes, and the values now.

Numbers are kept as plain integers under `key(index, sub-index)`, so that PDOs cost little. Every access by SDO is
checked here (existence, access, length, range); rules that belong to one service are its guards. CiA 301, 306.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

from canopen import SdoAbortedError, import_od
from canopen.objectdictionary import ODArray, ODRecord, ODVariable, datatypes

from canbase_bench.cia301 import abort

EDS_FILE = "eds/canbase_cia402.eds"
"""Our own EDS, in the package canbase_config."""
AXIS_STRIDE = 0x800
"""Objects of axis n are at 6000h + n × 800h (CiA 402-1)."""

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


def _entry(variable: ODVariable) -> Entry:
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
    )


class Dictionary:
    """Values, guards and reactions of one node.

    `values` may be written directly by the node's own services; what comes from the bus goes through `set_data` (SDO)
    or a `writer` (RPDO). `fixed` overrides defaults of the EDS, for example the identity 1018h.
    """

    def __init__(self, node_id: int, axes: int = 1, fixed: Mapping[int, int] | None = None) -> None:
        self.entries = read_eds(node_id, axes)
        self._factory = {k: e.default for k, e in self.entries.items() if isinstance(e.default, int)}
        self._factory.update(fixed or {})
        self._saved: dict[int, int] = {}
        self.values: dict[int, int] = dict(self._factory)
        self.before_read: Callable[[], None] = _nothing
        self._indexes = {k >> 8 for k in self.entries}
        self._guards: dict[int, Check] = {}
        self._reactions: dict[int, Check] = {}

    def guard(self, index: int, check: Check) -> None:
        """Ask `check` before each write from the bus to `index`."""
        self._guards[index] = check

    def on_write(self, index: int, reaction: Check) -> None:
        """Call `reaction` after each write from the bus to `index`."""
        self._reactions[index] = reaction

    def reset(self, first: int, last: int) -> None:
        """Give the indexes from `first` to `last` their saved values (1010h), else those of the EDS."""
        for k, value in self._factory.items():
            if first <= k >> 8 <= last:
                self.values[k] = self._saved.get(k, value)

    def save(self) -> None:
        """Keep the writable values over resets and power cycles, as 1010h:1 orders."""
        self._saved = {k: v for k, v in self.values.items() if self.entries[k].writable and k >> 8 not in VOLATILE}

    def forget(self) -> None:
        """Drop what was saved, as 1011h:1 orders; it counts from the next reset."""
        self._saved = {}

    def get_data(self, index: int, subindex: int, check_readable: bool = False) -> bytes:
        """The bytes of one value for an SDO upload. Raises SdoAbortedError."""
        entry = self._find(index, subindex)
        if check_readable and not entry.readable:
            raise SdoAbortedError(abort.WRITE_ONLY)
        if isinstance(entry.default, bytes):
            return entry.default
        self.before_read()
        return struct.pack(f"<{entry.code}", self.values[key(index, subindex)])

    def set_data(self, index: int, subindex: int, data: bytes, check_writable: bool = False) -> None:
        """Take the bytes of an SDO download. Raises SdoAbortedError and changes nothing when it is refused."""
        entry = self._find(index, subindex)
        if check_writable and not entry.writable:
            raise SdoAbortedError(abort.READ_ONLY)
        if len(data) != entry.size:
            raise SdoAbortedError(abort.LENGTH)
        (value,) = struct.unpack(f"<{entry.code}", data)
        self._take(key(index, subindex), value)

    def writer(self, address: int) -> Callable[[int], None]:
        """A function that takes a value from an RPDO, with the same checks as by SDO. It may raise SdoAbortedError."""
        reaction = self._reactions.get(address >> 8)
        entry = self.entries[address]
        if address >> 8 in self._guards or entry.low is not None or entry.high is not None:
            return lambda value: self._take(address, value)
        values = self.values
        if reaction is None:
            return lambda value: values.__setitem__(address, value)
        subindex = address & 0xFF

        def store_and_react(value: int) -> None:
            values[address] = value
            reaction(subindex, value)

        return store_and_react

    def _find(self, index: int, subindex: int) -> Entry:
        if index not in self._indexes:
            raise SdoAbortedError(abort.NO_OBJECT)
        entry = self.entries.get(key(index, subindex))
        if entry is None:
            raise SdoAbortedError(abort.NO_SUBINDEX)
        return entry

    def _take(self, address: int, value: int) -> None:
        entry = self.entries[address]
        if entry.low is not None and value < entry.low:
            raise SdoAbortedError(abort.TOO_LOW)
        if entry.high is not None and value > entry.high:
            raise SdoAbortedError(abort.TOO_HIGH)
        index, subindex = address >> 8, address & 0xFF
        if index in self._guards:
            self._guards[index](subindex, value)
        self.values[address] = value
        if index in self._reactions:
            self._reactions[index](subindex, value)


def _nothing() -> None:
    """Nothing to refresh."""
