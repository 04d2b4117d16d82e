"""The record of one part's latched stop: what a restart has to know, as bytes. Pure; the file is latch_file.py.

Rules
1. Before there may be power the record on disk is LIVE. A part that finds LIVE was not ended in order: latched.
2. CLEAR is written after a confirmed power-off alone, and after an accepted reset.
3. What cannot be read, is another robot's, or is only half there, counts as latched.

A file is two slots of one page each. The older one is overwritten, so that a torn write leaves one that can be read;
that the other cannot be read is enough to count as latched.
"""

from __future__ import annotations

import enum
import hashlib
import struct
import zlib
from dataclasses import dataclass, replace
from typing import Final

MAGIC: Final = b"CBLATCH\0"
VERSION: Final = 1
SLOT: Final = 4096
"""Bytes of one slot: a page, which a disk writes at once or not at all, mostly."""
SIZE: Final = 2 * SLOT
CAUSE_BYTES: Final = 64
DETAIL_BYTES: Final = 512

BEFORE: Final = "latched since before the start: "

_HEAD: Final = struct.Struct("<8sHBxHxxQ32s64s512s")
"""Magic, version, mark, code, sequence, owner, cause, detail; then zeros, then the CRC-32 of all before it."""
_CRC: Final = struct.Struct("<I")


class Mark(enum.IntEnum):
    """The mark of the record."""

    CLEAR = 0
    """No power, and nothing that needs a reset."""
    LIVE = 1
    """There is power, or there may be: found so at a start, it is latched."""
    LATCHED = 2
    """A stop that needs a reset."""


class Defect(enum.Enum):
    """Why a record cannot be used: it counts as latched then. The value is for the sentence."""

    NONE = "none"
    MISSING = "there is no record of stops"
    UNREADABLE = "the record of stops cannot be read"
    SIZE = "the record of stops has a wrong size"
    GARBAGE = "the record of stops is damaged"
    VERSION = "the record of stops was written by another version of canbase"
    OWNER = "the record of stops is another robot's or another computer's"
    ACCESS = "the record of stops can be changed by others"
    FORGETS = "the record of stops is not kept over a reboot"


@dataclass(frozen=True, slots=True)
class Record:
    """What is, or shall be, on disk. `code`: a number of the part's own (a cause, a state; 0 to 65535)."""

    mark: Mark = Mark.CLEAR
    code: int = 0
    cause: str = ""
    detail: str = ""
    number: int = 0
    """Of this request in this process; not on disk. So an earlier, equal request is never reported as being on disk."""


@dataclass(frozen=True, slots=True)
class Found:
    """What was there at the start."""

    record: Record = Record()
    defect: Defect = Defect.NONE
    detail: str = ""
    """Where and why, for the sentence."""
    sequence: int = 0
    """Of the newer slot."""

    @property
    def latched(self) -> bool:
        """A reset is needed: anything but a readable CLEAR."""
        return self.defect is not Defect.NONE or self.record.mark is not Mark.CLEAR

    @property
    def says_nothing(self) -> bool:
        """As the record of a new robot after its first reset: nothing is latched, and nobody switched anything off."""
        return not self.latched and self.record.code == 0

    @property
    def sentence(self) -> str:
        """Why it is latched; empty when it is not."""
        if self.defect is not Defect.NONE:
            return f"{self.defect.value} ({self.detail}), so the last stop is taken for latched"
        if self.record.mark is Mark.LIVE:
            return "it ended while there was power: killed, crashed, or the computer lost its supply"
        if self.record.mark is Mark.LATCHED:
            return f"{BEFORE}{(self.record.detail or self.record.cause).removeprefix(BEFORE)}"
        return ""


CLEAR: Final = Found()


def owner_of(part: str, robot: str, machine: str) -> bytes:
    """32 bytes that identify the owner of a record. `machine`: what identifies this computer."""
    return hashlib.sha256("\0".join((part, robot, machine)).encode()).digest()


