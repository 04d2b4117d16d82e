"""Why the watchdog trips or has tripped: the causes, a verdict, and the one that a record of before the start gives."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from canbase_base.latch_record import Defect, Found, Mark, Record


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


def before_the_start(found: Found) -> Verdict:
    """Why it is tripped from its first moment; FINE where a readable record is clear."""
    if not found.latched:
        return FINE
    if found.defect is not Defect.NONE:
        detail = f"the record of its last trip cannot be used: {found.defect.value} ({found.detail})"
        return Verdict(TripCause.RECORD_UNUSABLE, 0, detail)
    record = found.record
    if record.mark is Mark.LIVE:
        return Verdict(TripCause.POWER_AT_END, 0, "it ended while a drive had power, or the computer lost its supply")
    number, node_id = record.code & 0xFF, record.code >> 8 & _NODE
    known = number in tuple(TripCause) and number != TripCause.NONE
    cause = TripCause(number) if known else TripCause.RECORD_UNUSABLE
    return Verdict(cause, node_id, f"{BEFORE}{record.detail.removeprefix(BEFORE)}")


def code_of(verdict: Verdict, *, opened: bool) -> int:
    """The code of a trip in the record. `opened`: the relay opened in it for a drive that kept its power."""
    return verdict.cause | verdict.node_id << 8 | (_OPENED if opened else 0)


def has_opened(record: Record) -> bool:
    """The relay opened in that trip."""
    return bool(record.code & _OPENED)


BEFORE = "since before the start: "
_OPENED, _NODE = 0x8000, 0x7F
"""In the code of a record, above the cause."""
