"""What the boot of a node is made of: its steps, its errors, and the ways to write an object and be sure of it.

The sequence itself is `sequence.py`, the PDOs `pdo_mapping.py`; `node_boot.py` puts the steps on the bus.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any, TypeVar

from canbase_config.profile import Presence
from canbase_driver.boot.advice import OTHER_STATE, hint, in_digits, may_pass, see, without
from canbase_driver.cia301.nmt import NmtCommand
from canbase_driver.cia301.sdo_client import (
    ACCESS_UNSUPPORTED,
    DEVICE_STATE,
    NO_OBJECT,
    NO_SUB_INDEX,
    READ_ONLY,
    WRITE_ONLY,
    Read,
    SdoAborted,
    SdoError,
    Write,
)


@dataclass(frozen=True, slots=True)
class SendNmt:
    """An NMT command to the node. It brings no answer."""

    command: NmtCommand


@dataclass(frozen=True, slots=True)
class WaitBootUp:
    """Wait for the node's boot-up message. The answer is whether it came within `timeout_s`."""

    timeout_s: float


@dataclass(frozen=True, slots=True)
class Pause:
    """Wait `duration_s`; `until` names the reason. It brings no answer."""

    duration_s: float
    until: str


@dataclass(frozen=True, slots=True)
class Quiet:
    """Wait until there was no boot-up message for `duration_s`. It brings no answer."""

    duration_s: float


@dataclass(frozen=True, slots=True)
class BootTimes:
    """What earlier boots of a node have shown, where its profile has less."""

    settle_s: float = 0.0
    """Quiet after a boot-up message [s], in which a second one may come (start.settle_s)."""
    boot_up_s: float = 0.0
    """From an NMT reset to its boot-up message [s] (start.boot_up_s)."""


NO_BOOT_TIMES = BootTimes()


Step = Read | Write | SendNmt | WaitBootUp | Pause | Quiet
T = TypeVar("T")
Steps = Generator[Step, Any, T]
"""Yields steps; is sent the answer of each (bytes of a Read, b"" of a Write), or thrown SdoAborted or SdoTimeout."""


MODE_POLL_S, MODE_POLLS = 0.1, 60
"""A drive whose profile says that it shows its mode without power has 6 s for it."""


class BootError(Exception):
    """A node cannot be made ready. The text names the object, the reason and what to try."""

    def __init__(self, node_id: int, problem: str, hint: str, *, may_pass: bool = False) -> None:
        """`may_pass`: a drive that still starts does this too, and no longer when it has started."""
        super().__init__(f"node {node_id}: {problem}. {hint}.")
        self.node_id = node_id
        self.problem = problem
        self.hint = hint
        self.may_pass = may_pass

    @classmethod
    def refused(cls, node_id: int, problem: str, code: int, hint: str) -> BootError:
        """The drive aborted with this code. `hint`: what to try, unless it is the drive's state that forbids it."""
        of_state = code == DEVICE_STATE
        return cls(node_id, problem, OTHER_STATE if of_state else hint, may_pass=of_state)


def boot_error(error: SdoError) -> BootError:
    """The message for the person at the machine about a transfer that failed after all its tries."""
    problem = f"{error.index:04X}h:{error.sub}: {error.text}"
    return BootError(error.node_id, problem, hint(error), may_pass=may_pass(error))


