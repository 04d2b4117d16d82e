"""The watchdog's own handle on the CAN bus (python-can): errors are counted, never raised; no frame is sent late."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator
from typing import Any

import can

from canbase_base.carrier import is_without_carrier
from canbase_base.frame_socket import ERROR, ERROR_CLASS, MAX_COB_ID, Received, open_bus
from canbase_watchdog.bus_health import BusHealth
from canbase_watchdog.frames import Frame

SEND_TIMEOUT_S = 0.001
"""What the bus does not take within this time is dropped: each turn of the loop repeats what still matters."""
CARRIER_S = 0.05
"""Between two looks at the carrier of an interface that is bus-off [s]."""
REQUESTED_BYTES = 1
"""Of the answer to a guard request: a remote frame has the length of what it requests (ISO 11898-1)."""
BATCH = 256
"""Frames taken in before the loop looks at the clock again."""
_ERRORS = (can.CanError, OSError, ValueError)
"""ValueError: from select for a handle whose adapter is gone."""


class BusPort:
    """Sends frames with 11-bit identifiers on one bus, and receives the data frames. Use it in a `with` statement."""

    def __init__(self, arguments: dict[str, Any], *, after_loss: bool = False) -> None:
        """Opens `can.Bus(**arguments)`. Raises BusError with what to look at. `after_loss`: it failed before, and
        counts as failed until it takes a frame: an interface that is down can be opened too."""
        self._bus = open_bus(arguments)
        self._arguments = arguments
        self._carrier_due = -math.inf
        self._waiting: Received | None = None
        self._received_until = time.monotonic()
        self.health = BusHealth()
        if after_loss:
            self.health.on_send_error(self._received_until)
        if is_without_carrier(arguments):
            self.health.on_bus_off(self._received_until)
        self.request_problem = ""
        """Why the adapter did not take the last remote frame; empty: it took it, or there was none."""
        self.datagrams_dropped = 0
        """Those that were no CAN frame. The bus is as good as before."""

    def __enter__(self) -> BusPort:
        return self

    def __exit__(self, *error: object) -> None:
        with contextlib.suppress(*_ERRORS):  # an adapter that is gone
            self._bus.close()

    def fileno(self) -> int | None:
        """What to wait on with select, or None for a bus that has no such thing (`virtual`)."""
        return self._bus.fileno()

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
            received, self._waiting = self._waiting or self._take(0.0), None
            if received is None:
                self._received_until = now_s
                return
            can_id, data, wall_s = received
            if can_id < 0:
                self.datagrams_dropped += 1
            elif can_id > MAX_COB_ID and can_id & ERROR:
                self.health.on_error_frame(can_id & ERROR_CLASS, data, time.monotonic())
            else:
                self._on_data(now_s)
                if can_id <= MAX_COB_ID:
                    at_s = wall_s - behind_s
                    self._received_until = at_s if self._received_until <= at_s <= now_s else now_s
                    yield can_id, data, self._received_until

    def _on_data(self, now_s: float) -> None:
        """While it is bus-off, some interfaces (slcan) still bring the driver's frames to this process.

        Only then is the carrier read, and not for each frame: a read takes 30 us, and newer kernels take their lock for
        all interfaces (rtnl_mutex) for it.
        """
        if self.health.is_off:
            if now_s < self._carrier_due:
                return
            self._carrier_due = now_s + CARRIER_S
            if is_without_carrier(self._arguments):
                return
        self.health.on_data()

    def send(self, frame: Frame) -> None:
        """Send now or never: a frame that the bus does not take at once is counted and dropped."""
        if frame.remote:
            self._request(frame.cob_id)
            return
        try:
            self._bus.write(frame.cob_id, frame.data, SEND_TIMEOUT_S)
        except _ERRORS:
            self.health.on_send_error(time.monotonic())
        else:
            self.health.on_sent()

    def _request(self, cob_id: int) -> None:
        """Not every adapter has remote frames: one that refuses them alone is no failed bus."""
        try:
            self._bus.request(cob_id, REQUESTED_BYTES, SEND_TIMEOUT_S)
        except (*_ERRORS, NotImplementedError) as error:
            self.health.send_errors += 1
            self.request_problem = str(error) or type(error).__name__
        else:
            self.health.on_sent()
            self.request_problem = ""

    def _take(self, timeout_s: float) -> Received | None:
        try:
            return self._bus.read(timeout_s)
        except _ERRORS:
            self.health.on_receive_error(time.monotonic())
            time.sleep(0.001)
            return None
