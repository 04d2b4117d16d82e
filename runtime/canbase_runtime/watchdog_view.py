"""What motor_driver reports of the watchdog, in the words of canbase/msg/DriverStatus: for it and its listeners."""

from __future__ import annotations

from enum import Enum


class WatchdogView(Enum):
    """What the driver sees of the watchdog."""

    OK = "ok"
    MISSING = "missing"
    TRIPPED = "tripped"
    UNKNOWN = "unknown"
    """A word that the interface does not have; the driver never sends it. It is not fine."""


def watchdog_view(word: str) -> WatchdogView:
    """The view with this word; UNKNOWN for one that is not in the interface."""
    return _WORDS.get(word, WatchdogView.UNKNOWN)


_WORDS = {view.value: view for view in WatchdogView}
