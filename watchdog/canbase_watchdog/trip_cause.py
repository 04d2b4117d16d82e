"""Why the watchdog trips or has tripped: the causes, a verdict, and the one that a record of before the start gives."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from canbase_watchdog.latch import Mark, Past


class TripCause(enum.IntEnum):
    """Byte 1 of the state frame, see docs/bus.md."""

    NONE = 0
    LEASE_LOST = 1
    DRIVER_SILENT = 2
    DRIVE_SILENT = 3
    TARGET_OUTSIDE = 4
    MOTION_OUTSIDE = 5
    OVERSPEED = 6
    DRIVE_DOWN = 7
    FOREIGN_MASTER = 8
    BUS_FAILED = 9
    LOOP_LATE = 10
    ENDED = 11
    FEEDBACK_IMPLAUSIBLE = 12
    MOTION_MISSING = 13
    TWIST_OUTSIDE = 14
    SETPOINT_MISSING = 15
    ANSWERED_TWICE = 16
    POWER_AT_STAND = 17
    DRIVE_RESTARTED = 18
    POWER_AT_END = 20
    RECORD_UNUSABLE = 21


SENSOR_CAUSES = (TripCause.FEEDBACK_IMPLAUSIBLE, TripCause.MOTION_MISSING, TripCause.POWER_AT_STAND)
"""After a trip of before the start with one of these, what the drive reports about its motion is no evidence."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """Why to trip: the cause, the node that it is about (0: none), and one sentence with the values."""

    cause: TripCause = TripCause.NONE
    node_id: int = 0
    detail: str = ""


FINE = Verdict()


def before_the_start(past: Past) -> Verdict:
    """Why it is tripped from its first moment; FINE where a readable record is clear."""
    if not past.latched:
        return FINE
    if past.problem:
        detail = f"the record of its last trip cannot be used: {past.problem}"
        return Verdict(TripCause.RECORD_UNUSABLE, 0, detail)
    entry = past.entry
    if entry.mark is Mark.LIVE:
        return Verdict(TripCause.POWER_AT_END, 0, "it ended while a drive had power, or the computer lost its supply")
    known = entry.cause in tuple(TripCause) and entry.cause != TripCause.NONE
    cause = TripCause(entry.cause) if known else TripCause.RECORD_UNUSABLE
    return Verdict(cause, entry.node_id, f"{BEFORE}{entry.detail.removeprefix(BEFORE)}")


BEFORE = "since before the start: "
