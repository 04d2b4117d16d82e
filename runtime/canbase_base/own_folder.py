"""A folder that only root and this user can change or replace, from the top; and the one way to replace a file.

A process that works by path in a folder of another user opens, replaces and gives away whatever that user puts there.
So the path is walked with descriptors, and each folder on it is judged before the next one is opened or made in it.
Where every folder is trusted, no other user can move one of them afterwards.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

UID_MAP, OVERFLOW_UID = Path("/proc/self/uid_map"), Path("/proc/sys/kernel/overflowuid")
MOST_LINKS = 40
"""In one path, as the kernel has it."""
_OPEN = os.O_PATH | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
_NEW = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC


class FolderError(OSError):
    """Another user could change the folder or take its place."""

    def __init__(self, text: str) -> None:
        """`text`: the folder, the reason and the remedy."""
        super().__init__(errno.EACCES, text)

    def __str__(self) -> str:
        return str(self.strerror)


def users_outside(uid_map: str, overflow_uid: str) -> frozenset[int]:
    """The number that stands for all users outside of this user namespace, root among them; empty: all are inside.

    A container without root shows `/` as a folder of that user. Which of them it belongs to cannot be told: whoever
    starts the container chooses the folders in it. Raises ValueError for other texts (user_namespaces(7)).
    """
    number = int(overflow_uid)
    ranges = ((int(first), int(count)) for first, _, count in (line.split() for line in uid_map.splitlines()))
    return frozenset() if any(first <= number < first + count for first, count in ranges) else frozenset((number,))


def _trusted() -> frozenset[int]:
    try:
        outside = users_outside(UID_MAP.read_text(), OVERFLOW_UID.read_text())
    except (OSError, ValueError):  # without /proc only root and this user are trusted
        outside = frozenset()
    return outside | {0, os.geteuid()}


def open_own_folder(path: Path, mode: int | None = None) -> int:
    """A descriptor of the folder `path`, for `dir_fd`. `mode`: folders that do not exist are made, with this mode.

    Links of root and of this user are followed. Raises FolderError, or another OSError.
    """
    parts = [*path.absolute().parts[1:]]
    descriptor, place, links = os.open("/", _OPEN), Path("/"), 0
    try:
        _judge(os.fstat(descriptor), place, last=not parts)
        while parts:
            part = parts.pop(0)
            place /= part
            target = _link(part, descriptor, place, make=mode)
            if target is None:
                below = os.open(part, _OPEN, dir_fd=descriptor)
                os.close(descriptor)
                descriptor = below
                _judge(os.fstat(descriptor), place, last=not parts)
                continue
            links += 1
            if links > MOST_LINKS:
                raise OSError(errno.ELOOP, f"too many links in {path}")
            parts[:0] = [name for name in target.split("/") if name]
            place = place.parent
            if target.startswith("/"):
                os.close(descriptor)
                descriptor, place = os.open("/", _OPEN), Path("/")
    except BaseException as error:
        os.close(descriptor)
        if isinstance(error, OSError) and error.filename:
            error.filename = str(place)
        raise
    return descriptor


@contextmanager
def replaced(path: Path, *, private: bool = False) -> Iterator[BinaryIO]:
    """A file to write. At the end of the block it is on disk (fsync) and takes the place of `path`, file or link.

    Where anything raises before that, `path` is as it was and nothing is left beside it. `private`: for this user
    alone; otherwise with the mode, owner and group of the one before. Where this user may not give files away, it is
    this user's, and nobody else may write it. Does not judge the folder: `open_own_folder` does. Raises OSError, also
    where `path` is no regular file.
    """
    folder, new = os.open(path.parent, os.O_DIRECTORY | os.O_CLOEXEC), f".{path.name}.{os.urandom(4).hex()}"
    before = None
    try:
        with suppress(FileNotFoundError):
            before = os.stat(path.name, dir_fd=folder)
        if before and not stat.S_ISREG(before.st_mode):  # root would replace /dev/null
            raise OSError(errno.EINVAL, f"{path} is no regular file")
        before = None if private else before
        descriptor = os.open(new, _NEW, 0o600 if private or before else 0o666, dir_fd=folder)
        try:
            with open(path.with_name(new), "wb", opener=lambda *_: descriptor) as file:
                if before:
                    bits = 0o777
                    try:
                        os.fchown(descriptor, before.st_uid, before.st_gid)
                    except PermissionError:  # only root gives files away; nobody else may write what is now ours
                        bits = 0o755
                    os.fchmod(descriptor, before.st_mode & bits)
                yield file
                file.flush()
                os.fsync(descriptor)
            os.rename(new, path.name, src_dir_fd=folder, dst_dir_fd=folder)
        except BaseException:
            os.unlink(new, dir_fd=folder)
            raise
        try:
            os.fsync(folder)
        except OSError as error:
            if error.errno != errno.EINVAL:  # folders that virtual machines share cannot
                raise
    finally:
        os.close(folder)


def _link(name: str, folder: int, place: Path, make: int | None) -> str | None:
    """The target of a link; None: it is none. What does not exist is made, with the mode `make`."""
    try:
        status = os.stat(name, dir_fd=folder, follow_symlinks=False)
    except FileNotFoundError:
        if make is None:
            raise
        os.mkdir(name, make, dir_fd=folder)
        return None
    if not stat.S_ISLNK(status.st_mode):
        return None
    if status.st_uid not in _trusted():
        raise FolderError(f"the folder {place} is a link of user {status.st_uid}. Remove it")
    return os.readlink(name, dir_fd=folder)


def _judge(status: os.stat_result, place: Path, *, last: bool) -> None:
    """Refuses a folder that another user could change. In one with the sticky bit a user moves only files of that user.

    Above the last one a group may write that is root's, or that by its number is its owner's own (umask 002).
    """
    if status.st_uid not in _trusted():
        raise FolderError(
            f"the folder {place} belongs to user {status.st_uid}, this is user {os.geteuid()}: "
            "that user could take its place. Choose a folder of this user"
        )
    others = stat.S_IWOTH if not last and status.st_gid in (0, status.st_uid) else stat.S_IWGRP | stat.S_IWOTH
    if status.st_mode & others and not status.st_mode & stat.S_ISVTX:
        raise FolderError(
            f"others may write to the folder {place}, and so take the place of what is in it. "
            f"Take that from them (chmod go-w {place}), or choose another folder"
        )
