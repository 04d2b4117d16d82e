"""What the boot of a node is made of: its steps, its errors, and the ways to write an object and be sure of it.

The sequence itself is `boot.py`, the PDOs `boot_pdo.py`; `node_boot.py` puts the steps on the bus.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any, TypeVar

from canbase_config.profile import Presence
from canbase_driver.cia301 import NmtCommand
from canbase_driver.sdo import (
    ACCESS_UNSUPPORTED,
    DEVICE_STATE,
    NO_OBJECT,
    NO_SUB_INDEX,
    READ_ONLY,
    WRITE_ONLY,
    Read,
    SdoAborted,
    SdoError,
    SdoTimeout,
    Write,
)


@dataclass(frozen=True, slots=True)
class SendNmt:
    """An NMT command to the node. It brings no answer."""

    command: NmtCommand


@dataclass(frozen=True, slots=True)
class WaitBootUp:
    """Wait for the node's boot-up message. The answer tells whether it came within `timeout_s`."""

    timeout_s: float


@dataclass(frozen=True, slots=True)
class Pause:
    """Wait `duration_s`; `until` says what for. It brings no answer."""

    duration_s: float
    until: str


@dataclass(frozen=True, slots=True)
class Quiet:
    """Wait until there was no boot-up message for `duration_s`. It brings no answer."""

    duration_s: float


Step = Read | Write | SendNmt | WaitBootUp | Pause | Quiet
T = TypeVar("T")
Steps = Generator[Step, Any, T]
"""Yields steps; is sent the answer of each (bytes of a Read, b"" of a Write), or thrown SdoAborted or SdoTimeout."""


class BootError(Exception):
    """A node cannot be made ready. The text names the object, the reason and what to try."""

    def __init__(self, node_id: int, problem: str, hint: str) -> None:
        super().__init__(f"node {node_id}: {problem}. {hint}.")
        self.node_id = node_id
        self.problem = problem
        self.hint = hint


def boot_error(error: SdoError) -> BootError:
    """What a transfer that failed for good means to the person at the machine."""
    return BootError(error.node_id, f"{error.index:04X}h:{error.sub}: {error.text}", _hint(error))


def _hint(error: SdoError) -> str:
    if isinstance(error, SdoTimeout):
        return "Check power, cable and bit rate, and that no other program uses the SDO channel of this node"
    if error.index in (0x6060, 0x6860):
        return "The drive must support `mode` of robot.yaml, see 6502h: bit 2 is mode 3, bit 8 is mode 9"
    if isinstance(error, SdoAborted) and error.code == DEVICE_STATE:
        return "Switch the drive off and on again, and let no other master control it"
    return "canbase needs this object as docs/bus.md has it; look it up in the manual of the drive"


class NodeAccess:
    """Objects of one node. `notes`: what was lacking or refused; `changes`: what was written, with the old value."""

    def __init__(self, node_id: int) -> None:
        self.node_id = node_id
        self.notes: list[str] = []
        self.changes: list[str] = []

    def read_if_present(self, index: int, sub: int = 0) -> Steps[int | None]:
        """An unsigned number; None when the drive lacks the object."""
        try:
            return unsigned((yield Read(index, sub)))
        except SdoAborted as refused:
            if refused.code in (NO_OBJECT, NO_SUB_INDEX):
                return None
            raise

    def set(self, step: Write, known: int | None = None) -> Steps[None]:
        """Write where it differs, and read back. A read-only object may pass when it has the value.

        `known`: the present value, unsigned, where it was read just now. Raises BootError when another value is read
        back.
        """
        before = (yield from self._read(step)) if known is None else _as_bytes(known, step.size)
        if before is None or not _same(before, step.data):
            yield from self.overwrite(step, _hex(before) if before else "?")

    def overwrite(self, step: Write, before: str) -> Steps[None]:
        """Write what is known to differ from `before`, and read back. Raises BootError when another value is read."""
        refusal = yield from self._write(step)
        found = yield from self._read(step)
        if found is not None and not _same(found, step.data):
            problem = f"{step} is {_hex(found)}, expected {_hex(step.data)}{refusal}"
            raise BootError(self.node_id, problem, "Set it with the maker's tool, or look for what sets it otherwise")
        self.changes.append(f"{step}: {before} → {_hex(step.data)}")

    def set_if_present(self, step: Write, presence: Presence = "probe", known: int | None = None) -> Steps[bool]:
        """Like `set`, but a drive that lacks, refuses or changes the value only earns a note. Whether it took it.

        `presence`: what the profile says; an object that it denies is not tried.
        """
        if presence == "no":
            return False
        try:
            yield from self.set(step, known)
        except SdoAborted as refused:
            self.notes.append(f"{step}: {refused.text}")
            return False
        except BootError as other:
            self.notes.append(other.problem)
            return False
        return True

    def _write(self, step: Write) -> Steps[str]:
        """Empty, or why a read-only object refused."""
        try:
            yield step
        except SdoAborted as refused:
            if refused.code not in (READ_ONLY, ACCESS_UNSUPPORTED):
                raise
            return f" ({refused.text})"
        return ""

    def _read(self, step: Write) -> Steps[bytes | None]:
        """None: the object can only be written."""
        try:
            found: bytes = yield Read(step.index, step.sub)
        except SdoAborted as refused:
            if refused.code != WRITE_ONLY:
                raise
            return None
        return found


def _same(found: bytes, wanted: bytes) -> bool:
    """The same number, of whatever width the drive has it."""
    width = min(len(found), len(wanted))
    rest = found[width:] + wanted[width:]
    return width > 0 and found[:width] == wanted[:width] and rest.strip(b"\0") in (b"", b"\xff" * len(rest))


def unsigned(data: bytes) -> int:
    """The number in an answer."""
    return int.from_bytes(data, "little")


def _as_bytes(number: int, size: int) -> bytes:
    """In `size` bytes, or in more where a drive has sent more."""
    return number.to_bytes(max(size, (number.bit_length() + 7) // 8), "little")


def _hex(data: bytes) -> str:
    return f"{unsigned(data):0{2 * len(data)}X}h"
