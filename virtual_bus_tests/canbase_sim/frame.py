"""The CAN frame of the bench: identifier and up to eight bytes, checked when it is made."""

from __future__ import annotations

from dataclasses import dataclass

MAX_COB_ID = 0x7FF
"""Highest eleven-bit identifier (ISO 11898-1); CANopen uses no others."""
MAX_EXTENDED_ID = 0x1FFF_FFFF
"""Highest identifier of 29 bits: other traffic on the same cable."""
MAX_LENGTH = 8
"""Most data bytes of a classic CAN frame."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One classic CAN frame; `extended`: its identifier has 29 bits. `remote`: it requests that frame, without data.

    Raises ValueError for an identifier outside 0..7FFh (1FFFFFFFh) or more than eight bytes.
    """

    cob_id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False

    def __post_init__(self) -> None:
        highest = MAX_EXTENDED_ID if self.extended else MAX_COB_ID
        if not 0 <= self.cob_id <= highest:
            raise ValueError(f"COB-ID {self.cob_id:#x} is outside 0..{highest:X}h")
        if len(self.data) > MAX_LENGTH:
            raise ValueError(f"{len(self.data)} data bytes in one frame; CAN carries at most {MAX_LENGTH}")

    def __str__(self) -> str:
        return f"{self.cob_id:03X} [{len(self.data)}] {self.data.hex(' ').upper()}"
