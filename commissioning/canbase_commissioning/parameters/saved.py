"""What was read of a drive: its values, what it refused, and who it is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from canbase_commissioning.object_dictionary import Address
from canbase_config.eds_file import Eds, EdsObject

PREDEFINED_COB_IDS: Final = {
    0x1014: (0x080,),
    0x1400: (0x200,), 0x1401: (0x300,), 0x1402: (0x400,), 0x1403: (0x500,),
    0x1800: (0x180,), 0x1801: (0x280,), 0x1802: (0x380,), 0x1803: (0x480,),
}  # fmt: skip
"""Function code of the COB-ID of EMCY and of the first PDOs, to which the node id is added (CiA 301)."""


@dataclass(frozen=True, slots=True)
class DriveIdentity:
    """1018h:1 to 1018h:4, 1008h, 1009h, 100Ah; None and empty: the drive has no such object."""

    vendor_id: int | None = None
    product_code: int | None = None
    revision: int | None = None
    serial: int | None = None
    name: str = ""
    hardware: str = ""
    software: str = ""

    @classmethod
    def of(cls, numbers: Iterable[int | None], texts: Iterable[str]) -> DriveIdentity:
        """1018h:1 to 1018h:4; 1008h, 1009h, 100Ah."""
        vendor_id, product_code, revision, serial = numbers
        name, hardware, software = texts
        return cls(vendor_id, product_code, revision, serial, name, hardware, software)

    def __str__(self) -> str:
        numbers = (self.vendor_id, self.product_code, self.revision, self.serial)
        shown = ":".join("–" if each is None else f"{each:X}" for each in numbers)
        texts = [text for text in (self.name, self.hardware and f"hardware {self.hardware}") if text]
        return ", ".join([shown, *texts, f"software {self.software or 'unknown'}"])


@dataclass(frozen=True, slots=True)
class Parameters:
    """The values of one drive, or of a file. `refused`: why the drive did not give an object.

    `node_id` 0: those of an EDS, which are for every node id. None: unknown.
    """

    node_id: int | None
    values: Mapping[Address, bytes]
    refused: Mapping[Address, str] = field(default_factory=dict)
    identity: DriveIdentity = DriveIdentity()
    source: str = ""
    """Where they come from, for a person."""

    def for_node(self, node_id: int, eds: Eds) -> Parameters:
        """The same parameters for another node id: COB-IDs that contain the node id move with it."""
        if self.node_id in (None, node_id):
            return replace(self, node_id=node_id)
        moved = {at: self._moved(at, data, node_id, eds) for at, data in self.values.items()}
        return replace(self, node_id=node_id, values=moved)

    def _moved(self, at: Address, data: bytes, node_id: int, eds: Eds) -> bytes:
        entry = eds.objects.get((at.index, at.sub))
        own, value = self.node_id or 0, int.from_bytes(data, "little")
        if len(data) != 4 or not _has_node_id(at, value, own, entry):
            return data
        return (value - own + node_id).to_bytes(4, "little")


def _has_node_id(at: Address, value: int, node_id: int, entry: EdsObject | None) -> bool:
    """Whether the value is a COB-ID that was made from this node id."""
    if value & 0x7F != node_id:
        return False
    is_cob_id = at.index == 0x1014 or (at.sub == 1 and (0x1400 <= at.index < 0x1600 or 0x1800 <= at.index < 0x1A00))
    predefined = value & 0x780 in PREDEFINED_COB_IDS.get(at.index, ())
    return is_cob_id and (predefined or (entry is not None and entry.has_node_id))
