"""The driver's handle on the CAN bus (python-can): errors become a sentence in `problem`, late frames are never sent.

A bus that fails is closed and opened again every RETRY_S, for as long as it takes: the core disarms meanwhile.
"""

from __future__ import annotations

import time
from typing import Any

import can

from canbase_driver.frame import Frame

RETRY_S = 1.0
SEND_FAILURES = 10
"""So many failed sends in a row are a failed bus; fewer are a full transmit buffer."""
_ERRORS = (can.CanError, OSError)


class BusError(Exception):
    """The bus cannot be opened. The text says what to look at."""


class BusPort:
    """One bus. Only the control thread uses it."""

    def __init__(self, arguments: dict[str, Any]) -> None:
        """Opens `can.Bus(**arguments)`. Raises BusError."""
        self._arguments = arguments
        self.problem = ""
        self.send_errors = 0
        self.dropped = 0
        """Error, remote and 29-bit frames since start."""
        self._failures = 0
        self._retry_at = 0.0
        self._bus: can.BusABC | None = self._open()

    def receive(self, timeout_s: float) -> Frame | None:
        """The next data frame with an 11-bit identifier; None when none came in `timeout_s`, or it was another kind."""
        if self._bus is None:
            time.sleep(max(0.0, min(timeout_s, self._retry_at - time.monotonic())))
            self._reopen()
            return None
        try:
            message = self._bus.recv(max(0.0, timeout_s))
        except _ERRORS as error:
            self._fail(f"receiving failed: {error}")
            return None
        if message is None:
            return None
        if message.is_error_frame or message.is_remote_frame or message.is_extended_id:
            self.dropped += 1
            return None
        return Frame(message.arbitration_id, bytes(message.data))

    def send(self, frame: Frame) -> None:
        """Send now or never."""
        if self._bus is None:
            return
        message = can.Message(arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False)
        try:
            self._bus.send(message)
        except _ERRORS as error:
            self.send_errors += 1
            self._failures += 1
            if self._failures >= SEND_FAILURES:
                self._fail(f"sending failed {self._failures} times in a row: {error}")
        else:
            self._failures = 0

    def close(self) -> None:
        """Close the bus for good."""
        if self._bus is not None:
            self._bus.shutdown()
            self._bus = None

    def _open(self) -> can.BusABC:
        try:
            return can.Bus(**self._arguments)
        except (*_ERRORS, ValueError, TypeError, ImportError, NotImplementedError) as error:
            raise BusError(
                f"the CAN bus {self._arguments} cannot be opened: {error}. "
                "Check `bus` in robot.yaml, and that the interface is up (ip -details link show)."
            ) from error

    def _fail(self, problem: str) -> None:
        self.problem = problem
        self._failures = 0
        self._retry_at = time.monotonic() + RETRY_S
        bus, self._bus = self._bus, None
        try:
            if bus is not None:
                bus.shutdown()
        except _ERRORS as error:
            self.problem = f"{problem}; closing failed too: {error}"

    def _reopen(self) -> None:
        if time.monotonic() < self._retry_at:
            return
        try:
            self._bus = self._open()
        except BusError as error:
            self.problem = str(error)
            self._retry_at = time.monotonic() + RETRY_S
        else:
            self.problem = ""
