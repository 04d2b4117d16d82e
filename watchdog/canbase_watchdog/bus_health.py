"""Whether the bus takes frames: from the success of sending and from SocketCAN's error frames. No socket, no clock.

python-can's `state` is always the same on SocketCAN; the controller reports by error frames. Their bits are
those of linux/can/error.h: the class is the identifier, details are in byte 1.
"""

from __future__ import annotations

import math

TX_TIMEOUT = 0x001
CONTROLLER = 0x004
BUS_OFF = 0x040
RESTARTED = 0x100
PASSIVE = 0x10 | 0x20
"""Byte 1 of CONTROLLER: error passive when receiving, when sending."""
ACTIVE = 0x40
"""Byte 1 of CONTROLLER: back to error active."""


class BusHealth:
    """Since when the bus has failed. All times are monotonic seconds."""

    def __init__(self) -> None:
        """It works until it is seen to fail."""
        self._unsent_since = self._broken_since = math.inf
        self.is_off = False
        """The controller has taken itself off the bus, and nothing has shown since that it is back."""
        self.send_errors = 0
        self.receive_errors = 0
        self.error_frames = 0

    @property
    def failed_since(self) -> float:
        """When the trouble began that lasts until now; infinity: there is none."""
        return min(self._unsent_since, self._broken_since)

    @property
    def works(self) -> bool:
        """There is no trouble of any kind."""
        return self.failed_since == math.inf

    @property
    def takes_frames(self) -> bool:
        """False from a failed send until the next one that succeeds."""
        return self._unsent_since == math.inf

    @property
    def errors(self) -> int:
        """Failed sends, failed receptions and error frames since the start."""
        return self.send_errors + self.receive_errors + self.error_frames

    def on_sent(self) -> None:
        """A frame was taken by the bus."""
        self._unsent_since = math.inf

    def on_send_error(self, now_s: float) -> None:
        """A frame was not taken."""
        self.send_errors += 1
        self._unsent_since = min(self._unsent_since, now_s)

    def on_receive_error(self, now_s: float) -> None:
        """Reading failed: the interface is down or gone."""
        self.receive_errors += 1
        self.on_trouble(now_s)

    def on_trouble(self, now_s: float) -> None:
        """From now on the bus has failed, whatever it takes, until a frame of somebody else comes, or the controller
        says that it is back."""
        self._broken_since = min(self._broken_since, now_s)

    def on_bus_off(self, now_s: float) -> None:
        """The controller has taken itself off the bus. It takes no frames, whatever the kernel takes."""
        self.is_off = True
        self.on_trouble(now_s)

    def on_data(self) -> None:
        """A frame of somebody else came: controller and cable work."""
        self._broken_since, self.is_off = math.inf, False

    def on_error_frame(self, error_class: int, data: bytes, now_s: float) -> None:
        """What the controller reports. Bus errors and lost arbitrations are only counted: each may be the last one."""
        self.error_frames += 1
        detail = data[1] if error_class & CONTROLLER and len(data) > 1 else 0
        if error_class & BUS_OFF:
            self.on_bus_off(now_s)
        elif error_class & TX_TIMEOUT or detail & PASSIVE:
            self.on_trouble(now_s)
        elif error_class & RESTARTED or detail & ACTIVE:
            self.on_data()
