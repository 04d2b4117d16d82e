"""Frames in a support bundle: whole where CANopen says what they hold, without data where they can hold text. Pure.

A drive's name, its comment or a password in an object goes over SDO: in segments and blocks, or in four bytes at once.
"""

from __future__ import annotations

import re
from typing import Final

OBJECTS: Final = (
    range(0x1000, 0x1008), range(0x100C, 0x1018), range(0x1019, 0x1020), range(0x1029, 0x102A), range(0x1200, 0x1300),
    range(0x1400, 0x1C00), range(0x6000, 0x6100), range(0x6800, 0x6900),
)  # fmt: skip
"""Numbers of CiA 301 and CiA 402; 1008h to 100Ah are texts, objects of the manufacturer can be passwords."""
_PLAIN: Final = (range(0x001), range(0x080, 0x580), range(0x701, 0x780))
"""NMT, SYNC, EMCY, PDOs, heartbeats."""
_READ, _ABORT = 0x40, 0x80
_WRITE: Final = frozenset((0x22, 0x23, 0x27, 0x2B, 0x2F))
_ANSWER: Final = frozenset((0x42, 0x43, 0x47, 0x4B, 0x4F, 0x60))
_BEGINS: Final = _WRITE | _ANSWER | {0x21, 0x40, 0x41}
_FRAME: Final = re.compile(
    r"(?P<head>[ \t]*\d+\.\d+[ \t]+\d+[ \t]+)(?P<id>[0-9A-Fa-f]{1,3})(?P<way>[ \t]+[RT]x[ \t]+d )"
    r"(?P<length>[0-8])(?P<data>(?: [0-9A-Fa-f]{2})*) ?"
)
_DATE: Final = r"[A-Z][a-z]{2} [A-Z][a-z]{2} [ \d]{1,2} [\d:.]+ (?:[ap]m )?\d{4}"
_HEAD: Final = re.compile(
    rf"date {_DATE}|Begin Triggerblock {_DATE}|base hex  timestamps absolute|(?:no )?internal events logged|"
    r"[ \t]*\d+\.\d+ Start of measurement|End TriggerBlock"
)
_NOTE: Final = re.compile(r"(?P<head>(?:[ \t]*\d+\.\d+ )?// (?:\d+\.\d+ )?)(?P<text>.*)")


class Frames:
    """The frames of one file, in their order."""

    def __init__(self) -> None:
        self._unclear: dict[int, bool] = {}
        """By node: what it sends may be a part of a block. So at the beginning, until a request begins a transfer."""

    def shown(self, cob_id: int, data: bytes) -> bytes:
        """The data, with zeros in place of what is left out."""
        if any(cob_id in ids for ids in _PLAIN):
            return data
        if not (0x581 <= cob_id <= 0x5FF or 0x601 <= cob_id <= 0x67F) or len(data) != 8:
            return bytes(len(data))
        return data[: self._clear(cob_id & 0x7F, data, from_client=cob_id > 0x600)].ljust(8, b"\0")

    def _clear(self, node: int, data: bytes, *, from_client: bool) -> int:
        """How many bytes of an SDO frame are no text: all of a number of an object in OBJECTS, or of an abort."""
        command, listed = data[0], any(int.from_bytes(data[1:3], "little") in objects for objects in OBJECTS)
        if command >> 5 in (5, 6):  # of a block transfer
            self._unclear[node] = True
        elif from_client and listed and (command in _WRITE or (command == _READ and not any(data[4:]))):
            self._unclear[node] = False
        if self._unclear.get(node, True):
            return 1
        if command == _ABORT or (listed and command in _BEGINS):
            return 8
        return 4 if command in _BEGINS else 1


def asc_line(line: str, frames: Frames) -> tuple[str, str]:
    """A line of an ASC file as canbase writes it: what is shown of it, and a note, which is free text."""
    if found := _FRAME.fullmatch(line):
        data = bytes.fromhex(found["data"])
        shown = frames.shown(int(found["id"], 16), data)
        return f"{found['head']}{found['id']}{found['way']}{found['length']} {shown.hex(' ').upper()}", ""
    if _HEAD.fullmatch(line):
        return line, ""
    if note := _NOTE.fullmatch(line):
        return note["head"], note["text"]
    return "", ""
