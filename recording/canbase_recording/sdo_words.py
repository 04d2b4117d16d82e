"""SDO transfers as a listener sees them: request and answer in words, what they have written or read. CiA 301. Pure.

One channel a node, 600h + id and 580h + id. Values of more than four bytes are named, not assembled.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from canbase_commissioning.object_dictionary import Address, Known, meaning, show
from canbase_driver.cia301.sdo_client import abort_text

_CLIENT: Final = {
    0: "sends a segment", 3: "requests the next segment", 5: "block upload", 6: "block download",
}  # fmt: skip
_SERVER: Final = {
    0: "sends a segment", 1: "confirms a segment", 5: "block download", 6: "block upload",
}  # fmt: skip
_WRITE, _READ, _ABORT = 1, 2, 4
"""Client command specifiers: initiate download, initiate upload; abort, of both sides."""
_READ_ANSWER, _WRITE_ANSWER = 2, 3
"""Server command specifiers."""


@dataclass(frozen=True, slots=True)
class SdoRequest:
    """A transfer that a client has begun. `data`: what it writes at once, empty otherwise."""

    at: Address
    is_write: bool
    data: bytes = b""


@dataclass(frozen=True, slots=True)
class SdoDone:
    """A transfer that ended. `abort`: its code, 0: none; `data`: what was written or read, empty where it is long."""

    node_id: int
    at: Address
    is_write: bool
    data: bytes
    abort: int = 0


class SdoChannels:
    """The transfer under way with each node."""

    def __init__(self) -> None:
        self._open: dict[int, SdoRequest] = {}

    def on_request(self, node_id: int, data: bytes) -> SdoDone | None:
        """A frame 600h + id. An abort by the client ends a transfer."""
        request = sdo_request(data)
        if request is not None:
            self._open[node_id] = request
            return None
        return self._abort(node_id, data) if _specifier(data) == _ABORT else None

    def on_answer(self, node_id: int, data: bytes) -> SdoDone | None:
        """A frame 580h + id. None: the transfer goes on, or belongs to none that was seen."""
        specifier = _specifier(data)
        if specifier == _ABORT:
            return self._abort(node_id, data)
        request = self._open.get(node_id)
        if request is None or specifier not in (_READ_ANSWER, _WRITE_ANSWER) or _address(data) != request.at:
            return None
        del self._open[node_id]
        return SdoDone(node_id, request.at, request.is_write, request.data if request.is_write else _expedited(data))

    def _abort(self, node_id: int, data: bytes) -> SdoDone | None:
        if len(data) != 8:
            return None
        request = self._open.pop(node_id, None)
        at = _address(data)
        code = int.from_bytes(data[4:], "little")
        return SdoDone(node_id, at, request.is_write if request else False, b"", code or 1)


def sdo_request(data: bytes) -> SdoRequest | None:
    """The begin of a transfer in a frame 600h + id; None: it is something else."""
    specifier = _specifier(data)
    if len(data) != 8 or specifier not in (_WRITE, _READ):
        return None
    is_write = specifier == _WRITE
    return SdoRequest(_address(data), is_write, _expedited(data) if is_write else b"")


def sdo_words(data: bytes, known: Known, *, by_client: bool) -> str:
    """One SDO frame in words. `known`: name and type of the object that `sdo_address` gives."""
    specifier = _specifier(data)
    if len(data) != 8:
        return f"SDO frame of {len(data)} bytes, expected 8"
    name = f"{_address(data)}{f' {known.name}' if known.name else ''}"
    if specifier == _ABORT:
        return f"SDO abort {name}: {abort_text(int.from_bytes(data[4:], 'little'))}"
    writes, reads = (_WRITE, _READ) if by_client else (_WRITE_ANSWER, _READ_ANSWER)
    if specifier == writes:
        if not by_client:
            return f"SDO written {name}"
        return f"SDO write {name}{_value(data, known)}"
    if specifier == reads:
        return f"SDO read {name}" if by_client else f"SDO answer {name}{_value(data, known)}"
    return f"SDO {(_CLIENT if by_client else _SERVER).get(specifier, 'command that CiA 301 does not have')}"


def sdo_address(data: bytes, *, by_client: bool) -> Address | None:
    """The object that an SDO frame names; None: segments and blocks name none."""
    named = (_WRITE, _READ, _ABORT) if by_client else (_WRITE_ANSWER, _READ_ANSWER, _ABORT)
    return _address(data) if len(data) == 8 and _specifier(data) in named else None


def _value(data: bytes, known: Known) -> str:
    value = _expedited(data)
    if not value:
        return f", {int.from_bytes(data[4:], 'little')} bytes in segments" if data[0] & 1 else ", in segments"
    words = meaning(_address(data), value)
    return f" = {show(value, known.type)}{f': {words}' if words else ''}"


def _specifier(data: bytes) -> int:
    return data[0] >> 5 if data else -1


def _address(data: bytes) -> Address:
    return Address(int.from_bytes(data[1:3], "little"), data[3] if len(data) > 3 else 0)


def _expedited(data: bytes) -> bytes:
    """The value of an initiate frame that has it in itself; empty: it comes in segments."""
    if len(data) != 8 or not data[0] & 2:
        return b""
    return data[4 : 8 - (data[0] >> 2 & 3)] if data[0] & 1 else data[4:]
