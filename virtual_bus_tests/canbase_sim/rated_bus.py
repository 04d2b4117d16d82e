"""A python-can bus for each bit rate of one cable, for simulated drives whose rate may change: docs/drive_types.md."""

from __future__ import annotations

import select
import time
from collections.abc import Iterable
from contextlib import ExitStack

import can

from canbase_base.local_frames import keep_to_this_computer
from canbase_config.bit_rate import BIT_RATES, bus_at
from canbase_config.robot import Bus

POLL_S = 0.0005
"""Between two looks at buses that cannot be waited for (`virtual`)."""


class RatedBus:
    """Opens the channel of `bus.bitrate`, and with `open_all` those of all bit rates. Raises can.CanError, OSError."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._open = ExitStack()
        self._buses: dict[int, can.BusABC] = {}
        self._add(bus.bitrate)

    def open_all(self) -> None:
        """Every bit rate."""
        for bitrate in BIT_RATES:
            if bitrate not in self._buses:
                self._add(bitrate)

    @property
    def is_rated(self) -> bool:
        """Whether it has more than one bit rate."""
        return len(self._buses) > 1

    def close(self) -> None:
        """All of them."""
        self._open.close()

    def receive(self, timeout_s: float) -> tuple[can.Message, int] | None:
        """The next frame and its bit rate [bit/s]; None: none came in time. Raises can.CanError."""
        if not self.is_rated:
            message = self._buses[self._bus.bitrate].recv(timeout_s)
            return None if message is None else (message, self._bus.bitrate)
        if self._bus.interface == "virtual":
            return self._poll(time.monotonic() + timeout_s)
        by_number = {bus.fileno(): bitrate for bitrate, bus in self._buses.items()}
        ready, _, _ = select.select(list(by_number), [], [], timeout_s)
        return self._first(by_number[number] for number in ready)

    def send(self, message: can.Message, bitrate: int, timeout_s: float) -> None:
        """At this rate, one of those that are open. Raises can.CanError."""
        self._buses[bitrate].send(message, timeout=timeout_s)

    def _poll(self, until: float) -> tuple[can.Message, int] | None:
        while (received := self._first(self._buses)) is None and time.monotonic() < until:
            time.sleep(POLL_S)
        return received

    def _first(self, bitrates: Iterable[int]) -> tuple[can.Message, int] | None:
        for bitrate in bitrates:
            message = self._buses[bitrate].recv(0.0)
            if message is not None:
                return message, bitrate
        return None

    def _add(self, bitrate: int) -> None:
        arguments = bus_at(self._bus, bitrate).arguments()
        bus = self._open.enter_context(can.Bus(**arguments))
        keep_to_this_computer(arguments, bus)
        self._buses[bitrate] = bus
