"""The frames of an LSS master (CiA 305 version 3). Requests are 7E5h, answers 7E4h, eight bytes each.

The package `canopen` has an LSS master of its own; why it is not used: docs/decisions/0099.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from canbase_config.robot import LSS_REQUEST
from canbase_driver.cia301.frame import Frame

REQUEST: Final = LSS_REQUEST
ANSWER: Final = 0x7E4
UNCONFIGURED: Final = 255
"""Node id of a drive that has none. It answers LSS alone; fastscan finds only such drives."""

SELECTED, IDENTIFIED = 0x44, 0x4F
"""Answers: to the selection of one drive, and to fastscan. All drives give the same bits."""
SET_NODE_ID, SET_BIT_TIMING, STORE = 0x11, 0x13, 0x17
_SWITCH, _SELECT, _ACTIVATE, _FASTSCAN, _INQUIRE = 0x04, 0x40, 0x15, 0x51, 0x59
_ALL_AGAIN: Final = 0x80
INQUIRED = MappingProxyType({sub: _INQUIRE + sub for sub in range(1, 5)})
"""Command of the inquiry by sub-index of 1018h; the answer has the same."""
BIT_TIMINGS: Mapping[int, int] = MappingProxyType(
    {1_000_000: 0, 800_000: 1, 500_000: 2, 250_000: 3, 125_000: 4, 50_000: 6, 20_000: 7, 10_000: 8}
)
"""Table index (CiA 301) of each bit rate [bit/s]; 5 is reserved."""
_REFUSALS: Mapping[tuple[int, int], str] = MappingProxyType(
    {
        (SET_NODE_ID, 1): "it does not take this node id (are its switches in use?)",
        (SET_BIT_TIMING, 1): "it does not support this bit rate",
        (STORE, 1): "it cannot store settings of LSS",
        (STORE, 2): "its memory cannot be written",
    }
)


@dataclass(frozen=True, slots=True, order=True)
class Identity:
    """1018h of one drive: no two drives have the same (CiA 301), if their maker numbers them."""

    vendor_id: int
    product_code: int
    revision: int
    serial: int

    @property
    def parts(self) -> tuple[int, int, int, int]:
        """In the order of the sub-indexes."""
        return self.vendor_id, self.product_code, self.revision, self.serial

    def __str__(self) -> str:
        return f"serial {self.serial:X}h ({self.vendor_id:X}:{self.product_code:X}:{self.revision:X})"


def _frame(command: int, *rest: int) -> Frame:
    return Frame(REQUEST, bytes((command, *rest)).ljust(8, b"\0"))


def switch_all(*, configuration: bool) -> Frame:
    """Every drive to LSS configuration, or back to waiting. No answer."""
    return _frame(_SWITCH, int(configuration))


def select(identity: Identity) -> tuple[Frame, ...]:
    """The one drive in LSS waiting with this identity to LSS configuration; it answers SELECTED."""
    return tuple(_frame(_SELECT + i, *part.to_bytes(4, "little")) for i, part in enumerate(identity.parts))


def set_node_id(node_id: int) -> Frame:
    """The next node id, 1 to 127 or UNCONFIGURED; it counts after NMT reset communication."""
    return _frame(SET_NODE_ID, node_id)


def set_bit_rate(bitrate: int) -> Frame:
    """The next bit rate [bit/s], one of BIT_TIMINGS; it counts after `activate`."""
    return _frame(SET_BIT_TIMING, 0, BIT_TIMINGS[bitrate])


def activate(delay_s: float) -> Frame:
    """All drives in LSS configuration change their bit rate after `delay_s`, and send after twice that. No answer."""
    return _frame(_ACTIVATE, *round(delay_s * 1000).to_bytes(2, "little"))


def store() -> Frame:
    """Next node id and next bit rate survive power off."""
    return _frame(STORE)


def inquire(sub: int) -> Frame:
    """One sub-index, 1 to 4, of 1018h of the drive in LSS configuration."""
    return _frame(_INQUIRE + sub)


def scan_again() -> Frame:
    """Fastscan from the start: every drive without a node id answers IDENTIFIED."""
    return _frame(_FASTSCAN, 0, 0, 0, 0, _ALL_AGAIN)


def scan(number: int, bit: int, part: int, following: int) -> Frame:
    """Who has the bits of `number` from `bit` (0 to 31) upward in `part` (0 to 3) of the identity answers IDENTIFIED.

    `following`: the part that is scanned next. With `bit` 0, `part` 3 and `following` 0 the drive that answers enters
    LSS configuration.
    """
    return _frame(_FASTSCAN, *number.to_bytes(4, "little"), bit, part, following)


def is_answer(command: int) -> Callable[[Frame], bool]:
    """Accepts the answers of drives that begin with this command."""
    return lambda frame: frame.cob_id == ANSWER and len(frame.data) == 8 and frame.data[0] == command


def refusal(answer: Frame) -> str:
    """Why a drive refused SET_NODE_ID, SET_BIT_TIMING or STORE; empty: it did not."""
    command, code, detail = answer.data[:3]
    if code == 0:
        return ""
    of_maker = f"its manufacturer's error {detail}" if code == UNCONFIGURED else f"error {code}"
    return _REFUSALS.get((command, code), of_maker)
