"""What the CAN controller says of itself: counters, and SocketCAN's error frames in words. No socket, no clock.

python-can's `state` tells nothing on SocketCAN. The bits are those of linux/can/error.h: the class is the identifier of
the error frame, details of the class CONTROLLER are in data byte 1. The watchdog reads them by itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

CONTROLLER = 0x004
BUS_OFF = 0x040
RESTARTED = 0x100
DETAILS: tuple[tuple[int, str], ...] = (
    (0x30, "error passive"),
    (0x0C, "error warning"),
    (0x40, "error active"),
)
"""Byte 1 of CONTROLLER: passive or warning when receiving or sending; back to active. The worst is the first."""


@dataclass(frozen=True, slots=True)
class BusReport:
    """Counters since the start, and the controller's last word about itself."""

    controller: str = "error active"
    send_errors: int = 0
    receive_errors: int = 0
    error_frames: int = 0
    dropped: int = 0
    """Received frames that CANopen does not use: remote, 29-bit, CAN FD; datagrams that are no frame."""
    failures: int = 0
    """How often the bus failed, and was closed to be opened anew."""

    def with_error_frame(self, error_class: int, data: bytes) -> BusReport:
        """The report after one error frame. Most are single errors on the wire, and counted alone."""
        return replace(self, error_frames=self.error_frames + 1, controller=_state(error_class, data, self.controller))

    @property
    def is_bus_off(self) -> bool:
        """The controller has taken itself off the bus: nothing is sent or heard until it is restarted."""
        return self.controller == "bus-off"


def _state(error_class: int, data: bytes, before: str) -> str:
    if error_class & BUS_OFF:
        return "bus-off"
    if error_class & RESTARTED:
        return "error active"
    detail = data[1] if error_class & CONTROLLER and len(data) > 1 else 0
    return next((text for bits, text in DETAILS if detail & bits), before)
