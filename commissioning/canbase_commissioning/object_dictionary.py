"""Objects as people write and read them: addresses, types, numbers, what some of them mean. CiA 301, CiA 402-2.

Types come from the manufacturer's EDS file, the drive's profile, or our own EDS of a CiA 402 drive, in this order.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from canbase_config.eds_file import Eds, EdsObject
from canbase_config.object_map import AXIS_OFFSET, place
from canbase_config.profile import SDO_SERVERS, Profile
from canbase_driver.cia301.emcy import emcy_text
from canbase_driver.cia402 import decode_statusword

_INTEGERS: Final = {f"{sign}{bits}": (sign == "i", bits // 8) for sign in "ui" for bits in (8, 16, 24, 32, 64)}
TYPES: Final = (*_INTEGERS, "f32", "str", "hex")
"""u8 … i64 integers, f32 a float (REAL32), str text, hex bytes as they are."""
_EDS_TYPES: Final = {
    0x01: "u8", 0x02: "i8", 0x03: "i16", 0x04: "i32", 0x05: "u8", 0x06: "u16", 0x07: "u32", 0x08: "f32", 0x09: "str",
    0x0A: "hex", 0x0F: "hex", 0x10: "i24", 0x15: "i64", 0x16: "u24", 0x1B: "u64",
}  # fmt: skip
"""CiA 301 data types."""
_ADDRESS: Final = re.compile(r"(?:0x)?([0-9a-f]{1,4})h?(?:(?::|sub)(0x[0-9a-f]{1,2}|[0-9a-f]{1,2}h|\d{1,3}))?", re.I)
_MODES: Final = {
    0: "none", 1: "profile position", 3: "profile velocity", 4: "torque", 6: "homing",
    8: "cyclic synchronous position", 9: "cyclic synchronous velocity", 10: "cyclic synchronous torque",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Address:
    """One object or sub-object."""

    index: int
    sub: int = 0

    def __str__(self) -> str:
        return f"{self.index:04X}h:{self.sub}"


@dataclass(frozen=True, slots=True)
class Known:
    """What is known about an object before it is read. `type` is one of TYPES; empty: unknown."""

    type: str = ""
    name: str = ""


def parse_address(text: str) -> Address:
    """`6041`, `0x6041`, `6041h`, each with `:SUB`. The index is always hexadecimal, SUB decimal or as 0x1 or 1h.

    Raises ValueError for anything else.
    """
    match = _ADDRESS.fullmatch(text.strip())
    if match is None:
        raise ValueError(f"{text!r} is no object: expected INDEX or INDEX:SUB, such as 6041, 0x1018:4 or 1018h:4")
    sub = _integer(match[2] or "0")
    if sub > 0xFF:
        raise ValueError(f"{text!r}: a sub-index is 0 to 255")
    return Address(int(match[1], 16), sub)


def known_object(at: Address, eds_files: Iterable[Eds], profile: Profile | None) -> Known:
    """The entry of the first EDS file that has it, or of the profile. `eds_files`: the vendor's first, then ours."""
    by_profile = _of_profile(at, profile) if profile else None
    found = [entry for entry in (_of_eds(at, eds) for eds in eds_files) if entry is not None]
    name = found[0].name if found else ""
    kind = by_profile or next((_EDS_TYPES[e.data_type] for e in found if e.data_type in _EDS_TYPES), "")
    return Known(kind, name)


def _of_eds(at: Address, eds: Eds) -> EdsObject | None:
    """Arrays and second axes that the file does not spell out are like their first."""
    for index in (at.index, at.index - AXIS_OFFSET if 0x6800 <= at.index < 0x7000 else at.index):
        found = eds.objects.get((index, at.sub))
        if found is not None:
            return found
    return eds.objects.get((at.index, 1)) if at.sub > 1 else None


def _of_profile(at: Address, profile: Profile) -> str | None:
    for write in (*profile.writes.before_mapping, *profile.writes.after_mapping):
        if (write.index, write.sub) == (at.index, at.sub):
            return f"u{write.bits}"
    watchdog = profile.self_stop.vendor_watchdog
    if watchdog is not None and (watchdog.index, watchdog.sub) == (at.index, at.sub):
        return f"u{watchdog.bits}"
    for measured in (profile.measures.voltage, profile.measures.current, profile.measures.temperature):
        if measured is not None and (measured.index, measured.sub) == (at.index, at.sub):
            return f"{'i' if measured.signed else 'u'}{measured.bits}"
    return _of_layout(at, profile)


_SIGNED: Final = frozenset((0x6007, 0x605A, 0x605E, 0x6060, 0x6061, 0x6064, 0x606C, 0x60FF))
_OF_AXIS: Final = (
    0x6007,
    0x6040,
    0x6041,
    0x605A,
    0x605E,
    0x6060,
    0x6061,
    0x6064,
    0x606C,
    0x6083,
    0x6084,
    0x6085,
    0x60FF,
)


