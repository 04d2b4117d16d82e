"""One watchdog on a bus, one for a record: abstract Unix sockets, which the kernel frees when their process ends.

A second copy, on purpose, of what canbase_runtime.single_instance does for the others.
"""

from __future__ import annotations

import errno
import hashlib
import socket
import struct
from pathlib import Path
from typing import Any

CALLERS = 4096
"""The backlog: calls are never accepted, and a process beyond it does not learn who holds it."""

_CREDENTIALS = struct.Struct("iII")


class TakenError(Exception):
    """Another process has it; the text names it."""


def hold_bus(bus: dict[str, Any]) -> socket.socket:
    """Hold the bus until the socket is closed or the process ends. Raises TakenError with the holder."""
    name = ":".join(str(bus.get(key, "")) for key in ("interface", "channel", "port"))
    return _hold("watchdog", name, f"another watchdog guards {name}", "Only one may run; end it first")


def hold_record(path: Path) -> socket.socket:
    """Be the only one that writes this record. Raises TakenError: two robots of one name would forget each other's."""
    name = str(path.resolve())
    advice = "Two robots on one computer need two names (`name` in robot.yaml)"
    return _hold("writer of records", name, f"another watchdog writes {name}", advice)


def _hold(task: str, name: str, taken: str, advice: str) -> socket.socket:
    short = name if len(name) <= 60 else hashlib.sha256(name.encode()).hexdigest()[:60]
    address = f"\0canbase.{task}.{short}"
    holder = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        holder.bind(address)
        holder.listen(CALLERS)
    except OSError as error:
        holder.close()
        if error.errno != errno.EADDRINUSE:
            raise
        raise TakenError(f"{taken}: {_who(address)}. {advice}") from error
    return holder


def _who(address: str) -> str:
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as caller:
            caller.setblocking(False)
            caller.connect(address)
            credentials = caller.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    except OSError as error:
        return f"who it is cannot be seen ({error.strerror or error})"
    pid, uid, _ = _CREDENTIALS.unpack(credentials)
    return f"process {pid} of user {uid}"
