"""The signals that request the end of a command: Ctrl-C, systemd, a terminal that was closed."""

from __future__ import annotations

import signal
from types import FrameType


def end_signals() -> list[int]:
    """A list that receives the number of each signal that requests the end. Call from the main thread."""
    received: list[int] = []

    def note(number: int, _frame: FrameType | None) -> None:
        received.append(number)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, note)
    return received
