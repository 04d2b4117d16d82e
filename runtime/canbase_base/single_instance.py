"""One process for each task: one driver on a bus, one filter for a watchdog. Held by name, released by the kernel.

The name is an abstract Unix socket: it exists once in a network namespace, as a CAN interface does, for all users of
the computer, and the end of its process frees it. A second process learns who holds it (SO_PEERCRED, unix(7)).
"""

from __future__ import annotations

import errno
import hashlib
import socket
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

_CREDENTIALS: Final = struct.Struct("iII")
_LONGEST: Final = 60
CALLERS: Final = 4096
"""The backlog: calls are never accepted, and a process beyond it does not learn who holds it."""
WRITER: Final = "writer of records"
"""What is held while a process writes a record of stops."""
ADVICE: Final = "Only one may run; end it first (`canbase doctor` shows what runs)"


class TakenError(Exception):
    """Another process does this already; the text names it."""


def bus_name(arguments: Mapping[str, Any]) -> str:
    """What identifies a bus on this computer. `arguments`: of `can.Bus`."""
    return ":".join(str(arguments.get(key, "")) for key in ("interface", "channel", "port"))


def take(task: str, name: str) -> socket.socket:
    """Hold this task until the socket is closed or the process ends. Raises TakenError with the holder."""
    holder = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        holder.bind(_address(task, name))
        holder.listen(CALLERS)
    except OSError as error:
        holder.close()
        if error.errno != errno.EADDRINUSE:
            raise
        raise TakenError(f"another {task} has {name}: {_who(task, name)}. {ADVICE}") from error
    return holder


def hold_record(path: Path) -> socket.socket:
    """Be the only one that writes this record of stops, until it is closed or the process ends.

    Raises TakenError with the holder: two robots of one name would forget each other's latched stops.
    """
    try:
        return take(WRITER, record_name(path))
    except TakenError as error:
        raise TakenError(f"{error}. Two robots on one computer need two names (`name` in robot.yaml)") from error


def record_name(path: Path) -> str:
    """What `hold_record` holds. A link to a folder is that folder."""
    return str(path.parent.resolve() / path.name)


def check(task: str, name: str) -> None:
    """Raises TakenError when somebody holds it now."""
    take(task, name).close()


def _address(task: str, name: str) -> str:
    short = name if len(name) <= _LONGEST else hashlib.sha256(name.encode()).hexdigest()[:_LONGEST]
    return f"\0canbase.{task}.{short}"


def holder(task: str, name: str) -> int | None:
    """Process id of the present holder; None: there is none. Raises OSError where the kernel does not report it."""
    found = holder_at(_address(task, name))
    return found and found[0]


def holder_at(address: str) -> tuple[int, int] | None:
    """The same by the address of its socket, which begins with a zero byte: process and user id."""
    try:
        return _holder(address)
    except ConnectionRefusedError:
        return None


def _holder(address: str) -> tuple[int, int]:
    """Process and user id of the holder."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as caller:
        caller.setblocking(False)
        caller.connect(address)
        pid, uid, _ = _CREDENTIALS.unpack(caller.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))
    return pid, uid


def _who(task: str, name: str) -> str:
    """Process, user and command of the holder, as far as this user may see them."""
    try:
        pid, uid = _holder(_address(task, name))
    except OSError as error:
        return f"who it is cannot be seen ({error.strerror or error})"
    try:
        command = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
    except OSError:
        command = ""
    return f"process {pid} of user {uid}" + (f", {command[:200]}" if command else "")
