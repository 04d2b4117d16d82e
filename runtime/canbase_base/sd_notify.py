"""Notifications to systemd, if it is there: ready, the state as text, and that the loop still runs.

The protocol is sd_notify(3): one datagram to the socket that systemd names in NOTIFY_SOCKET; without it, nothing.
"""

from __future__ import annotations

import contextlib
import os
import socket
from collections.abc import Mapping
from typing import Final

ALIVE_PERIOD_S: Final = 0.2
"""A fifth of the units' WatchdogSec: one datagram may be late without the process being taken for dead."""


def notify(message: str, environment: Mapping[str, str] = os.environ) -> None:
    """Send `READY=1`, `WATCHDOG=1`, `STATUS=…`, or several lines of them. Nothing here waits or raises."""
    address = environment.get("NOTIFY_SOCKET", "")
    if not message or not address:
        return
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
        sender.setblocking(False)  # systemd is busy or restarts: the next one will do
        sender.sendto(message.encode(), "\0" + address[1:] if address.startswith("@") else address)


class Service:
    """One process as systemd sees it. Nothing here blocks or raises: a full or missing socket must not stop a loop."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        """`environment` names systemd's socket (NOTIFY_SOCKET); without it every call does nothing."""
        self._environment = environment
        self._ready = False
        self._status = ""
        self._alive_at = -ALIVE_PERIOD_S

    def alive(self, status: str, now_s: float) -> None:
        """To be called by the loop that this process stands for, in each of its turns, at `now_s` [s, monotonic].

        The first call sends READY; later ones send WATCHDOG at most every ALIVE_PERIOD_S, and `status` when it changed.
        """
        lines = []
        if not self._ready:
            self._ready = True
            lines.append("READY=1")
        if status != self._status:
            self._status = status
            lines.append(f"STATUS={status}")
        if now_s - self._alive_at >= ALIVE_PERIOD_S:
            self._alive_at = now_s
            lines.append("WATCHDOG=1")
        notify("\n".join(lines), self._environment)

    def stopping(self) -> None:
        """An orderly end has begun. Its time limit is TimeoutStopSec; the watchdog of systemd no longer counts."""
        notify("STOPPING=1", self._environment)
