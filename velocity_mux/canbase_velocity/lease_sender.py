"""The socket to the watchdog. Never blocks and never raises: without a watchdog the driver does not enable anyway."""

from __future__ import annotations

import socket
from typing import Final

STARTS_S: Final = 5.0
"""At a start the watchdog may make its socket so long after the first lease [s]."""


class LeaseSender:
    """Sends leases to the Unix datagram socket at `path`, which the watchdog makes and may make again at any time."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.errors = 0
        """Leases that could not be delivered since start."""
        self._problem = ""
        self._complains_at_s: float | None = None
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, datagram: bytes, now_s: float) -> str | None:
        """Sends one lease, or counts an error. Returns what to log: the first error and each change, else None.

        Until one was delivered, errors are no news for STARTS_S after the first lease.
        """
        problem, complains_at_s = "", self._complains_at_s
        if complains_at_s is None:
            complains_at_s = self._complains_at_s = now_s + STARTS_S
        try:
            self._socket.sendto(datagram, self.path)
        except OSError as error:
            self.errors += 1
            problem = "" if now_s < complains_at_s else error.strerror or str(error)
        else:
            self._complains_at_s = now_s
        changed = problem != self._problem
        self._problem = problem
        return self._report() if changed else None

    def _report(self) -> str:
        if not self._problem:
            return f"leases reach the watchdog at {self.path} again"
        return f"no lease to the watchdog at {self.path}: {self._problem}; is `canbase serve watchdog` running?"

    def close(self) -> None:
        """Closes the socket; nothing can be sent afterwards."""
        self._socket.close()
