"""The Unix datagram socket on which leases arrive, each with the user that sent it (SO_PASSCRED, unix(7))."""

from __future__ import annotations

import os
import socket
import stat
import struct
from collections.abc import Iterator
from pathlib import Path

BATCH = 64
"""Datagrams taken in before the loop looks at the clock again."""

_CREDENTIALS = struct.Struct("iII")
_ROOM = socket.CMSG_SPACE(_CREDENTIALS.size)


class LeaseSocketError(Exception):
    """The lease socket cannot be bound."""


class LeaseSocket:
    """Bound while it is open, removed when it is closed. Use it in a `with` statement."""

    def __init__(self, path: str, uid: int) -> None:
        """Binds `path` for the user `uid` to send to; makes its folder. Raises LeaseSocketError with what to do."""
        self._path = Path(path)
        foreign = uid != os.geteuid()
        if foreign and os.geteuid() != 0:
            raise LeaseSocketError(
                f"lease.uid is {uid}, this is user {os.geteuid()}: only root can give the lease socket to another user "
                "alone, and one that everybody may write to can be filled by anybody. Start the watchdog as root or as "
                "the user of the safety filter, and leave lease.uid out for the latter"
            )
        try:
            self._path.parent.mkdir(mode=0o755 if foreign else 0o700, parents=True, exist_ok=True)
            _check_folder(self._path.parent)
            _remove_stale(self._path)
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
            self._socket.setblocking(False)
            self._socket.bind(path)
            self._path.chmod(0o600)
            if foreign:
                os.chown(path, uid, -1)  # no other user can fill its queue
        except OSError as error:
            raise LeaseSocketError(f"the lease socket {path} cannot be bound: {error}. Check lease.socket.") from error

    def __enter__(self) -> LeaseSocket:
        return self

    def __exit__(self, *error: object) -> None:
        self._socket.close()
        self._path.unlink(missing_ok=True)

    def fileno(self) -> int:
        """What to wait on with select."""
        return self._socket.fileno()

    def receive(self) -> Iterator[tuple[bytes, int | None, int | None]]:
        """What has arrived, at most BATCH: datagram, its sender's user and process (None: unknown to the system)."""
        for _ in range(BATCH):
            try:
                datagram, ancillary, _, _ = self._socket.recvmsg(256, _ROOM)
            except BlockingIOError:
                return
            yield datagram, *_sender(ancillary)


def _sender(ancillary: list[tuple[int, int, bytes]]) -> tuple[int | None, int | None]:
    for level, kind, data in ancillary:
        if (level, kind) == (socket.SOL_SOCKET, socket.SCM_CREDENTIALS) and len(data) == _CREDENTIALS.size:
            pid, uid, _ = _CREDENTIALS.unpack(data)
            return int(uid), int(pid)
    return None, None


def _check_folder(folder: Path) -> None:
    """A user who may change the folder of the socket can put another socket in its place. Raises LeaseSocketError."""
    link, found = folder.lstat(), folder.stat()
    if stat.S_ISLNK(link.st_mode) and link.st_uid not in (0, os.geteuid()):
        raise LeaseSocketError(f"the folder {folder} of the lease socket is a link of user {link.st_uid}. Remove it")
    if found.st_uid not in (0, os.geteuid()):
        raise LeaseSocketError(
            f"the folder {folder} of the lease socket belongs to user {found.st_uid}, this is user {os.geteuid()}: "
            "that user could take its place. Choose another lease.socket, in a folder of this user"
        )
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH) and not found.st_mode & stat.S_ISVTX:
        raise LeaseSocketError(
            f"others may write to the folder {folder} of the lease socket, and so take its place. "
            f"Take that from them (chmod go-w {folder}), or choose another lease.socket"
        )


def _remove_stale(path: Path) -> None:
    """Remove what a killed watchdog left behind. Raises LeaseSocketError when somebody uses the path."""
    if not path.exists():
        return
    if not stat.S_ISSOCK(path.stat().st_mode):
        raise LeaseSocketError(f"{path} is not a socket. Remove it, or choose another lease.socket.")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            path.unlink()
            return
    raise LeaseSocketError(f"another watchdog listens on {path}. End it, or choose another lease.socket.")
