"""The driver's handle on the CAN bus (python-can): errors become a sentence in `problem`, late frames are never sent.

A bus that fails is closed and opened again every RETRY_S, for as long as it takes; it has failed until a frame went out
or came in. The core disarms meanwhile.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import can

from canbase_driver.cia301.frame import Frame
from canbase_driver.supervision.bus_health import BusReport
from canbase_runtime.local_frames import keep_to_this_computer

RETRY_S = 1.0
SEND_TIMEOUT_S = 0.002
"""A frame that the bus does not take within this time is dropped: setpoints of yesterday must not move a wheel."""
SEND_FAILURES = 10
"""So many failed sends in a row are a failed bus; fewer are a full transmit buffer."""
RECEIVE_FAILURES = 3
"""The same for receptions."""
IGNORED_AT_ONCE = 100
"""So many frames that are none of ours are passed over in one reception: more than a bus brings in one cycle."""
OPENS_AT_ONCE_S = 0.002
"""Most adapters are open by then; a serial one (slcan) takes 2 s, and the control cycle does not wait for it."""
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


class _Opening(threading.Thread):
    """Opens a bus while the control thread goes on."""

    def __init__(self, open_bus: Callable[[], can.BusABC]) -> None:
        super().__init__(name="opening", daemon=True)
        self.bus: can.BusABC | None = None
        self.error: BusError | None = None
        self._open_bus = open_bus
        self._lock, self._abandoned = threading.Lock(), False

    def run(self) -> None:
        """The thread's body."""
        try:
            bus = self._open_bus()
        except BusError as error:
            self.error = error
            return
        with self._lock:
            self.bus = bus
            if self._abandoned:
                bus.shutdown()

    def abandon(self) -> None:
        """Nobody waits for it any more: what it opens, or has opened, is closed."""
        with self._lock:
            self._abandoned = True
            if self.bus is not None:
                self.bus.shutdown()


class BusPort:
    """One bus. Only the control thread uses it."""

    def __init__(self, arguments: dict[str, Any]) -> None:
        """Opens `can.Bus(**arguments)`. Raises BusError."""
        self._arguments = arguments
        self.problem = ""
        self.report = BusReport()
        self._send_failures = self._receive_failures = 0
        self._retry_at = 0.0
        self._opening: _Opening | None = None
        self._bus: can.BusABC | None = self._open()

    def receive(self, timeout_s: float) -> Frame | None:
        """The next data frame with an 11-bit identifier; None when none came in `timeout_s`, or when receiving failed.

        Frames of other kinds are passed over, IGNORED_AT_ONCE of them at most: what waits behind them is not late.
        """
        until = time.monotonic() + timeout_s
        for _ in range(IGNORED_AT_ONCE):
            if self._bus is None:
                time.sleep(max(0.0, min(until, self._retry_at) - time.monotonic()))
                self._reopen()
                return None
            before = self.report
            frame = self._receive(self._bus, max(0.0, until - time.monotonic()))
            failed = self.report.receive_errors != before.receive_errors
            if frame is not None or failed or self.report is before:
                return frame
        return None

    def _receive(self, bus: can.BusABC, timeout_s: float) -> Frame | None:
        """None, and `report` grows, for what is no data frame of CANopen."""
        try:
            message = bus.recv(timeout_s)
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
        if self._opening is not None:
            self._opening.abandon()
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
            bus = can.Bus(**self._arguments)
            keep_to_this_computer(self._arguments, bus)
            return bus
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
        if self._opening is None:
            if time.monotonic() < self._retry_at:
                return
            self._opening = _Opening(self._open)
            self._opening.start()
            self._opening.join(OPENS_AT_ONCE_S)
        if self._opening.is_alive():
            return
        opening, self._opening = self._opening, None
        self._bus = opening.bus
        if opening.error is not None:
            self.problem = str(opening.error)
            self._retry_at = time.monotonic() + RETRY_S
        else:
            self._send_failures = self._receive_failures = 0
