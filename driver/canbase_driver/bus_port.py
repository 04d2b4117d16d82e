"""The driver's handle on the CAN bus (python-can): errors become a sentence in `problem`, late frames are never sent.

A bus that fails is closed and opened again every RETRY_S, for as long as it takes; it has failed until a frame went out
or came in. The core disarms meanwhile.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import can

from canbase_driver.bus_health import BusReport
from canbase_driver.frame import Frame

RETRY_S = 1.0
SEND_TIMEOUT_S = 0.002
"""A frame that the bus does not take within this time is dropped: setpoints of yesterday must not move a wheel."""
SEND_FAILURES = 10
"""So many failed sends in a row are a failed bus; fewer are a full transmit buffer."""
RECEIVE_FAILURES = 3
"""The same for receptions."""
BUS_OFF = "the CAN controller is bus-off after too many errors: check cable, termination and bit rate"
_ERRORS = (can.CanError, OSError, ValueError)
"""ValueError: what select says of a handle whose adapter is gone."""


def is_no_frame(error: Exception) -> bool:
    """A datagram on a simulated bus (udp_multicast) that is no CAN frame: the bus is as good as before.

    python-can gives the reason as the cause of its error; where the bus itself fails, that is an OSError or none.
    """
    return isinstance(error, can.CanOperationError) and not isinstance(error.__cause__, OSError | None)


class BusError(Exception):
    """The bus cannot be opened. The text says what to look at."""


class BusPort:
    """One bus. Only the control thread uses it."""

    def __init__(self, arguments: dict[str, Any]) -> None:
        """Opens `can.Bus(**arguments)`. Raises BusError."""
        self._arguments = arguments
        self.problem = ""
        self.report = BusReport()
        self._send_failures = self._receive_failures = 0
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
            if is_no_frame(error):
                self._drop()
            else:
                self._on_receive_error(error)
            return None
        return None if message is None else self._take(message)

    def send(self, frame: Frame) -> None:
        """Send now or never."""
        if self._bus is None:
            return
        message = can.Message(arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False)
        try:
            self._bus.send(message, timeout=SEND_TIMEOUT_S)
        except _ERRORS as error:
            self._on_send_error(error)
        else:
            self._send_failures = 0
            if not self.report.is_bus_off:  # then the kernel takes frames and drops them
                self.problem = ""

    def close(self) -> None:
        """Close the bus for good."""
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.shutdown()

    def _take(self, message: can.Message) -> Frame | None:
        if type(message.arbitration_id) is not int:  # python-can lets a simulated bus have 1.5
            self._drop()
            return None
        if message.is_error_frame:
            before, self.report = self.report, self.report.with_error_frame(message.arbitration_id, bytes(message.data))
            if self.report.is_bus_off and not before.is_bus_off:
                self._fail(BUS_OFF)
            return None
        self._receive_failures = 0
        self.problem = ""
        if self.report.is_bus_off:
            self.report = replace(self.report, controller=BusReport().controller)
        if message.is_remote_frame or message.is_extended_id or message.is_fd:
            self._drop()
            return None
        return Frame(message.arbitration_id, bytes(message.data))

    def _drop(self) -> None:
        self.report = replace(self.report, dropped=self.report.dropped + 1)

    def _on_send_error(self, error: Exception) -> None:
        self.report = replace(self.report, send_errors=self.report.send_errors + 1)
        self._send_failures += 1
        if self._send_failures >= SEND_FAILURES:
            self._fail(f"sending failed {self._send_failures} times in a row: {error}")

    def _on_receive_error(self, error: Exception) -> None:
        self.report = replace(self.report, receive_errors=self.report.receive_errors + 1)
        self._receive_failures += 1
        if self._receive_failures >= RECEIVE_FAILURES:
            self._fail(f"receiving failed {self._receive_failures} times in a row: {error}")

    def _open(self) -> can.BusABC:
        try:
            return can.Bus(**self._arguments)
        except (*_ERRORS, TypeError, ImportError, NotImplementedError) as error:
            raise BusError(
                f"the CAN bus {self._arguments} cannot be opened: {error}. "
                "Check `bus` in robot.yaml, and that the interface is up (ip -details link show)."
            ) from error

    def _fail(self, problem: str) -> None:
        self.problem = problem
        self.report = replace(self.report, failures=self.report.failures + 1)
        self._retry_at = time.monotonic() + RETRY_S
        bus, self._bus = self._bus, None
        try:
            if bus is not None:
                bus.shutdown()
        except _ERRORS as error:
            self.problem = f"{problem}; closing failed too: {error}"

    def _reopen(self) -> None:
        """The problem stays until a frame has passed: an interface that is down can be opened too."""
        if time.monotonic() < self._retry_at:
            return
        try:
            self._bus = self._open()
        except BusError as error:
            self.problem = str(error)
            self._retry_at = time.monotonic() + RETRY_S
        else:
            self._send_failures = self._receive_failures = 0
