"""The driver's handle on the CAN bus (python-can): errors become a sentence in `problem`, late frames are never sent.

A bus that fails is closed and opened again every RETRY_S, for as long as it takes; it has failed until a frame went out
or came in. The core disarms meanwhile. What was cut off may have got another driver meanwhile, and a bus that was down
at the start was never listened to: so after a failure a driver listens again before it sends more than its heartbeat,
once, which shows whether the bus carries and orders nothing of the drives of another one.
"""

from __future__ import annotations

import math
import threading
import time
from dataclasses import replace
from typing import Any

import can

from canbase_base.carrier import is_without_carrier
from canbase_base.frame_socket import ERROR, ERROR_CLASS, MAX_COB_ID, REMOTE, BusError, FrameSocket, open_bus
from canbase_config.robot import DRIVER_NODE_ID
from canbase_driver.cia301.frame import MAX_DATA_BYTES, Frame
from canbase_driver.cia301.nmt import HEARTBEAT, SYNC
from canbase_driver.runtime.bus_traffic import Traffic, interface_traffic
from canbase_driver.supervision.bus_health import BusReport, ControllerState

RETRY_S = 1.0
SEND_TIMEOUT_S = 0.002
"""A frame that the bus does not take within this time is dropped: setpoints of yesterday must not move a wheel."""
SEND_FAILURES = 10
"""This many failed sends in a row are a failed bus; fewer are a full transmit buffer."""
RECEIVE_FAILURES = 3
"""The same for receptions."""
LATEST_S = 60.0
"""A frame does not wait longer in a socket [s]."""
IGNORED_AT_ONCE = 100
"""This many frames that are not ours are passed over in one reception: more than a bus brings in one cycle."""
REQUESTED_BYTES = 1
"""Of the answer to a guard request: a remote frame has the length of what it requests (ISO 11898-1)."""
CARRIER_S = 0.05
"""Between two looks at the carrier of an interface that is bus-off [s]."""
OPENS_AT_ONCE_S = 0.002
"""Most adapters are open by then; a serial one (slcan) takes 2 s, and the control cycle does not wait for it."""
BUS_OFF = "the CAN controller is bus-off after too many errors: check cable, termination and bit rate"
ANOTHER_DRIVER = (
    f"another driver is on the bus: SYNC or the heartbeat of node {DRIVER_NODE_ID} came. "
    "Only one may run; end it first, on the computer that it runs on"
)
_OWN_HEARTBEAT = HEARTBEAT + DRIVER_NODE_ID
_ERRORS = (can.CanError, OSError, ValueError)
"""ValueError: from select for a handle whose adapter is gone."""


def is_of_a_driver(frame: Frame) -> bool:
    """Whether only a driver sends it: docs/bus.md."""
    return frame.cob_id in (SYNC.cob_id, _OWN_HEARTBEAT)


def _is_guard_request(can_id: int) -> bool:
    """Whether it is the watchdog's remote frame to a drive: no frame for the driver, and none to count."""
    return HEARTBEAT < can_id & ~REMOTE <= MAX_COB_ID and can_id & REMOTE != 0


class _Opening(threading.Thread):
    """Opens a bus while the control thread goes on."""

    def __init__(self, arguments: dict[str, Any]) -> None:
        super().__init__(name="opening", daemon=True)
        self.bus: FrameSocket | None = None
        self.without_carrier = False
        self._arguments = arguments
        self.error: BusError | None = None
        self._lock, self._abandoned = threading.Lock(), False

    def run(self) -> None:
        """The thread's body."""
        try:
            bus = open_bus(self._arguments)
        except BusError as error:
            self.error = error
            return
        self.without_carrier = is_without_carrier(self._arguments)
        with self._lock:
            self.bus = bus
            if self._abandoned:
                bus.close()

    def abandon(self) -> None:
        """Nothing waits for it any more: what it opens, or has opened, is closed."""
        with self._lock:
            self._abandoned = True
            if self.bus is not None:
                self.bus.close()


