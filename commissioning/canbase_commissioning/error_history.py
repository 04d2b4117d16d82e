"""The errors that a drive remembers (1003h), and those that it has now (1001h, 603Fh), in words. CiA 301, CiA 402-2."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from canbase_commissioning.object_dictionary import Address
from canbase_config.object_map import AXIS_OFFSET
from canbase_driver.boot.steps import Steps, unsigned
from canbase_driver.cia301.emcy import emcy_text
from canbase_driver.cia301.sdo_client import NO_OBJECT, Read, SdoAborted, Write, abort_text

ERROR_REGISTER, HISTORY, ERROR_CODE = 0x1001, 0x1003, 0x603F
MOST_ENTRIES: Final = 254
REGISTER_BITS: Final = (
    "generic", "current", "voltage", "temperature", "communication", "device profile", "reserved", "manufacturer",
)  # fmt: skip
"""Bits of 1001h, the lowest first (CiA 301)."""


@dataclass(frozen=True, slots=True)
class ErrorHistory:
    """`entries`: of 1003h, the newest first; None: the drive keeps none, `why` has the reason.

    `codes`: 603Fh by its address, where the drive has it; `register`: 1001h; None: it cannot be read.
    """

    entries: tuple[int, ...] | None
    why: str
    register: int | None
    codes: Mapping[Address, int]

    def lines(self, makers: Mapping[int, str]) -> list[str]:
        """For a person. `makers`: the manufacturer's own codes in words."""
        now = "unknown (1001h cannot be read)" if self.register is None else register_text(self.register)
        lines = [f"error register 1001h: {now}"]
        lines += [f"{at}: {_code(code, makers)}" for at, code in self.codes.items() if code]
        if self.entries is None:
            return [*lines, f"it keeps no history: {self.why}"]
        lines += [f"{len(self.entries)} errors in the history 1003h{', the newest first' if self.entries else ''}"]
        return [*lines, *(f"{sub:3} {_entry(entry, makers)}" for sub, entry in enumerate(self.entries, start=1))]


def read_history() -> Steps[ErrorHistory]:
    """Reads what the drive has of these objects."""
    register = yield from _number(Read(ERROR_REGISTER))
    codes = {}
    for index in (ERROR_CODE, ERROR_CODE + AXIS_OFFSET):
        code = yield from _number(Read(index))
        if not isinstance(code, str):
            codes[Address(index)] = code & 0xFFFF
    count = yield from _number(Read(HISTORY))
    known = None if isinstance(register, str) else register
    if isinstance(count, str):
        return ErrorHistory(None, count, known, codes)
    entries: list[int] = []
    for sub in range(1, min(count, MOST_ENTRIES) + 1):
        entry = yield from _number(Read(HISTORY, sub))
        if isinstance(entry, str):
            break
        entries.append(entry)
    return ErrorHistory(tuple(entries), "", known, codes)


def clear_history() -> Steps[str]:
    """Why it was not cleared; empty: it was, and is read back empty."""
    try:
        yield Write(HISTORY, 0, 0, 1)
    except SdoAborted as refused:
        return abort_text(refused.code)
    left = yield from _number(Read(HISTORY))
    return "" if left == 0 else f"it still has {left} errors: they hold, or came at once again"


def register_text(register: int) -> str:
    """1001h in words."""
    found = [name for bit, name in enumerate(REGISTER_BITS) if register >> bit & 1]
    return f"{register:02X}h ({', '.join(found) or 'no error'})"


def _number(step: Read) -> Steps[int | str]:
    try:
        data: bytes = yield step
    except SdoAborted as refused:
        return f"{step}: {abort_text(refused.code)}" if refused.code != NO_OBJECT else f"it has no {step.index:04X}h"
    return unsigned(data[:4])


def _code(code: int, makers: Mapping[int, str]) -> str:
    return f"{code:04X}h {emcy_text(code, makers)}"


def _entry(entry: int, makers: Mapping[int, str]) -> str:
    """Code in the lower half, the manufacturer's information in the upper one (CiA 301, 1003h)."""
    more = f", manufacturer's field {entry >> 16:04X}h" if entry >> 16 else ""
    return f"{_code(entry & 0xFFFF, makers)}{more}"
