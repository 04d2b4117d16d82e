"""The Unix datagram socket on which leases arrive, each with the user that sent it (SO_PASSCRED, unix(7))."""

from __future__ import annotations

import contextlib
import os
import socket
import stat
import struct
from collections.abc import Iterator
from pathlib import Path

from canbase_base.own_folder import open_own_folder

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
            self._folder = open_own_folder(self._path.parent, 0o755 if foreign else 0o700)
        except OSError as error:
            raise LeaseSocketError(f"lease socket {path}: {error}. Check lease.socket") from error
        name, self._socket = self._path.name, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            self._remove_stale()
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
            self._socket.setblocking(False)
            os.fchmod(self._socket.fileno(), 0o600)  # before `bind`: the file has this mode from its first moment
            self._socket.bind(self._place)
            if foreign:  # no other user can fill its queue
                os.chown(name, uid, -1, dir_fd=self._folder, follow_symlinks=False)
        except OSError as error:
            self._close()
            raise LeaseSocketError(f"the lease socket {path} cannot be bound: {error}. Check lease.socket.") from error
        except LeaseSocketError:
            self._close()
            raise

    def __enter__(self) -> LeaseSocket:
        return self

    def __exit__(self, *error: object) -> None:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(self._path.name, dir_fd=self._folder)
        self._close()

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

    @property
    def _place(self) -> str:
        """By the descriptor of the folder: bind(2) and connect(2) take no `dir_fd`."""
        return f"/proc/self/fd/{self._folder}/{self._path.name}"

    def _close(self) -> None:
        self._socket.close()
        os.close(self._folder)

    def _remove_stale(self) -> None:
        """Remove what a killed watchdog left behind. Raises LeaseSocketError when another process uses the path."""
        name, path = self._path.name, self._path
        try:
            found = os.stat(name, dir_fd=self._folder, follow_symlinks=False)
        except FileNotFoundError:
            return
        if not stat.S_ISSOCK(found.st_mode):
            raise LeaseSocketError(f"{path} is not a socket. Remove it, or choose another lease.socket.")
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
            try:
                probe.connect(self._place)
            except ConnectionRefusedError:
                os.unlink(name, dir_fd=self._folder)
                return
        raise LeaseSocketError(f"another watchdog listens on {path}. End it, or choose another lease.socket.")


def _sender(ancillary: list[tuple[int, int, bytes]]) -> tuple[int | None, int | None]:
    for level, kind, data in ancillary:
        if (level, kind) == (socket.SOL_SOCKET, socket.SCM_CREDENTIALS) and len(data) == _CREDENTIALS.size:
            pid, uid, _ = _CREDENTIALS.unpack(data)
            return int(uid), int(pid)
    return None, None
