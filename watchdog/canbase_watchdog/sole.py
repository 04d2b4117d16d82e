"""One watchdog on a bus: an abstract Unix socket with its name, which the kernel frees when its process ends.

A second copy, on purpose, of what canbase_config.sole does for the others.
"""

from __future__ import annotations

import errno
import hashlib
import socket
import struct
from typing import Any

_CREDENTIALS = struct.Struct("iII")


class TakenError(Exception):
    """Another watchdog guards this bus; the text names it."""


def take(bus: dict[str, Any]) -> socket.socket:
    """Hold the bus until the socket is closed or the process ends. Raises TakenError with the holder."""
    name = ":".join(str(bus.get(key, "")) for key in ("interface", "channel", "port"))
    short = name if len(name) <= 60 else hashlib.sha256(name.encode()).hexdigest()[:60]
    address = f"\0canbase.watchdog.{short}"
    holder = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        holder.bind(address)
        holder.listen(8)
    except OSError as error:
        holder.close()
        if error.errno != errno.EADDRINUSE:
            raise
        raise TakenError(f"another watchdog guards {name}: {_who(address)}. Only one may run; end it first") from error
    return holder


def _who(address: str) -> str:
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as caller:
            caller.setblocking(False)
            caller.connect(address)
            found = caller.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    except OSError as error:
        return f"who it is cannot be seen ({error.strerror or error})"
    pid, uid, _ = _CREDENTIALS.unpack(found)
    return f"process {pid} of user {uid}"
