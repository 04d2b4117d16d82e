"""A value of a drive as a DCF has it in ParameterValue, and back: by the data types of CiA 301."""

from __future__ import annotations

import struct
from typing import Final

from canbase_config.eds_file import adds_node_id, number

INTEGER_BYTES: Final = {
    0x01: 1, 0x02: 1, 0x03: 2, 0x04: 4, 0x05: 1, 0x06: 2, 0x07: 4, 0x10: 3, 0x15: 8, 0x16: 3, 0x1B: 8,
    0x12: 5, 0x13: 6, 0x14: 7, 0x18: 5, 0x19: 6, 0x1A: 7,
}  # fmt: skip
"""Bytes of BOOLEAN, INTEGERn and UNSIGNEDn."""
SIGNED: Final = frozenset((0x02, 0x03, 0x04, 0x10, 0x12, 0x13, 0x14, 0x15))
REALS: Final = {0x08: "<f", 0x11: "<d"}
"""REAL32 and REAL64."""
TEXTS: Final = frozenset((0x09, 0x0B))
"""VISIBLE_STRING, UNICODE_STRING."""
LONG: Final = frozenset((0x09, 0x0A, 0x0B, 0x0F))
"""Texts, OCTET_STRING and DOMAIN: they may be long."""


def to_text(data: bytes, data_type: int | None) -> str:
    """The value for a person and for a DCF. What has no text of its type, or another width, is in hexadecimal bytes."""
    if data_type in INTEGER_BYTES and len(data) == INTEGER_BYTES[data_type]:
        if data_type in SIGNED:
            return str(int.from_bytes(data, "little", signed=True))
        return f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X}"
    if data_type in REALS and len(data) == struct.calcsize(REALS[data_type]):
        return repr(float(struct.unpack(REALS[data_type], data)[0]))
    if data_type == 0x09:
        text = data.rstrip(b"\0").decode("latin-1")
        return "".join(one if one.isprintable() else "?" for one in text).strip()
    return data.hex().upper()


def to_bytes(text: str, data_type: int | None, node_id: int) -> bytes | None:
    """The bytes of a value in a DCF; None: it has none, or none of this type. `node_id`: of $NODEID."""
    if data_type in INTEGER_BYTES:
        value = number(text)
        value = value + node_id if value is not None and adds_node_id(text) else value
        return None if value is None else _integer(value, INTEGER_BYTES[data_type], data_type in SIGNED)
    if not text:
        return None
    if data_type in REALS:
        return _real(text, REALS[data_type])
    if data_type == 0x09:
        return text.encode("latin-1", "replace")
    return octets(text)


def octets(text: str) -> bytes | None:
    """Hexadecimal bytes, with or without spaces and 0x; None: they are none."""
    try:
        return bytes.fromhex(text.strip().removeprefix("0x").removeprefix("0X")) or None
    except ValueError:
        return None


def _integer(value: int, size: int, signed: bool) -> bytes | None:
    """Bit patterns of negative numbers are taken too, as many files have them."""
    if not (-(1 << 8 * size - 1) if signed else 0) <= value < 1 << 8 * size:
        return None
    return (value & (1 << 8 * size) - 1).to_bytes(size, "little")


def _real(text: str, form: str) -> bytes | None:
    """A decimal number, or the bit pattern in hexadecimal."""
    pattern = number(text) if text.lower().startswith("0x") else None
    if pattern is not None:
        return _integer(pattern, struct.calcsize(form), signed=False)
    try:
        return struct.pack(form, float(text))
    except (ValueError, OverflowError):
        return None
