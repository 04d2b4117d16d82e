"""1010h and 1011h: the drive keeps its present parameters over a power cycle, or gets its defaults back. CiA 301."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.parameters.guard import why_not_now
from canbase_driver.boot.steps import Steps, unsigned
from canbase_driver.cia301.sdo_client import Read, SdoAborted, Write, abort_text


class Order(Enum):
    """Index and signature."""

    STORE = (0x1010, b"save")
    DEFAULTS = (0x1011, b"load")

    @property
    def index(self) -> int:
        """Of the object."""
        return self.value[0]

    @property
    def signature(self) -> bytes:
        """What has to be written to it."""
        return self.value[1]


GROUPS = {"all": 1, "communication": 2, "application": 3}
"""Sub-index of 1010h and 1011h: all parameters, 1000h to 1FFFh, 6000h to 9FFFh (CiA 301)."""


@dataclass(frozen=True, slots=True)
class Stored:
    """`refused`: why the drive did not; empty: it did."""

    refused: str = ""


def order(what: Order, group: str, status_at: Sequence[Address], *, without_statusword: bool) -> Steps[Stored]:
    """Gives the order to a drive whose motors have no power. Raises SdoTimeout: a drive may take seconds to store."""
    sub = GROUPS[group]
    why = yield from why_not_now(status_at, without_statusword=without_statusword)
    why = why or (yield from _why_not(what, sub))
    if why:
        return Stored(why)
    try:
        yield Write(what.index, sub, what.signature)
    except SdoAborted as refused:
        return Stored(f"{what.index:04X}h:{sub}: {abort_text(refused.code)}")
    return Stored()


def _why_not(what: Order, sub: int) -> Steps[str]:
    """The object shows whether it takes the order: bit 0 of 1010h and 1011h (CiA 301)."""
    at = f"{what.index:04X}h:{sub}"
    try:
        data: bytes = yield Read(what.index, sub)
    except SdoAborted as refused:
        return f"{at}: {abort_text(refused.code)}. The drive's manual has how it stores parameters"
    if unsigned(data) & 1:
        return ""
    by_itself = what is Order.STORE and unsigned(data) & 2
    return f"{at} is {unsigned(data):X}h: " + (
        "the drive stores by itself, and takes no order" if by_itself else "the drive does not take this order now"
    )
