"""One CAN frame as the driver's core sees it: classic CAN, 11-bit identifier. No bus and no library here."""

from __future__ import annotations

from dataclasses import dataclass

MAX_COB_ID = 0x7FF
"""Largest 11-bit identifier (ISO 11898-1)."""
MAX_DATA_BYTES = 8
"""Longest payload of a classic CAN frame."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame that may go onto the bus: `cob_id` 0…7FFh, `data` 0…8 bytes. `remote`: it requests the frame with that
    identifier, and has no data.

    Raises ValueError for anything else, so that a frame that cannot be built never falls back to another identifier.
    """

    cob_id: int
    data: bytes = b""
    remote: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.cob_id <= MAX_COB_ID:
            raise ValueError(f"COB-ID {self.cob_id:#x} is outside 0…7FFh; only 11-bit identifiers are sent")
        if len(self.data) > MAX_DATA_BYTES:
            raise ValueError(f"{len(self.data)} data bytes in frame {self.cob_id:03X}h; a CAN frame carries 8 at most")

    def __str__(self) -> str:
        return f"{self.cob_id:03X}h [{'remote' if self.remote else self.data.hex(' ').upper()}]"
