"""What a recording consists of: frames and, in canbase's own recordings, notes between them. Plain values, no file.

Tuples, because a long recording has a hundred million of them.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


class FrameKind(Enum):
    """What kind of CAN frame it is. CANopen uses DATA, and REMOTE for node guarding."""

    __hash__ = object.__hash__

    DATA = "data"
    REMOTE = "remote"
    EXTENDED = "29-bit"
    ERROR = "error"
    """A report of the CAN controller, not a frame of a node."""


class RecordedFrame(NamedTuple):
    """One frame. `at_s`: seconds from the start of the recording, never less than that of the entry before."""

    at_s: float
    cob_id: int
    data: bytes
    sent: bool = False
    """The recorder itself sent it: canbase's driver, in a black box."""
    kind: FrameKind = FrameKind.DATA


class Note(NamedTuple):
    """A line of text between the frames."""

    at_s: float
    text: str


Entry = RecordedFrame | Note
