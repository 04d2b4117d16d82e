"""Reads files out of folders in which others may write, as root too: a support bundle takes nothing but what is meant.

A link counts only on the way to a file, and only if root or the caller has made it. What is read is a regular file with
one name, and its last bytes at most; a FIFO, a socket or a device is refused without waiting for it.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Final

MOST_LINKS: Final = 40
MOST_NAMES: Final = 10_000
"""Of one folder, in no order; the others are not seen."""
_WALK: Final = os.O_PATH | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
_FILE: Final = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC


class RefusedError(OSError):
    """The file exists and is not taken. Its text has the reason."""

    def __init__(self, why: str) -> None:
        super().__init__(errno.ELOOP, why)


def read_end(path: Path, most: int) -> tuple[str, bytes]:
    """Where the file really is, and its last `most` bytes. Raises OSError."""
    with _folder(path.parent) as folder:
        _refuse_odd(os.stat(path.name, dir_fd=folder, follow_symlinks=False))  # opening a device may do something
        handle = os.open(path.name, _FILE, dir_fd=folder)
    with open(handle, "rb") as file:
        found = os.fstat(handle)
        _refuse_odd(found)
        file.seek(max(0, found.st_size - most))
        return os.readlink(f"/proc/self/fd/{handle}"), file.read(most)


def names(folder: Path) -> list[str]:
    """The names in a folder, sorted. Raises OSError."""
    with _folder(folder) as opened:
        handle = os.open(".", os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC, dir_fd=opened)
        try:
            with os.scandir(handle) as entries:
                return sorted(entry.name for entry in islice(entries, MOST_NAMES))
        finally:
            os.close(handle)


def modified(path: Path) -> float:
    """When a file was changed, no link followed [s since the epoch]. Raises OSError."""
    with _folder(path.parent) as folder:
        return os.stat(path.name, dir_fd=folder, follow_symlinks=False).st_mtime


def _refuse_odd(found: os.stat_result) -> None:
    if stat.S_ISLNK(found.st_mode):
        raise RefusedError("it is a link; links are not followed")
    if not stat.S_ISREG(found.st_mode):
        raise RefusedError("it is no regular file")
    if found.st_nlink > 1:
        raise RefusedError("it has another name too (hard link)")


@contextmanager
def _folder(path: Path) -> Iterator[int]:
    """The folder as a handle, found step by step."""
    parts, links = list(Path(os.path.abspath(path)).parts[1:]), 0
    handle = os.open("/", _WALK)
    try:
        while parts:
            part = parts.pop(0)
            found = os.stat(part, dir_fd=handle, follow_symlinks=False)
            if stat.S_ISLNK(found.st_mode):
                links += 1
                if links > MOST_LINKS or found.st_uid not in (0, os.geteuid()):
                    raise RefusedError(f"{part} is a link of the user {found.st_uid}")
                target = os.readlink(part, dir_fd=handle)
                parts = [one for one in target.split("/") if one] + parts
                part = "/" if target.startswith("/") else "."
            below = os.open(part, _WALK, dir_fd=handle)
            os.close(handle)
            handle = below
        yield handle
    finally:
        os.close(handle)
