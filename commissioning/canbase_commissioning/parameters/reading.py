"""Reads every object of a drive that its EDS lists: what the drive does not give is in the report with its reason."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.parameters.saved import DriveIdentity, Parameters
from canbase_commissioning.parameters.value_text import LONG
from canbase_config.eds_file import Eds, EdsObject
from canbase_driver.boot.steps import Steps, unsigned
from canbase_driver.cia301.sdo_block import BlockRead
from canbase_driver.cia301.sdo_client import Read, SdoAborted, SdoTimeout, abort_text

NOT_READ: Final = {
    0x1F50: "a program, not a parameter",
    0x1F51: "controls a program, not a parameter",
    0x1023: "operating system commands, not a parameter",
    0x1024: "operating system commands, not a parameter",
    0x1025: "operating system commands, not a parameter",
    0x1026: "operating system prompt, not a parameter",
}
"""Indexes whose reading may do something, or is no parameter (CiA 301, CiA 302)."""
MOST_TIMEOUTS: Final = 3
"""So many objects in a row without an answer: the drive is gone."""
WRITE_ONLY: Final = "write-only by the EDS"
DATA_TYPE_AREA: Final = 0x1000
"""Below are data types, no objects of a drive (CiA 301)."""


@dataclass(slots=True)
class Progress:
    """How far a reading is. `total`: objects."""

    total: int
    values: dict[Address, bytes] = field(default_factory=dict)
    refused: dict[Address, str] = field(default_factory=dict)

    @property
    def done(self) -> int:
        """Objects that were read or refused."""
        return len(self.values) + len(self.refused)


def objects_to_read(eds: Eds) -> list[EdsObject]:
    """All objects of the file, in order."""
    return [entry for _, entry in sorted(eds.objects.items()) if entry.index >= DATA_TYPE_AREA]


def read_all(node_id: int, eds: Eds, entries: Iterable[EdsObject], progress: Progress) -> Steps[Parameters]:
    """Reads `entries`, and who the drive is. Raises SdoTimeout when the drive stops answering."""
    timeouts = 0
    for entry in entries:
        at = Address(entry.index, entry.sub)
        why = _left_out(entry) or _beyond(at, eds, progress)
        if why:
            progress.refused[at] = why
            continue
        try:
            yield from _read(entry, at, progress)
            timeouts = 0
        except SdoTimeout as error:
            timeouts += 1
            if timeouts >= MOST_TIMEOUTS:
                raise
            progress.refused[at] = error.text
    identity = yield from read_identity()
    return Parameters(node_id, progress.values, progress.refused, identity, f"node {node_id}")


def read_identity() -> Steps[DriveIdentity]:
    """1018h, 1008h, 1009h, 100Ah, whatever the EDS has."""
    numbers = []
    for sub in range(1, 5):
        data = yield from _if_present(Read(0x1018, sub))
        numbers.append(unsigned(data) if data else None)
    texts = []
    for index in (0x1008, 0x1009, 0x100A):
        data = yield from _if_present(BlockRead(index))
        text = data.decode("latin-1").strip(" \0")
        texts.append("".join(one if one.isprintable() else "?" for one in text))
    return DriveIdentity.of(numbers, texts)


def _read(entry: EdsObject, at: Address, progress: Progress) -> Steps[None]:
    step = BlockRead(at.index, at.sub) if entry.data_type in LONG else Read(at.index, at.sub)
    try:
        data: bytes = yield step
    except SdoAborted as refused:
        progress.refused[at] = abort_text(refused.code)
        return
    if data:
        progress.values[at] = data
    else:
        progress.refused[at] = "the answer has no bytes"


def _if_present(step: Read) -> Steps[bytes]:
    try:
        data: bytes = yield step
    except (SdoAborted, SdoTimeout):
        return b""
    return data


def _left_out(entry: EdsObject) -> str:
    return WRITE_ONLY if entry.access == "wo" else NOT_READ.get(entry.index, "")


def _beyond(at: Address, eds: Eds, progress: Progress) -> str:
    """An array that the EDS does not spell out has as many entries as its sub-index 0 shows."""
    count = progress.values.get(Address(at.index, 0))
    if at.index not in eds.compact or not at.sub or count is None or at.sub <= unsigned(count[:1]):
        return ""
    return f"beyond the {unsigned(count[:1])} entries that sub-index 0 shows"