class BusPort:
    """One bus. Only the control thread uses it."""

    def __init__(self, arguments: dict[str, Any], listen_s: float = 0.0) -> None:
        """Opens `can.Bus(**arguments)`. Raises BusError.

        `listen_s`: for so long it listens after each failure; a driver does, for the timeout of a heartbeat.
        """
        self._arguments = arguments
        self._listen_s, self._listens, self._silent_until_s = listen_s, False, math.inf
        self._probe: Frame | None = None
        self.problem = ""
        self.report = BusReport()
        self._frames = self._data_bytes = 0
        """Sent and received here."""
        self._hears_itself = arguments.get("interface") == "udp_multicast"
        self._received_wall_s = 0.0
        """When the kernel received the last frame, by the wall clock; 0.0: unknown."""
        self._send_failures = self._receive_failures = self._passed_over = 0
        self._retry_at = 0.0
        self._carrier_due = -math.inf
        self._opening: _Opening | None = None
        self._bus: FrameSocket | None = open_bus(self._arguments)
        if is_without_carrier(arguments):
            self._on_bus_off_before()
            self._fail(BUS_OFF)

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
            before, passed_over = self.report, self._passed_over
            frame = self._receive(self._bus, max(0.0, until - time.monotonic()))
            failed = self.report.receive_errors != before.receive_errors
            if frame is not None or failed or (self.report is before and self._passed_over == passed_over):
                return frame
        return None

    def received_at(self, now_s: float) -> float:
        """When the kernel received the last frame that `receive` gave, `now_s` ago or before [s, monotonic].

        `now_s` where it does not tell, or the wall clock was set meanwhile.
        """
        late_s = time.time() - self._received_wall_s
        return now_s - late_s if 0.0 < late_s < LATEST_S else now_s

    def traffic(self) -> Traffic:
        """What has passed on the bus; from any thread. On SocketCAN the kernel counts the frames of other devices too,
        which it does not pass to this process.
        """
        counted = interface_traffic(self._arguments) if self._arguments.get("interface") == "socketcan" else None
        return counted or Traffic(self._frames, self._data_bytes)

    def _receive(self, bus: FrameSocket, timeout_s: float) -> Frame | None:
        """None, and `report` grows, for what is no data frame of CANopen."""
        try:
            received = bus.read(timeout_s)
        except _ERRORS as error:
            self._on_receive_error(error)
            return None
        if received is None:
            return None
        can_id, data, self._received_wall_s = received
        self._frames += 1
        self._data_bytes += len(data)
        if can_id < 0:
            self._drop()
            return None
        if can_id > MAX_COB_ID and can_id & ERROR:
            self._on_error_frame(can_id & ERROR_CLASS, data)
            return None
        self._on_received()
        if can_id > MAX_COB_ID or len(data) > MAX_DATA_BYTES:
            if _is_guard_request(can_id):
                self._passed_over += 1
            else:
                self._drop()
            return None
        frame = Frame(can_id, data)
        if self._listens and is_of_a_driver(frame):
            self._on_driver(frame)
        return frame

    def send(self, frame: Frame) -> None:
        """Send now or never."""
        if self._bus is None or self._is_silent() or (self._listens and frame.cob_id != _OWN_HEARTBEAT):
            return
        try:
            if frame.remote:
                self._bus.request(frame.cob_id, REQUESTED_BYTES, SEND_TIMEOUT_S)
            else:
                self._bus.write(frame.cob_id, frame.data, SEND_TIMEOUT_S)
        except (*_ERRORS, NotImplementedError) as error:
            self._on_send_error(error)
        else:
            self._send_failures = 0
            if not self._hears_itself:
                self._frames += 1
                self._data_bytes += len(frame.data)
            if not self.report.is_bus_off:  # then the kernel takes frames and drops them
                self._probe = frame if self._listens else None
                self._on_passed()

    def close(self) -> None:
        """Close the bus. It is not opened again."""
        if self._opening is not None:
            self._opening.abandon()
        bus, self._bus = self._bus, None
        if bus is not None:
            bus.close()

    def _on_error_frame(self, error_class: int, data: bytes) -> None:
        before, self.report = self.report, self.report.with_error_frame(error_class, data)
        if self.report.is_bus_off and not before.is_bus_off:
            self._fail(BUS_OFF)

    def _on_bus_off_before(self) -> None:
        """The controller was bus-off before the bus was opened, and will not say so again."""
        self.report = replace(self.report, controller=ControllerState.BUS_OFF)

    def _on_received(self) -> None:
        """The bus works. While it is bus-off, some interfaces (slcan) still bring this computer's own frames."""
        self._receive_failures = 0
        if self.report.is_bus_off:
            now_s = time.monotonic()
            if now_s < self._carrier_due:
                return
            self._carrier_due = now_s + CARRIER_S
            if is_without_carrier(self._arguments):
                return
            self.report = replace(self.report, controller=BusReport().controller)
        self._on_passed()

    def _on_passed(self) -> None:
        """A frame went out or came in. After a failure the listening begins, and the problem stays until it is over."""
        if not self._listens:
            self.problem = ""
        elif self._silent_until_s == math.inf:
            self._silent_until_s = time.monotonic() + self._listen_s

    def _is_silent(self) -> bool:
        """Whether it listens now; when that is over, it goes on as before the failure."""
        if not self._listens or self._silent_until_s == math.inf:
            return False
        self._listens = time.monotonic() < self._silent_until_s
        return self._listens

    def _on_driver(self, frame: Frame) -> None:
        """While it listens. A simulated bus brings back the one frame that was sent, and that is none of another."""
        if frame == self._probe:
            self._probe = None
        else:
            self._fail(f"{ANOTHER_DRIVER} ({frame})")

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

    def _fail(self, problem: str) -> None:
        self.problem = problem
        self.report = replace(self.report, failures=self.report.failures + 1)
        self._retry_at = time.monotonic() + RETRY_S
        self._listens, self._silent_until_s = self._listen_s > 0.0, math.inf
        bus, self._bus = self._bus, None
        try:
            if bus is not None:
                bus.close()
        except _ERRORS as error:
            self.problem = f"{problem}; closing failed too: {error}"

    def _reopen(self) -> None:
        """The problem stays until a frame has passed: an interface that is down can be opened too."""
        if self._opening is None:
            if time.monotonic() < self._retry_at:
                return
            self._opening = _Opening(self._arguments)
            self._opening.start()
            self._opening.join(OPENS_AT_ONCE_S)
        if self._opening.is_alive():
            return
        opening, self._opening = self._opening, None
        self._bus = opening.bus
        if opening.error is not None:
            self.problem = str(opening.error)
            self._retry_at = time.monotonic() + RETRY_S
            return
        self._send_failures = self._receive_failures = 0
        if opening.without_carrier:
            self._on_bus_off_before()
            self.problem = BUS_OFF