def _of_layout(at: Address, profile: Profile) -> str | None:
    for axis in range(profile.layout.axes):
        for index in _OF_AXIS:
            found = place(profile, index, axis)
            if (found.index, found.sub) == (at.index, at.sub):
                return f"{'i' if index in _SIGNED else 'u'}{found.bits}"
    return None


def decode(data: bytes, kind: str) -> int | float | str:
    """The value in an answer. Without a type, or where the drive has another width, bytes decide: 1–4 are a number."""
    if kind == "f32" and len(data) == 4:
        return float(struct.unpack("<f", data)[0])
    if kind == "str":
        return data.decode("latin-1").rstrip("\0")
    if kind == "hex" or not 1 <= len(data) <= 8 or (not kind and len(data) > 4):
        return data.hex(" ").upper()
    return int.from_bytes(data, "little", signed=kind.startswith("i"))


def encode(text: str, kind: str) -> bytes:
    """The bytes for a value of a type. Raises ValueError when it does not fit, or is no such value."""
    if kind == "str":
        return text.encode("latin-1")
    if kind == "hex":
        return bytes.fromhex(text)
    if kind == "f32":
        return struct.pack("<f", float(text))
    signed, size = _INTEGERS[kind]
    value = _integer(text)
    low, high = (-(1 << 8 * size - 1), (1 << 8 * size - 1) - 1) if signed else (0, (1 << 8 * size) - 1)
    if not low <= value <= high:
        raise ValueError(f"{text} does not fit {kind}: {low} to {high}")
    return value.to_bytes(size, "little", signed=signed)


def _integer(text: str) -> int:
    digits = text.strip().replace("_", "")
    if re.fullmatch(r"[0-9a-f]+h", digits, re.IGNORECASE):
        return int(digits[:-1], 16)
    try:
        return int(digits, 16 if digits.lower().lstrip("+-").startswith("0x") else 10)
    except ValueError as error:
        raise ValueError(f"{text!r} is no number: expected 80, 0x50, 50h or -80") from error


def show(data: bytes, kind: str) -> str:
    """A value for people: hexadecimal, decimal and its type."""
    value = decode(data, kind)
    if not isinstance(value, int):
        return f'"{value}"' if kind == "str" else f"{value} ({kind or f'{len(data)} bytes'})"
    width = kind if kind in _INTEGERS and _INTEGERS[kind][1] == len(data) else f"{kind[:1] or 'u'}{8 * len(data)}"
    return f"0x{int.from_bytes(data, 'little'):0{2 * len(data)}X} = {value} ({width})"


def meaning(at: Address, data: bytes) -> str:
    """The meaning of the value in words; empty where the number is enough."""
    value = int.from_bytes(data[:8], "little")
    index = at.index - AXIS_OFFSET if 0x6800 <= at.index < 0x7000 else at.index
    if index == 0x6041:
        return ", ".join(_state(word) for word in statuswords(data))
    if index in (0x6060, 0x6061):
        return f"mode {_MODES.get(value, 'of the manufacturer')}"
    if index == 0x603F:
        return emcy_text(value & 0xFFFF)
    if index == 0x1016 and at.sub:
        return f"watches node {value >> 16 & 0x7F}, {value & 0xFFFF} ms" if value & 0xFFFF else "not used"
    if index in SDO_SERVERS and at.sub in (1, 2):
        way = "requests" if at.sub == 1 else "answers"
        return f"{'closed' if value >> 31 else 'open'}, {way} by {value & 0x7FF:03X}h"
    if (0x1400 <= index < 0x1600 or 0x1800 <= index < 0x1A00) and at.sub == 1:
        return f"{'off' if value >> 31 else 'on'}, COB-ID {value & 0x7FF:03X}h"
    if (0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00) and at.sub:
        return f"{value >> 16:04X}h:{value >> 8 & 0xFF}, {value & 0xFF} bits" if value else "empty"
    return ""


def statuswords(data: bytes) -> list[int]:
    """One or, where a drive packs them into 32 bits, two statuswords."""
    return [int.from_bytes(data[at : at + 2], "little") for at in range(0, min(len(data), 4), 2)]


def _state(word: int) -> str:
    state = decode_statusword(word)
    return "unknown state" if state is None else state.text


ABORT_ADVICE: Final[Mapping[int, str]] = {
    0x0602_0000: "the drive has no such object: its EDS or manual lists what it has",
    0x0609_0011: "the object has fewer sub-indexes: read sub 0 for their number",
    0x0601_0002: "it can only be read",
    0x0601_0001: "it can only be written",
    0x0607_0010: "another width: try --type, or read it first",
    0x0607_0012: "another width: try a shorter --type",
    0x0607_0013: "another width: try a longer --type",
    0x0601_0000: "a PDO must be off (COB-ID bit 31) and its sub 0 be 0 before it is mapped",
    0x0609_0030: "the manual has the values that it takes",
    0x0800_0022: "not in this state: disable the drive, or NMT pre-operational first",
    0x0800_0021: "another master has control: the manufacturer's tool, or local mode",
}
"""What to try, by SDO abort code."""
