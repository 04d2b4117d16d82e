"""The socket to the watchdog. Never blocks and never raises: without a watchdog the driver does not enable anyway."""

from __future__ import annotations

import socket


class LeaseSender:
    """Sends leases to the Unix datagram socket at `path`, which the watchdog makes and may make again at any time."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.errors = 0
        """Leases that could not be delivered since start."""
        self._problem = ""
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def send(self, datagram: bytes) -> str | None:
        """Sends one lease, or counts an error. Returns what to log: the first error and each change, else None."""
        problem = ""
        try:
            self._socket.sendto(datagram, self.path)
        except OSError as error:
            self.errors += 1
            problem = error.strerror or str(error)
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
