"""The CAN controller's own reports: counters, and SocketCAN's error frames in words. No socket, no clock.

python-can's `state` is always the same on SocketCAN. The bits are those of linux/can/error.h: the class is the
identifier of the error frame, details of the class CONTROLLER are in data byte 1. The watchdog reads them by itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

CONTROLLER = 0x004
BUS_OFF = 0x040
RESTARTED = 0x100


class ControllerState(Enum):
    """State of a CAN controller (ISO 11898-1, linux/can/netlink.h). The values are the words of DriverStatus.msg."""

    ERROR_ACTIVE = "error active"
    """The only one that is fine."""
    ERROR_WARNING = "error warning"
    ERROR_PASSIVE = "error passive"
    BUS_OFF = "bus-off"
    STOPPED = "stopped"
    SLEEPING = "sleeping"
    UNKNOWN = "unknown"
    """It reports none, or one that this version does not know."""


DETAILS: tuple[tuple[int, ControllerState], ...] = (
    (0x30, ControllerState.ERROR_PASSIVE),
    (0x0C, ControllerState.ERROR_WARNING),
    (0x40, ControllerState.ERROR_ACTIVE),
)
"""Byte 1 of CONTROLLER: passive or warning when receiving or sending; back to active. The worst is the first."""


@dataclass(frozen=True, slots=True)
class BusReport:
    """Counters since the start, and the controller's last word about itself."""

    controller: ControllerState = ControllerState.ERROR_ACTIVE
    send_errors: int = 0
    receive_errors: int = 0
    error_frames: int = 0
    dropped: int = 0
    """Received frames that CANopen does not use (remote, 29-bit, CAN FD), or that no part understood; datagrams that
    are no frame."""
    failures: int = 0
    """How often the bus failed, and was closed to be opened again."""
    problem: str = ""
    """Why the bus does not work now; empty: it does."""

    @property
    def events(self) -> dict[str, int]:
        """What should not grow, by its name in DriverStatus."""
        return {
            "frames_dropped": self.dropped,
            "send_errors": self.send_errors,
            "receive_errors": self.receive_errors,
            "error_frames": self.error_frames,
            "bus_failures": self.failures,
        }

    def with_error_frame(self, error_class: int, data: bytes) -> BusReport:
        """The report after one error frame. Most are single errors on the wire, and counted alone."""
        return replace(self, error_frames=self.error_frames + 1, controller=_state(error_class, data, self.controller))

    def completed(self, dropped: int, problem: str) -> BusReport:
        """With what the driver alone knows. It is made for each snapshot, so without `replace`, which is slow."""
        errors = self.send_errors, self.receive_errors, self.error_frames
        return BusReport(self.controller, *errors, dropped, self.failures, problem)

    @property
    def is_bus_off(self) -> bool:
        """The controller has taken itself off the bus: nothing is sent or received until it is restarted."""
        return self.controller is ControllerState.BUS_OFF


def _state(error_class: int, data: bytes, before: ControllerState) -> ControllerState:
    if error_class & BUS_OFF:
        return ControllerState.BUS_OFF
    if error_class & RESTARTED:
        return ControllerState.ERROR_ACTIVE
    detail = data[1] if error_class & CONTROLLER and len(data) > 1 else 0
    return next((state for bits, state in DETAILS if detail & bits), before)
