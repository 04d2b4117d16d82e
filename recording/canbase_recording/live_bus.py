"""The frames of a bus, live, as entries of a recording: for `canbase bus dump`. It sends nothing."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from types import TracebackType

import can

from canbase_config.robot import Bus
from canbase_recording.entry import RecordedFrame
from canbase_recording.recording_file import frame_kind


class LiveBusError(Exception):
    """The bus cannot be opened, or failed. The text has the reason."""


class LiveBus:
    """One bus, for a `with`. Error frames of the controller come too, where the adapter gives them."""

    def __init__(self, bus: Bus) -> None:
        """Opens it. Raises LiveBusError."""
        try:
            self._bus = can.Bus(**bus.arguments())
        except (can.CanError, OSError, ValueError, ImportError, NotImplementedError) as error:
            raise LiveBusError(f"{bus.interface} {bus.channel} cannot be opened: {error}") from error
        self._began_s = time.monotonic()

    def __enter__(self) -> LiveBus:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bus.shutdown()

    def frames(self, ended: Callable[[], bool], turn_s: float = 0.1) -> Iterator[RecordedFrame]:
        """Each frame as it comes, with the time since this was opened, until `ended`. Raises LiveBusError."""
        while not ended():
            try:
                message = self._bus.recv(turn_s)
            except (can.CanError, OSError, ValueError) as error:
                raise LiveBusError(f"the bus failed: {error}") from error
            if message is not None:
                at_s = time.monotonic() - self._began_s
                yield RecordedFrame(
                    at_s, message.arbitration_id, bytes(message.data), not message.is_rx, frame_kind(message)
                )
