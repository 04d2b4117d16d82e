"""The disk in virtual time: the records of stops, as the bytes that a real file has. It outlives processes."""

from __future__ import annotations

from canbase_base import latch_record
from canbase_base.latch_record import SLOT, Defect, Found, Record

FULL = "the record of stops cannot be written: no space left on device"


class _File:
    """One file, clear at first. `writable` False: it cannot be written from now on. `hangs`: no write ends."""

    def __init__(self, clear: bytes) -> None:
        self.data: bytearray | None = bytearray(clear)
        self.writable, self.hangs = True, False
        self._sequence = 2
        self._before: bytes | None = None

    def put(self, page: bytes, sequence: int) -> None:
        """In place of the older page; of a file that was deleted nothing is left, and its writer does not notice."""
        at = latch_record.place_of(sequence)
        self._before = bytes(self.data) if self.data is not None else None
        if self.data is not None:
            self.data[at : at + SLOT] = page
        self._sequence = sequence

    def forget(self) -> None:
        """The last write is lost, though the disk has confirmed it; one that was lost before is not."""
        if self._before is not None and self.data is not None:
            self.data[:], self._sequence, self._before = self._before, self._sequence - 1, None

    @property
    def next(self) -> int:
        """The next sequence."""
        return self._sequence + 1


class StopDisk:
    """The record of driver, watchdog or filter."""

    def __init__(self, part: str, robot: str = "robot") -> None:
        self.part = part
        self._owner = latch_record.owner_of(part, robot, "virtual")
        self.file = _File(latch_record.whole(Record(), self._owner))
        self._last: Record | None = None

    def found(self) -> Found:
        """What a process finds that starts now."""
        return latch_record.read(bytes(self.file.data or b""), self._owner)

    @property
    def readable(self) -> bool:
        """A process that starts now can read it."""
        return self.found().defect is Defect.NONE

    def write(self, record: Record) -> tuple[Record | None, str]:
        """On disk at once, or not before the disk answers again; the report to the part."""
        if not self.file.writable:
            return None, FULL
        if self.file.hangs:
            return self._last, ""
        if record is not self._last:
            self._last = record
            self.file.put(latch_record.slot(record, self.file.next, self._owner), self.file.next)
        return record, ""
