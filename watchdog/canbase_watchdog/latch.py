"""The watchdog's record of its trip, over kills, restarts and reboots. Pure; the file is latch_file.py.

Before a drive may have power the record on disk is already LIVE; CLEAR comes after power was seen to be off, without
a trip. Found LIVE, or unreadable in any way, it is a trip. The layout is that of canbase_runtime.latch_record, written
a second time on purpose: a test compares both.
"""

from __future__ import annotations

import enum
import hashlib
import struct
import zlib
from dataclasses import dataclass

PAGE = 4096
LENGTH = 2 * PAGE
_OPENED, _NODE = 0x8000, 0x7F
"""In the code, above the cause: `opened`, and the node id."""
PART = "watchdog"

_FIELDS = struct.Struct("<8sHBxHxxQ32s64s512s")
_CHECKED = PAGE - 4


class Mark(enum.IntEnum):
    """The mark of the record."""

    CLEAR = 0
    LIVE = 1
    LATCHED = 2


@dataclass(frozen=True, slots=True)
class Entry:
    """What is, or shall be, on disk: the cause of the trip (its number in the state frame), its node and sentence.

    `number`: which request of this life it is; not on disk. `opened`: the relay opened in it for a drive that kept its
    power.
    """

    mark: Mark = Mark.CLEAR
    cause: int = 0
    node_id: int = 0
    detail: str = ""
    number: int = 0
    opened: bool = False


@dataclass(frozen=True, slots=True)
class Past:
    """What was there at the start. `problem`: why it cannot be used; empty: it can."""

    entry: Entry = Entry()
    problem: str = ""
    sequence: int = 0

    @property
    def latched(self) -> bool:
        """Anything but a readable CLEAR."""
        return bool(self.problem) or self.entry.mark is not Mark.CLEAR


def owner(robot: str, machine: str) -> bytes:
    """Whose record it is, in 32 bytes."""
    return hashlib.sha256(f"{PART}\0{robot}\0{machine}".encode()).digest()


def page(entry: Entry, sequence: int, whose: bytes) -> bytes:
    """One of the two pages of the file: odd sequences in the first, even ones in the second."""
    detail = entry.detail.encode(errors="replace")[:512].decode(errors="ignore").encode()
    code = entry.cause | entry.node_id << 8 | (_OPENED if entry.opened else 0)
    head = _FIELDS.pack(b"CBLATCH\0", 1, entry.mark, code, sequence, whose, b"", detail)
    body = head + bytes(_CHECKED - len(head))
    return body + struct.pack("<I", zlib.crc32(body))


def decode(data: bytes, whose: bytes) -> Past:
    """The record in a file. Both pages must be whole: half a record is none. Never raises."""
    if len(data) != LENGTH:
        return Past(problem=f"{len(data)} bytes, expected {LENGTH}")
    first, second = (_decode_page(data[at : at + PAGE], whose) for at in (0, PAGE))
    if first.problem or second.problem:
        return Past(problem=first.problem or second.problem)
    if first.sequence % 2 != 1 or abs(first.sequence - second.sequence) != 1:
        return Past(problem="its two pages do not belong together")
    return max(first, second, key=lambda past: past.sequence)


def _decode_page(data: bytes, whose: bytes) -> Past:
    magic, version, mark, code, sequence, written_for, _, detail = _FIELDS.unpack_from(data)
    if struct.unpack("<I", data[_CHECKED:])[0] != zlib.crc32(data[:_CHECKED]) or magic != b"CBLATCH\0":
        return Past(problem="it is damaged")
    if version != 1:
        return Past(problem=f"it has version {version}, this watchdog knows 1")
    if written_for != whose:
        return Past(problem="it is another robot's or another computer's")
    if mark > Mark.LATCHED:
        return Past(problem="it is damaged")
    text = detail.rstrip(b"\0").decode(errors="replace")
    entry = Entry(Mark(mark), code & 0xFF, code >> 8 & _NODE, text, opened=bool(code & _OPENED))
    return Past(entry, sequence=sequence)


class Ledger:
    """What the watchdog wants on disk, and whether it is there.

    `past` None: no record is kept (virtual time), and what is wanted counts as written at once.
    """

    def __init__(self, past: Past | None) -> None:
        self._kept = past is not None
        self.wanted = Entry() if past is None else past.entry
        self._written: Entry | None = self.wanted if past is None or not past.problem else None
        self.problem = ""

    def want(self, mark: Mark, cause: int = 0, node_id: int = 0, detail: str = "", *, opened: bool = False) -> None:
        """From now on this."""
        old = self.wanted
        same = mark is old.mark and opened is old.opened
        if not same or cause != old.cause or node_id != old.node_id or detail != old.detail:
            self.wanted = Entry(mark, cause, node_id, detail, old.number + 1, opened)
        if not self._kept:
            self._written = self.wanted

    def on_written(self, written: Entry | None, problem: str) -> None:
        """The newest entry on disk (None: none yet), and what keeps the writer from writing."""
        self._written, self.problem = written or self._written, problem

    @property
    def is_on_disk(self) -> bool:
        """What is wanted now is on disk."""
        return self._written == self.wanted
