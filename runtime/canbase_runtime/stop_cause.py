"""Why the safety filter holds or slows the base, as canbase/msg/SafetyState names it: for it and its listeners."""

from __future__ import annotations

from enum import Enum


class StopCause(Enum):
    """Why. The values are the CAUSE_ constants of SafetyState.msg."""

    NONE = "none"
    COMMAND_STALE = "command_stale"
    COMMAND_INVALID = "command_invalid"
    ESTOP = "estop"
    ESTOP_STALE = "estop_stale"
    SCAN_STALE = "scan_stale"
    SCAN_UNPLACED = "scan_unplaced"
    SCAN_INVALID = "scan_invalid"
    SCAN_FROZEN = "scan_frozen"
    SCAN_BLIND = "scan_blind"
    OBSTACLE = "obstacle"
    OBSTACLE_NEAR = "obstacle_near"
    SPEED = "speed_ceiling"
    ACCELERATION = "acceleration_ceiling"
    ZONE = "limit_zone"
    BLIND = "blind"
    SHUTDOWN = "shutdown"
    UNKNOWN = "unknown"
    """A word that the interface does not have; the filter never sends it. It is not fine."""

    @property
    def is_estop(self) -> bool:
        """The emergency stop, or its timeout."""
        return self in (StopCause.ESTOP, StopCause.ESTOP_STALE)


SCAN_LOST = frozenset({StopCause.SCAN_STALE, StopCause.SCAN_UNPLACED, StopCause.SCAN_INVALID, StopCause.SCAN_FROZEN})
"""A required scanner gives no scans that can be used."""


def stop_cause(word: str) -> StopCause:
    """The cause with this word; UNKNOWN for one that is not in the interface."""
    return _WORDS.get(word, StopCause.UNKNOWN)


_WORDS = {cause.value: cause for cause in StopCause}


def because(cause: str) -> str:
    """The cause in a message of driver or watchdog, for a sentence; empty where there is none."""
    return "" if cause in ("", StopCause.NONE.value) else f" (cause {cause})"