class NodeAccess:
    """Objects of one node. `notes`: what was lacking or refused; `changes`: what was written, with the old value."""

    def __init__(self, node_id: int) -> None:
        self.node_id = node_id
        self.notes: list[str] = []
        self.changes: list[str] = []
        self.unshown_mode = ""
        """6061h showed another mode than was set; empty: it did not."""
        self.mode_polls = 1
        """How often 6061h is read until it shows the mode."""
        self.was_reset = False
        """Its objects 1000h to 1FFFh have the values of power-on (CiA 301): no earlier master's are left to look at."""

    def read_if_present(self, index: int, sub: int = 0) -> Steps[int | None]:
        """An unsigned number; None when the drive lacks the object, or refuses it with whatever abort code.

        Many drives abort with 0800 0000h (general error) for what they do not have. Any code but "does not exist" is
        noted.
        """
        try:
            return unsigned((yield Read(index, sub)))
        except SdoAborted as refused:
            if refused.code not in (NO_OBJECT, NO_SUB_INDEX):
                self.notes.append(f"{index:04X}h:{sub} cannot be read: {refused.text}{see(index, sub)}")
            return None

    def set(
        self, step: Write, known: int | None = None, *, unread: bool = False, shown_at: Read | None = None
    ) -> Steps[None]:
        """Write where it differs, and read back. A read-only object may pass when it has the value.

        `known`: the present value, unsigned, where it was read just now. `unread`: after a reset, write at once what no
        drive has by itself. `shown_at`: where the drive shows what it has taken. Raises BootError when another value is
        read back.
        """
        if unread and self.was_reset:
            yield from self.overwrite(step, "?")
            return
        before = (yield from self._compare_present(step)) if known is None else _as_bytes(known, step.size)
        if before is None or not _same(before, step.data):
            yield from self.overwrite(step, _hex(before) if before else "?", shown_at)
        elif shown_at is not None:
            yield from self._shows(shown_at, step)

    def overwrite(
        self, step: Write, before: str, shown_at: Read | None = None, *, read_back: bool = True
    ) -> Steps[None]:
        """Write what is known to differ from `before`, and read back, unless it shows elsewhere. Raises BootError when
        another value is read."""
        refusal = yield from self._write(step)
        is_shown = shown_at is not None and (yield from self._shows(shown_at, step))
        needs_no_look = is_shown or not (read_back or refusal)
        actual = None if needs_no_look else (yield from self._read(step))
        if actual is not None and not _same(actual, step.data):
            problem = f"{step} is {_hex(actual)}, expected {_hex(step.data)}{refusal}"
            other = "find what else sets it: another master, an input, a program in the drive"
            raise BootError(self.node_id, problem, f"Set {in_digits(step)} with the manufacturer's tool, or {other}")
        self.note_change(step, before)

    def _shows(self, shown_at: Read, step: Write) -> Steps[bool]:
        """Whether another object shows the mode that was written, at once or, where the profile says so, later."""
        for polls_left in reversed(range(self.mode_polls)):
            mode = yield from self.read_if_present(shown_at.index, shown_at.sub)
            if mode is None or mode == unsigned(step.data):
                return mode is not None
            if polls_left:
                yield Pause(MODE_POLL_S, f"mode {step.value!r} in {shown_at}, which shows {mode}")
        waited_s = (self.mode_polls - 1) * MODE_POLL_S
        why = (
            f" {waited_s:.0f} s ago: look what else sets it, the manufacturer's tool or an input"
            if waited_s
            else "; it may take power to change, or time: with `options.mode_display: yes` in its drive profile the "
            "boot waits for it"
        )
        self.unshown_mode = f"{shown_at} shows mode {mode}, {step.value!r} was set{why}"
        self.notes.append(self.unshown_mode)
        return False

    def note_change(self, step: Write, before: str) -> None:
        """It was written, in place of `before`. A PDO that was off meanwhile has not changed."""
        if before != _hex(step.data):
            self.changes.append(f"{step}: {before} → {_hex(step.data)}")

    def set_if_present(
        self, step: Write, presence: Presence = "probe", known: int | None = None, *, unread: bool = False
    ) -> Steps[bool]:
        """Like `set`, but a drive that lacks, refuses or changes the value only earns a note. Whether it took it.

        `presence`: from the profile; an object that it denies is not tried.
        """
        if presence == "no":
            return False
        try:
            yield from self.set(step, known, unread=unread)
        except SdoAborted as refused:
            lacks_it = refused.code in (NO_OBJECT, NO_SUB_INDEX)
            self.notes.append(f"{step}: {refused.text}{without(step, lacks_it=lacks_it)}")
            return False
        except BootError as other:
            self.notes.append(f"{other.problem}{without(step)}")
            return False
        return True

    def tries(self, step: Write) -> Steps[bool]:
        """Write, and see whether the drive takes it: one of several that may be right. A refusal is no news."""
        try:
            yield step
        except SdoAborted:
            return False
        self.note_change(step, "?")
        return True

    def try_to_write(self, step: Write, known: int) -> Steps[None]:
        """Write where it differs from `known`, what is read again later or matters little; a refusal earns a note."""
        before = _as_bytes(known, step.size)
        if _same(before, step.data):
            return
        try:
            yield step
        except SdoAborted as refused:
            self.notes.append(f"{step}: {refused.text}")
        else:
            self.note_change(step, _hex(before))

    def _write(self, step: Write) -> Steps[str]:
        """Empty, or why a read-only object refused."""
        try:
            yield step
        except SdoAborted as refused:
            if refused.code not in (READ_ONLY, ACCESS_UNSUPPORTED):
                raise
            return f" ({refused.text})"
        return ""

    def _compare_present(self, step: Write) -> Steps[bytes | None]:
        """As `_read`. What cannot be read for now is written all the same, and the refusal stays one."""
        try:
            return (yield from self._read(step))
        except SdoAborted as refused:
            if refused.code not in (NO_OBJECT, NO_SUB_INDEX) and (yield from self.tries(step)):
                self.notes.append(f"{step} is written, and cannot be read back")
            raise

    def _read(self, step: Write) -> Steps[bytes | None]:
        """None: the object can only be written."""
        try:
            data: bytes = yield Read(step.index, step.sub)
        except SdoAborted as refused:
            if refused.code != WRITE_ONLY:
                raise
            return None
        return data


def _same(actual: bytes, wanted: bytes) -> bool:
    """The same number, of whatever width the drive has it."""
    width = min(len(actual), len(wanted))
    rest = actual[width:] + wanted[width:]
    return width > 0 and actual[:width] == wanted[:width] and rest.strip(b"\0") in (b"", b"\xff" * len(rest))


def unsigned(data: bytes) -> int:
    """The number in an answer."""
    return int.from_bytes(data, "little")


def _as_bytes(number: int, size: int) -> bytes:
    """In `size` bytes, or in more where a drive has sent more."""
    return number.to_bytes(max(size, (number.bit_length() + 7) // 8), "little")


def _hex(data: bytes) -> str:
    return f"{unsigned(data):0{2 * len(data)}X}h"
