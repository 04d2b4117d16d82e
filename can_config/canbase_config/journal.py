"""Entries of the systemd journal with priority and fields, beside the plain text that ROS writes; nothing without it.

Standard library only. The protocol is systemd's native one (systemd.io/JOURNAL_NATIVE_PROTOCOL): one datagram an entry.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from enum import IntEnum
from typing import Final

SOCKET: Final = "/run/systemd/journal/socket"
UNDER_SYSTEMD: Final = "JOURNAL_STREAM"
"""systemd sets it for a service whose output goes to the journal."""


class Priority(IntEnum):
    """As syslog has them."""

    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6


class Journal:
    """One part's way into the journal. Nothing here blocks or raises: a full journal must not stop a loop."""

    def __init__(self, part: str, environment: Mapping[str, str] = os.environ, path: str = SOCKET) -> None:
        """`part`: the field CANBASE_PART of all its entries."""
        self._path = path if environment.get(UNDER_SYSTEMD) else ""
        self._part = part

    def tell(self, message: str, priority: Priority, **fields: object) -> None:
        """One entry; a field `cause` is CANBASE_CAUSE there."""
        if not self._path:
            return
        own = {
            "MESSAGE": message,
            "PRIORITY": int(priority),
            "SYSLOG_IDENTIFIER": "canbase",
            "CANBASE_PART": self._part,
        }
        entry = {**own, **{f"CANBASE_{name.upper()}": value for name, value in fields.items()}}
        text = "".join(f"{name}={' '.join(str(value).splitlines())}\n" for name, value in entry.items())
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)
            try:
                sender.sendto(text.encode(), self._path)
            except OSError:
                return  # the journal is full or restarts; the plain text is there too
