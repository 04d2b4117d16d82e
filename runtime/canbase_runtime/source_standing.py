"""Why velocity_mux does not follow the source that holds the base: from the numbers of canbase/msg/MuxSource."""

from __future__ import annotations

from enum import Enum
from typing import Protocol


class Followed(Enum):
    """Whether the source that holds the base is followed, and if not, what keeps it from that."""

    YES = "followed"
    LATE = "its commands arrive late"
    UNARMED = "it has not commanded zero yet"
    UNKNOWN = "no field of the message says why"
    NOT_HOLDING = "it does not hold the base"


class Source(Protocol):
    """The fields of MuxSource that tell it."""

    active: bool
    armed: bool
    reason: str
    delay_s: float
    timeout_s: float


def followed(source: Source) -> Followed:
    """The rules of the mux in their order (rule 6 of mux.py); `reason` is empty for a source that is followed."""
    if not source.active:
        return Followed.NOT_HOLDING
    if not source.reason:
        return Followed.YES
    if abs(source.delay_s) > source.timeout_s:  # NaN: its messages have no stamp
        return Followed.LATE
    return Followed.UNKNOWN if source.armed else Followed.UNARMED
