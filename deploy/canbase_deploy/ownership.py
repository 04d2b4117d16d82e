"""Who could change what the services and root run: it has to belong to root, up to the top folder.

Whoever may write one file of the environment, or rename a folder above it, is the watchdog at its next start, and root
at the next `sudo canbase`. Looks at owners, modes and access control lists alone and opens no file.
"""

from __future__ import annotations

import errno
import os
import pwd
import stat
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Final

ROOT: Final = 0
ROOT_ALONE: Final = frozenset((ROOT,))
MOST_ENTRIES: Final = 500_000
"""More files than any environment has: half a minute on a slow disk. Beyond it the answer is no."""
MOST_LINKS: Final = 40
"""In one path, as the kernel has it."""
NFS4_ACL: Final = "system.nfs4_acl"
ACLS: Final = ("system.posix_acl_", NFS4_ACL)
"""Extended attributes: lists of a file and default ones of a folder (acl(5)); lists of NFSv4, which ZFS has too."""
HOMES: Final = ("/home/", "/root/")
"""Home folders keep their owner: systemd hides them from the services (ProtectHome), so nothing is installed there."""
TOLD: Final = 3
"""So many faults are named; the cure of one is often that of all."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A path that somebody else than root could change, and why."""

    path: str
    why: str
    acl: str = ""
    """Owner and mode are right; an access control list of this name may give more."""

    @property
    def is_deep(self) -> bool:
        """None of the system's own folders, such as /opt: the cure is for all that is below it too."""
        return self.path.count("/") > 1

    def cure(self) -> str:
        """The command. NFSv4: a mount whose server has lists shows one for every file, `chmod` and nfs4_setfacl(1) only
        replace it, and what it gives is for the server to say."""
        if f"{self.path}/".startswith(HOMES):
            return "install into /opt/canbase: the services see nothing below this folder (docs/install.md)"
        deep = "-R " if self.is_deep else ""
        if self.acl.startswith(NFS4_ACL):
            return "install on a disk of this computer: no command removes the lists of NFSv4"
        if self.acl:
            return f"sudo setfacl {deep}-b {self.path}"
        return f"sudo chown {deep}root:root {self.path} && sudo chmod {deep}go-w {self.path}"


def fault(found: os.stat_result, *, above: bool, trusted: frozenset[int] = ROOT_ALONE) -> str:
    """Why somebody else than the `trusted` users could change this file or folder; empty: nobody could.

    `above`: it is a folder on the way to what is run. There the sticky bit protects what lies in it from others.
    """
    if found.st_uid not in trusted:
        return f"belongs to {_name(found.st_uid)}"
    if stat.S_ISLNK(found.st_mode) or stat.S_ISCHR(found.st_mode) or (above and found.st_mode & stat.S_ISVTX):
        return ""
    if found.st_mode & stat.S_IWOTH:
        return "is writable by everybody"
    if found.st_mode & stat.S_IWGRP and found.st_gid != ROOT:
        return f"is writable by the group {found.st_gid}"
    return ""


def acl_of(path: str) -> str:
    """The ACL that it has or passes on to new files, of which a mode shows the mask; empty: none. Raises OSError."""
    try:
        return next((name for name in os.listxattr(path, follow_symlinks=False) if name.startswith(ACLS)), "")
    except OSError as error:
        if error.errno in (errno.ENOTSUP, errno.ENOENT):  # a file system without any; gone meanwhile
            return ""
        raise


def faults(paths: Iterable[str], trusted: frozenset[int] = ROOT_ALONE, most: int = MOST_ENTRIES) -> list[Fault]:
    """The first TOLD faults of these files and whole folders, and of all folders above them, links followed.

    None below one that is named already. What is not there has none. More than `most` files are a fault.
    """
    return list(islice(_outermost(_Walk(trusted, most).through(paths)), TOLD))


def refusal(found: Iterable[Fault]) -> str:
    """For the user, with the cure of each; empty without a fault."""
    lines = [f"{one.path} {one.why}: {one.cure()}" for one in found]
    return "\n".join(["others than root could change what the services run:", *lines]) if lines else ""


class _Walk:
    """Each folder is looked into once."""

    def __init__(self, trusted: frozenset[int], most: int) -> None:
        self._trusted, self._most = trusted, most
        self._entries = 0
        self._above: set[str] = set()
        self._trees: set[str] = set()

    def through(self, paths: Iterable[str]) -> Iterator[Fault]:
        waiting = [os.path.abspath(path) for path in paths]
        while waiting:
            path = waiting.pop(0)
            real = yield from self._way_to(path)
            if real and os.path.isdir(real):
                yield from self._tree(real, waiting)
            if self._entries > self._most:
                yield Fault(path, f"is among more than {self._most} files; install into a folder of its own")
                return

    def _way_to(self, path: str) -> Generator[Fault, None, str]:
        """Every folder from the top on, every link and its target. Returns the path without links; empty: nowhere."""
        parts, real, links = path.split("/"), "", 0
        while parts:
            part = parts.pop(0)
            if part in (".", ".."):
                real = os.path.dirname(real) if part == ".." else real
                continue
            one = f"{real}/{part}" if part else "/"
            try:
                found = os.lstat(one)
                target = os.readlink(one) if stat.S_ISLNK(found.st_mode) else ""
            except FileNotFoundError:
                return ""
            except OSError as error:
                yield Fault(one, f"cannot be looked at: {error.strerror}")
                return ""
            yield from self._look(one, found, above=bool(parts))
            if not target:
                real = one.rstrip("/")
                continue
            links += 1
            if links > MOST_LINKS:
                return ""
            parts = [*filter(None, target.split("/")), *parts]
            real = "" if target.startswith("/") else real
        return real or "/"

    def _look(self, path: str, found: os.stat_result, *, above: bool) -> Iterator[Fault]:
        self._entries += 1
        if above and path in self._above:
            return
        if above:
            self._above.add(path)
        if why := fault(found, above=above, trusted=self._trusted):
            yield Fault(path, why)
            return
        try:
            if acl := acl_of(path):
                yield Fault(path, "has an access control list", acl)
        except OSError as error:
            yield Fault(path, f"cannot be looked at: {error.strerror}")

    def _tree(self, top: str, links: list[str]) -> Iterator[Fault]:
        """Everything below `top`; targets of links are added to `links`."""
        folders = [top]
        while folders and self._entries <= self._most:
            folder = folders.pop()
            if folder in self._trees:
                continue
            self._trees.add(folder)
            try:
                with os.scandir(folder) as entries:
                    for entry in entries:
                        yield from self._look(entry.path, entry.stat(follow_symlinks=False), above=False)
                        if entry.is_symlink():
                            links.append(entry.path)
                        elif entry.is_dir(follow_symlinks=False):
                            folders.append(entry.path)
            except OSError as error:
                yield Fault(folder, f"cannot be looked into: {error.strerror}")


def _outermost(found: Iterable[Fault]) -> Iterator[Fault]:
    """None twice, and none that the cure of one before it cures."""
    told: list[Fault] = []
    for one in found:
        if one not in told and not any(f"{one.path}/".startswith(f"{top.path}/") for top in told if top.is_deep):
            told.append(one)
            yield one


def _name(uid: int) -> str:
    try:
        return f"the user {pwd.getpwuid(uid).pw_name}"
    except KeyError:
        return f"the user {uid}"
