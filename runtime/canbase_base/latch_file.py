"""The file of a latch record: opened once, overwritten in place, and on disk when `write` returns (fsync).

Preallocated, so that a full disk loses no latch. The layout and what counts as latched: latch_record.py.
"""

from __future__ import annotations

import contextlib
import errno
import os
import queue
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Final

from canbase_base import latch_record
from canbase_base.latch_folder import PARTS, SUFFIX, forgetful, machine, wrong_access
from canbase_base.latch_record import Defect, Found, Record
from canbase_base.own_folder import FolderError, open_own_folder, replaced
from canbase_base.small_thread import SmallThread

MOUNT: Final = "mount a folder of a disk there: a volume, for a container"
RETRY_S: Final = 1.0
_OPEN: Final = os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK


def create_first(folder: Path, robot: str) -> bool:
    """Clear records for a robot that has never had any; False, and nothing is touched: there is a folder already.

    All of them or none. Call it as the user that the services run as. Raises OSError.
    """
    if folder.exists():
        return False
    os.close(open_own_folder(folder.parent, 0o700))
    new = folder.with_name(f".{folder.name}.new{os.getpid()}")
    new.mkdir(mode=0o700)
    try:
        for part in PARTS:
            owner = latch_record.owner_of(part, robot, machine())
            with replaced(new / f"{part}{SUFFIX}", private=True) as file:
                file.write(latch_record.whole(Record(), owner))
        new.rename(folder)
    except BaseException:
        shutil.rmtree(new, ignore_errors=True)
        raise
    above = os.open(folder.parent, os.O_DIRECTORY | os.O_CLOEXEC)
    os.fsync(above)
    os.close(above)
    return True


class LatchFile:
    """One part's record. One thread at a time."""

    def __init__(self, folder: Path, part: str, robot: str, *, must_last: bool = False) -> None:
        """`must_last`: of drives that turn. A record that a reboot may take back counts as latched."""
        self.path, self._must_last = folder / f"{part}{SUFFIX}", must_last
        self._owner = latch_record.owner_of(part, robot, machine())
        self._descriptor: int | None = None
        self._sequence = 0

    def open(self) -> Found:
        """The mark of the record. Never raises: an unreadable record counts as latched."""
        try:
            found = self._read()
        except FileNotFoundError:
            found = Found(defect=Defect.MISSING, detail=str(self.path))
        except FolderError as error:
            found = Found(defect=Defect.ACCESS, detail=str(error))
        except OSError as error:
            found = Found(defect=Defect.UNREADABLE, detail=f"{self.path}: {error.strerror or error}")
        if self._must_last and found.says_nothing and (kind := forgetful(self.path)):
            found = Found(defect=Defect.FORGETS, detail=f"{self.path.parent} is on {kind}; {MOUNT}")
        self._sequence = found.sequence
        if found.defect is not Defect.NONE:
            self.close()
        return found

    def write(self, record: Record) -> None:
        """On disk when it returns. Raises OSError. A file that could not be used is replaced by a new one."""
        if self._descriptor is None:
            self._replace(record)
            return
        data = latch_record.slot(record, self._sequence + 1, self._owner)
        if os.pwrite(self._descriptor, data, latch_record.place_of(self._sequence + 1)) != len(data):
            raise OSError(f"{self.path}: written in part")
        os.fsync(self._descriptor)
        self._sequence += 1

    def close(self) -> None:
        """Nothing can be written in place afterwards."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _read(self) -> Found:
        writable, folder = True, open_own_folder(self.path.parent)
        try:
            try:
                self._descriptor = os.open(self.path.name, os.O_RDWR | _OPEN, dir_fd=folder)
            except OSError as error:
                if error.errno != errno.EROFS:
                    raise
                writable = False
                self._descriptor = os.open(self.path.name, os.O_RDONLY | _OPEN, dir_fd=folder)
            wrong = wrong_access(self._descriptor, folder, self.path)
        finally:
            os.close(folder)
        if wrong:
            return Found(defect=Defect.ACCESS, detail=wrong)
        found = latch_record.read(os.pread(self._descriptor, latch_record.SIZE + 1, 0), self._owner)
        if not writable:
            self.close()
        if found.defect is Defect.NONE:
            return found
        return replace(found, detail=f"{self.path}: {found.detail}")

    def _replace(self, record: Record) -> None:
        os.close(open_own_folder(self.path.parent, 0o700))
        if self.path.exists() and not self.path.is_file():
            self.path.unlink()  # such as a pipe, which is no record
        with replaced(self.path, private=True) as file:
            file.write(latch_record.whole(record, self._owner))
        self._descriptor, self._sequence = os.open(self.path, os.O_RDWR | _OPEN), 2


class LatchKeeper(SmallThread):
    """Writes what a loop wants on disk, so that the loop never waits for one. `failure`: the defect that ended it."""

    def __init__(self, file: LatchFile) -> None:
        """Reads the file at once: `found`."""
        super().__init__(name="latch", daemon=True)
        self._file = file
        self.found = file.open()
        self._wanted: Record | None = None
        self._pending: Record | None = None
        self._inbox: queue.SimpleQueue[Record | None] = queue.SimpleQueue()
        self.written: Record | None = None
        """The newest that is on disk since the start."""
        self.problem = ""
        """Why the newest is not, and what to do; empty: nothing is in the way."""
        self.failure: BaseException | None = None

    def want(self, record: Record) -> None:
        """This shall be on disk; for a loop, which calls it with the same one again and again. Never waits."""
        if record is not self._wanted:
            self._wanted = record
            self._inbox.put(record)

    def finish(self, timeout_s: float) -> bool:
        """Write the wanted record within this time [s], and end. Whether it is on disk."""
        self._inbox.put(None)
        if self.is_alive():
            self.join(timeout_s)
        if self.is_alive():
            return False
        self._file.close()
        return self.failure is None and not self.problem

    def run(self) -> None:
        """The thread's body."""
        try:
            while self._turn():
                pass
        except BaseException as error:  # noqa: BLE001 - the process sees it, stops the robot and ends by it
            self.failure = error

    def _turn(self) -> bool:
        """Wait, write the newest; False: it is to end."""
        taken = self._take(None if self._pending is None else RETRY_S)
        newest = [record for record in taken if record is not None]
        if newest:
            self._pending = newest[-1]
        if self._pending is not None and self._attempt(self._pending):
            self._pending = None
        return None not in taken

    def _take(self, timeout_s: float | None) -> list[Record | None]:
        """All that waits; what comes first is waited for."""
        taken: list[Record | None] = []
        with contextlib.suppress(queue.Empty):
            taken.append(self._inbox.get(timeout=timeout_s))
            while True:
                taken.append(self._inbox.get_nowait())
        return taken

    def _attempt(self, record: Record) -> bool:
        """It is on disk."""
        try:
            self._file.write(record)
        except OSError as error:
            self.problem = (
                f"the record of stops {self._file.path} cannot be written: {error.strerror or error}. "
                "Make its folder writable for this user and its disk writable; no power until then"
            )
            return False
        self.written, self.problem = record, ""
        return True