def slot(record: Record, sequence: int, owner: bytes) -> bytes:
    """One slot. Raises struct.error for a code or a sequence out of range."""
    cause, detail = _cut(record.cause, CAUSE_BYTES), _cut(record.detail, DETAIL_BYTES)
    head = _HEAD.pack(MAGIC, VERSION, record.mark, record.code, sequence, owner, cause, detail)
    body = head.ljust(SLOT - _CRC.size, b"\0")
    return body + _CRC.pack(zlib.crc32(body))


def whole(record: Record, owner: bytes) -> bytes:
    """A new file: both slots hold the same record, with sequences 1 and 2."""
    return slot(record, 1, owner) + slot(record, 2, owner)


def place_of(sequence: int) -> int:
    """Offset of the slot with this sequence."""
    return (sequence + 1) % 2 * SLOT


def read(data: bytes, owner: bytes) -> Found:
    """The record of a file. Never raises: every defect counts as latched."""
    if len(data) != SIZE:
        return Found(defect=Defect.SIZE, detail=f"{len(data)} bytes of {SIZE}")
    slots = [_read_slot(data[at : at + SLOT], owner) for at in (0, SLOT)]
    bad = next((each for each in slots if each.defect is not Defect.NONE), None)
    if bad is not None:
        return bad
    older, newer = sorted(slots, key=lambda each: each.sequence)
    misplaced = slots[0] is not (newer if newer.sequence % 2 else older)
    if newer.sequence != older.sequence + 1 or misplaced:
        return Found(defect=Defect.GARBAGE, detail=f"sequences {slots[0].sequence} and {slots[1].sequence}")
    return newer


def _read_slot(data: bytes, owner: bytes) -> Found:
    magic, version, mark, code, sequence, whose, cause, detail = _HEAD.unpack_from(data)
    if zlib.crc32(data[: -_CRC.size]) != _CRC.unpack(data[-_CRC.size :])[0] or magic != MAGIC:
        return Found(defect=Defect.GARBAGE, detail="checksum")
    if version != VERSION:
        return Found(defect=Defect.VERSION, detail=f"version {version}, this one knows {VERSION}")
    if whose != owner:
        return Found(defect=Defect.OWNER, detail="a copied disk, or robot.yaml has a new name")
    if mark not in tuple(Mark):
        return Found(defect=Defect.GARBAGE, detail=f"mark {mark}")
    return Found(Record(Mark(mark), code, _text(cause), _text(detail)), sequence=sequence)


def _cut(text: str, room: int) -> bytes:
    """As much of it as fits, in whole characters."""
    return text.encode(errors="replace")[:room].decode(errors="ignore").encode()


def _text(data: bytes) -> str:
    return data.rstrip(b"\0").decode(errors="replace")


class WriteAhead:
    """The record that a part wants on disk, and whether it is there. `found` None: no record (virtual time), and
    is wanted counts as written at once."""

    def __init__(self, found: Found | None) -> None:
        self._kept = found is not None
        self.wanted = Record() if found is None else found.record
        """What shall be on disk."""
        self._written: Record | None = self.wanted if found is None or found.defect is Defect.NONE else None
        self.problem = ""
        """Why it cannot be written; empty: it can."""

    def want(self, mark: Mark, code: int = 0, cause: str = "", detail: str = "") -> None:
        """From now on this."""
        before = self.wanted
        if (before.mark, before.code, before.cause, before.detail) != (mark, code, cause, detail):
            self.wanted = replace(Record(mark, code, cause, detail), number=before.number + 1)
        if not self._kept:
            self._written = self.wanted

    def on_written(self, written: Record | None, problem: str) -> None:
        """The writer's report: the newest record on disk, None: none yet; and what keeps it from writing."""
        self._written, self.problem = written or self._written, problem

    @property
    def is_on_disk(self) -> bool:
        """What is wanted now is on disk."""
        return self._written is self.wanted or self._written == self.wanted
