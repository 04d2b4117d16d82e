"""What may be written to the PDO parameters 1400h, 1600h, 1800h, 1A00h, and when (CiA 301; refusals as CANopenNode's).

The order that works: COB-ID with bit 31 → mapping sub 0 = 0 → mapping entries → sub 0 = n → type and times → COB-ID
without bit 31. Mapping, type and times are refused in NMT OPERATIONAL; switching a PDO off is allowed always.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from canopen import SdoAbortedError

from canbase_sim.cia301 import abort
from canbase_sim.cia301.dictionary import NO_RTR, Dictionary, Entry, key

NOT_VALID = 1 << 31
"""Bit 31 of the COB-ID: the PDO is off."""
COB_ID, TYPE, INHIBIT, EVENT = 1, 2, 3, 5
"""Sub-indexes of the communication parameters."""
MAX_SYNC_TYPE = 240
"""Transmission types 0–240 are synchronous, 254 and 255 event-driven, the rest is not used."""
RESERVED_IDS = (
    range(0x080),
    range(0x101, 0x181),
    range(0x581, 0x600),
    range(0x601, 0x680),
    range(0x6E0, 0x700),
    range(0x701, 0x800),
)
"""Identifiers that no PDO may have (CiA 301, 7.3.5; SYNC's 080h is not among them)."""


@dataclass(frozen=True, slots=True)
class Mapped:
    """One object in a PDO: its address as the bus sees it, None for a dummy, and its `struct` letter."""

    address: int | None
    code: str


DUMMIES = {2: "b", 3: "h", 4: "i", 5: "B", 6: "H", 7: "I"}
"""Data types that an RPDO may map to skip bytes (DummyUsage of the EDS)."""


class PdoRules:
    """Guards of one PDO. `communication` and `mapping` are its indexes, `operational` returns the NMT state."""

    def __init__(
        self, dictionary: Dictionary, communication: int, mapping: int, receives: bool, operational: Callable[[], bool]
    ) -> None:
        self._entries, self._values = dictionary.entries, dictionary.values
        self._communication, self._mapping, self._receives = communication, mapping, receives
        self._operational = operational
        self._needs_no_rtr = dictionary.personality.needs_no_rtr
        dictionary.guard(communication, self._check_communication)
        dictionary.guard(mapping, self._check_mapping)

    @property
    def valid(self) -> bool:
        """True while the PDO is on."""
        return not self.value(COB_ID) & NOT_VALID

    def value(self, subindex: int) -> int:
        """One communication parameter."""
        return self._values[key(self._communication, subindex)]

    def mapped(self) -> tuple[Mapped, ...]:
        """The objects in the PDO, in their order. Raises SdoAbortedError if one cannot be mapped."""
        count = self._values[key(self._mapping)]
        return tuple(self._resolve(self._values[key(self._mapping, n)]) for n in range(1, count + 1))

    def _check_communication(self, subindex: int, value: int) -> None:
        switches_off = subindex == COB_ID and value & NOT_VALID
        if self._operational() and not switches_off:
            raise SdoAbortedError(abort.DEVICE_STATE)
        if subindex == COB_ID:
            self._check_cob_id(value)
        elif (subindex == TYPE and not self._takes_type(value)) or (subindex == INHIBIT and self.valid):
            raise SdoAbortedError(abort.INVALID_VALUE)

    def _takes_type(self, value: int) -> bool:
        """Synchronous types need 1005h."""
        return value in (254, 255) or (value <= MAX_SYNC_TYPE and key(0x1005) in self._entries)

    def _check_cob_id(self, value: int) -> None:
        cob_id, switches_on = value & 0x7FF, not value & NOT_VALID
        refused = (
            value & ~(NOT_VALID | NO_RTR | 0x7FF) != 0
            or (self._needs_no_rtr and not value & NO_RTR)
            or (switches_on and any(cob_id in reserved for reserved in RESERVED_IDS))
            or (switches_on and self.valid and cob_id != self.value(COB_ID) & 0x7FF)
            or (switches_on and self._values[key(self._mapping)] == 0)
        )
        if refused:
            raise SdoAbortedError(abort.INVALID_VALUE)

    def _check_mapping(self, subindex: int, value: int) -> None:
        if self._operational():
            raise SdoAbortedError(abort.DEVICE_STATE)
        if self.valid or (subindex != 0 and self._values[key(self._mapping)] != 0):
            raise SdoAbortedError(abort.UNSUPPORTED_ACCESS)
        if subindex == 0:
            self._check_count(value)
        elif value != 0:
            self._resolve(value)

    def _check_count(self, count: int) -> None:
        mapped = [self._resolve(self._values[key(self._mapping, n)]) for n in range(1, count + 1)]
        if sum(LENGTHS[m.code] for m in mapped) > 8:
            raise SdoAbortedError(abort.PDO_TOO_LONG)

    def _resolve(self, value: int) -> Mapped:
        """The object that a mapping value names: index << 16 | sub-index << 8 | bits."""
        address, bits = value >> 8, value & 0xFF
        if self._receives and address & 0xFF == 0 and address >> 8 in DUMMIES:
            code: str | None = DUMMIES[address >> 8]
            found = Mapped(None, code or "")
        else:
            entry = self._entries.get(address)
            code = entry.code if entry is not None and self._allowed(entry) else None
            found = Mapped(address, code or "")
        if code is None or LENGTHS[code] * 8 != bits:
            raise SdoAbortedError(abort.NOT_MAPPABLE)
        return found

    def _allowed(self, entry: Entry) -> bool:
        return entry.mappable and (entry.writable if self._receives else entry.readable)


LENGTHS = {"b": 1, "B": 1, "h": 2, "H": 2, "i": 4, "I": 4}
"""Bytes of each `struct` letter."""
