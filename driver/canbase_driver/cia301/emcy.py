"""CiA 301 emergency messages (EMCY), and what their codes mean in words, CiA 402's among them (603Fh uses the same)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import EMCY, MAX_NODE_ID

TEXTS = {
    "00xx": "error reset or no error",
    "10xx": "generic error",
    "2xxx": "current",
    "21xx": "current, input side",
    "22xx": "current inside the device",
    "23xx": "current, output side",
    "2310": "over-current",
    "2320": "short circuit",
    "2330": "earth fault",
    "3xxx": "voltage",
    "31xx": "mains voltage",
    "32xx": "voltage inside the device",
    "3210": "over-voltage of the DC link",
    "3220": "under-voltage of the DC link",
    "33xx": "output voltage",
    "4xxx": "temperature",
    "41xx": "ambient temperature",
    "42xx": "device temperature",
    "4210": "device too hot",
    "5xxx": "device hardware",
    "6xxx": "device software",
    "61xx": "internal software",
    "62xx": "user software",
    "63xx": "data set",
    "7xxx": "additional modules",
    "7121": "motor blocked",
    "7300": "sensor",
    "7305": "encoder",
    "7500": "communication module",
    "8xxx": "monitoring",
    "81xx": "communication",
    "8110": "CAN overrun, frames lost",
    "8120": "CAN controller in error passive mode",
    "8130": "heartbeat or life guarding lost",
    "8140": "recovered from bus-off",
    "8150": "COB-ID collision",
    "82xx": "protocol error",
    "8210": "PDO too short",
    "8220": "PDO too long",
    "8230": "destination of a multiplexed PDO not available",
    "8240": "SYNC of unexpected length",
    "8250": "RPDO timeout",
    "8400": "velocity control",
    "8611": "following error",
    "8700": "sync control",
    "8900": "process data monitoring",
    "90xx": "external error",
    "F0xx": "additional functions",
    "FFxx": "device specific",
}
"""Error code in hexadecimal, x for any digit (CiA 301, EMCY error codes; CiA 402-2, 603Fh)."""


@dataclass(frozen=True, slots=True)
class Emcy:
    """An emergency message: `code` as in `TEXTS`, `register` as 1001h, `vendor` what the vendor adds (0…5 bytes)."""

    node_id: int
    code: int
    register: int
    vendor: bytes

    @property
    def is_reset(self) -> bool:
        """Whether the message reports that an error has gone."""
        return self.code >> 8 == 0

    @property
    def text(self) -> str:
        """Code and meaning for people."""
        return self.text_with({})

    def text_with(self, makers: Mapping[int, str]) -> str:
        """The same, with the manufacturer's own words for its codes, and its bytes where there are any."""
        details = f", bytes {self.vendor.hex(' ').upper()}" if any(self.vendor) else ""
        return f"{self.code:04X}h {emcy_text(self.code, makers)}{details}"


def parse_emcy(frame: Frame) -> Emcy | None:
    """The emergency message in a frame, None for any other frame.

    Real drives also send fewer than 8 bytes: what is missing counts as 0. Without a whole code it is no message.
    """
    node_id = frame.cob_id - EMCY
    if not 1 <= node_id <= MAX_NODE_ID or len(frame.data) < 2:
        return None
    code = int.from_bytes(frame.data[:2], "little")
    return Emcy(node_id, code, register=int.from_bytes(frame.data[2:3], "little"), vendor=frame.data[3:])


def emcy_text(code: int, makers: Mapping[int, str] = MappingProxyType({})) -> str:
    """Meaning of an error code 0…FFFFh in words: the manufacturer's own, or the most specific row of the table."""
    if code in makers:
        return makers[code]
    digits = f"{code:04X}"
    patterns = (digits[:known] + "x" * (4 - known) for known in (4, 3, 2, 1))
    return next((TEXTS[pattern] for pattern in patterns if pattern in TEXTS), "unknown error")
