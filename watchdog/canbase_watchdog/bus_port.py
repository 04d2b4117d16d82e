"""The watchdog's own handle on the CAN bus (python-can): errors are counted, never raised; no frame is sent late."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import can

from canbase_watchdog.bus_health import BusHealth
from canbase_watchdog.frames import Frame
from canbase_watchdog.local_frames import keep_to_this_computer

SEND_TIMEOUT_S = 0.001
"""What the bus does not take within this time is dropped: each turn of the loop repeats what still matters."""
BATCH = 256
"""Frames taken in before the loop looks at the clock again."""
_ERRORS = (can.CanError, OSError, ValueError)
"""ValueError: what select says of a handle whose adapter is gone."""


NO_FRAME = can.Message()
"""In the place of a datagram on a simulated bus (udp_multicast) that is no CAN frame."""


class BusError(Exception):
    """The bus cannot be opened."""


class BusPort:
    """Sends and receives data frames with 11-bit identifiers on one bus. Use it in a `with` statement."""

    def __init__(self, arguments: dict[str, Any]) -> None:
        """Opens `can.Bus(**arguments)`. Raises BusError with what to look at."""
        try:
            self._bus = can.Bus(**arguments)
            keep_to_this_computer(arguments, self._bus)
        except (*_ERRORS, TypeError, ImportError, NotImplementedError) as error:
            raise BusError(
                f"the CAN bus {arguments} cannot be opened: {error}. "
                "Check `bus` in robot.yaml, and that the interface is up (ip -details link show)."
            ) from error
        self._waiting: can.Message | None = None
        self._received_until = time.monotonic()
        self.health = BusHealth()
        self.datagrams_dropped = 0
        """Those that were no CAN frame. The bus is as good as before."""

    def __enter__(self) -> BusPort:
        return self

    def __exit__(self, *error: object) -> None:
        self._bus.shutdown()

    def fileno(self) -> int | None:
        """What to wait on with select, or None for a bus that has no such thing (`virtual`)."""
        try:
            return self._bus.fileno()
        except NotImplementedError:
            return None

    def wait(self, timeout_s: float) -> None:
        """Wait for a frame on a bus without a fileno. It is kept for `receive`."""
        self._waiting = self._take(timeout_s)

    def receive(self, now_s: float) -> Iterator[tuple[int, bytes, float]]:
        """Identifier, data and receive time [s, monotonic] of what has arrived, at most BATCH; without error, remote
        and 29-bit frames.

        The time is the kernel's, which has it by the wall clock, where it lies between the last frame, or the last
        time that there was none, and `now_s`. Else it is `now_s`: the wall clock was set in between, or an adapter has
        a clock of its own.
        """
        behind_s = time.time() - time.monotonic()
        for _ in range(BATCH):
            message, self._waiting = self._waiting or self._take(0.0), None
            if message is None:
                self._received_until = now_s
                return
            if message is NO_FRAME or type(message.arbitration_id) is not int:  # python-can lets 1.5 pass there
                self.datagrams_dropped += 1
                continue
            if message.is_error_frame:
                self.health.on_error_frame(message.arbitration_id, bytes(message.data), time.monotonic())
                continue
            self.health.on_data()
            if not (message.is_remote_frame or message.is_extended_id or message.is_fd):
                at_s = message.timestamp - behind_s
                self._received_until = at_s if self._received_until <= at_s <= now_s else now_s
                yield message.arbitration_id, bytes(message.data), self._received_until

    def send(self, frame: Frame) -> None:
        """Send now or never: a frame that the bus does not take at once is counted and dropped."""
        message = can.Message(arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False)
        try:
            self._bus.send(message, timeout=SEND_TIMEOUT_S)
        except _ERRORS:
            self.health.on_send_error(time.monotonic())
        else:
            self.health.on_sent()

    def _take(self, timeout_s: float) -> can.Message | None:
        try:
            return self._bus.recv(timeout_s)
        except _ERRORS as error:
            # python-can names the reason as the cause; where the bus itself fails, that is an OSError or none.
            if isinstance(error, can.CanOperationError) and not isinstance(error.__cause__, OSError | None):
                return NO_FRAME
            self.health.on_receive_error(time.monotonic())
            time.sleep(0.001)
            return None
