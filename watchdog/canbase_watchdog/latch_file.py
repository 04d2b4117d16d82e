"""The file of the watchdog's record, and the thread that writes it: the loop never waits for a disk.

A second copy, on purpose, of what canbase_runtime.latch_file does for driver and filter: the watchdog shares no code.
"""

from __future__ import annotations

import contextlib
import errno
import os
import queue
import threading
from dataclasses import replace
from pathlib import Path

from canbase_base.latch_folder import forgetful, machine, wrong_access
from canbase_base.own_folder import open_own_folder, replaced
from canbase_watchdog import latch
from canbase_watchdog.latch import Entry, Past

RETRY_S = 1.0
STACK_BYTES = 512 * 1024
"""Of the keeper's stack. The watchdog locks its memory (`realtime.py`), so all of it is resident: 8 MB by default."""
_FLAGS = os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK


class Keeper(threading.Thread):
    """Reads the record at once (`past`), then writes what `want` is given. `failure`: the defect that ended it."""

    def __init__(self, path: Path, robot: str, *, must_last: bool = False) -> None:
        """`must_last`: of drives that turn. A record that a reboot may take back counts as latched."""
        super().__init__(name="latch", daemon=True)
        self._path, self._whose = path, latch.owner(robot, machine())
        self._descriptor: int | None = None
        self.past = self._read()
        if must_last and not self.past.latched and (kind := forgetful(path)):
            problem = f"{path.parent} is on {kind}, which a reboot empties; mount a folder of a disk there"
            self.past = replace(self.past, problem=problem)
        self._sequence = self.past.sequence
        self._wanted: Entry | None = None
        self._pending: Entry | None = None
        self._inbox: queue.SimpleQueue[Entry | None] = queue.SimpleQueue()
        self.written: Entry | None = None
        self.problem = ""
        self.failure: BaseException | None = None

    def start(self) -> None:
        """With a small stack."""
        usual = threading.stack_size(STACK_BYTES)
        try:
            super().start()
        finally:
            threading.stack_size(usual)

    def want(self, entry: Entry) -> None:
        """This shall be on disk. Never waits."""
        if entry is not self._wanted:
            self._wanted = entry
            self._inbox.put(entry)

    def finish(self, timeout_s: float) -> bool:
        """Write what is wanted, for at most this long [s], and end. Whether all of it is on disk."""
        self._inbox.put(None)
        if self.is_alive():
            self.join(timeout_s)
        if self.is_alive():
            return False
        self._close()
        return self.failure is None and not self.problem

    def run(self) -> None:
        """The thread's body."""
        try:
            while self._turn():
                pass
        except BaseException as error:  # noqa: BLE001 - the loop sees it, stops the drives and ends by it
            self.failure = error

    def _turn(self) -> bool:
        taken: list[Entry | None] = []
        with contextlib.suppress(queue.Empty):
            taken.append(self._inbox.get(timeout=None if self._pending is None else RETRY_S))
            while True:
                taken.append(self._inbox.get_nowait())
        for entry in taken:
            self._pending = entry or self._pending
        if self._pending is not None and self._attempt(self._pending):
            self._pending = None
        return None not in taken

    def _attempt(self, entry: Entry) -> bool:
        try:
            if self._descriptor is None:
                self._replace(entry)
            else:
                self._overwrite(self._descriptor, entry)
        except OSError as error:
            self.problem = f"{self._path} cannot be written: {error.strerror or error}"
            return False
        self.written, self.problem = entry, ""
        return True

    def _overwrite(self, descriptor: int, entry: Entry) -> None:
        sequence = self._sequence + 1
        data = latch.page(entry, sequence, self._whose)
        if os.pwrite(descriptor, data, 0 if sequence % 2 else latch.PAGE) != len(data):
            raise OSError("written in part")
        os.fsync(descriptor)
        self._sequence = sequence

    def _replace(self, entry: Entry) -> None:
        os.close(open_own_folder(self._path.parent, 0o700))
        if self._path.exists() and not self._path.is_file():
            self._path.unlink()  # such as a pipe, which is no record
        with replaced(self._path, private=True) as file:
            file.write(latch.page(entry, 1, self._whose) + latch.page(entry, 2, self._whose))
        self._descriptor, self._sequence = os.open(self._path, os.O_RDWR | _FLAGS), 2

    def _read(self) -> Past:
        past = self._read_file()
        if past.problem:
            self._close()
            return replace(past, problem=f"{self._path}: {past.problem}")
        return past

    def _read_file(self) -> Past:
        try:
            folder = open_own_folder(self._path.parent)
        except OSError as error:
            return Past(problem=error.strerror or str(error))
        try:
            return self._read_in(folder)
        except OSError as error:
            return Past(problem=error.strerror or str(error))
        finally:
            os.close(folder)

    def _read_in(self, folder: int) -> Past:
        try:
            self._descriptor = os.open(self._path.name, os.O_RDWR | _FLAGS, dir_fd=folder)
        except OSError as error:
            if error.errno != errno.EROFS:
                raise
        descriptor = os.open(self._path.name, os.O_RDONLY | _FLAGS, dir_fd=folder)
        try:
            problem = wrong_access(descriptor, folder, self._path)
            return Past(problem=problem) if problem else latch.decode(os.read(descriptor, 16384), self._whose)
        finally:
            os.close(descriptor)

    def _close(self) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
