"""CiA 301 SDO client for one node, without a bus: frames go in, frames and answers come out, time is an argument.

Expedited and segmented transfers in both directions; block transfers are in `sdo_block.py`. One transfer at a time.
What does not answer the transfer under way is dropped and counted: other clients use the same channel, and answers may
come late.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from canbase_config.object_map import AXIS_OFFSET, CONTROLWORD, POSITION_ACTUAL, STATUSWORD, VELOCITY_ACTUAL
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import MAX_NODE_ID, SDO_TO_CLIENT, SDO_TO_SERVER

_ABORT = 0x80

LONGEST_TIMEOUT_S, LATE_FACTOR = 5.0, 2.0
"""A server has no time limit (CiA 301): after an answer that came late the client waits this many times as long [s]."""
MAX_UPLOAD_BYTES = 4096
"""A drive that sends more than this for one object, in bytes or in segments, is not followed any further."""
LONGEST_TRANSFER_S = 60.0
"""From its start, beside the time in which no answer came: a drive that answers without end, or just in time each time,
is not followed any longer. 4096 bytes take 586 segments, 65,536 bytes in blocks 10 s at 125 kbit/s."""

TOGGLE_BIT_WRONG, TIMED_OUT, COMMAND_UNKNOWN = 0x0503_0000, 0x0504_0000, 0x0504_0001
OUT_OF_MEMORY, ACCESS_UNSUPPORTED, WRITE_ONLY, READ_ONLY = 0x0504_0005, 0x0601_0000, 0x0601_0001, 0x0601_0002
NO_OBJECT, NO_SUB_INDEX, LENGTH_WRONG, DEVICE_STATE = 0x0602_0000, 0x0609_0011, 0x0607_0010, 0x0800_0022
TOO_LONG, TOO_SHORT = 0x0607_0012, 0x0607_0013
VALUE_INVALID, VALUE_TOO_HIGH, VALUE_TOO_LOW = 0x0609_0030, 0x0609_0031, 0x0609_0032
BLOCK_SIZE_INVALID, SEQUENCE_INVALID, CRC_ERROR = 0x0504_0002, 0x0504_0003, 0x0504_0004
GENERAL_ERROR = 0x0800_0000

_OF_THE_WATCHDOG = frozenset(
    index + axis * AXIS_OFFSET
    for index in (CONTROLWORD, STATUSWORD, POSITION_ACTUAL, VELOCITY_ACTUAL)
    for axis in (0, 1)
)
"""It requests them as well while it stops a drive: their second answer may be its own."""

ABORT_TEXTS = {
    TOGGLE_BIT_WRONG: "toggle bit not alternated",
    TIMED_OUT: "SDO protocol timed out",
    COMMAND_UNKNOWN: "command specifier not valid or unknown",
    BLOCK_SIZE_INVALID: "block size not valid",
    SEQUENCE_INVALID: "sequence number not valid",
    CRC_ERROR: "CRC error",
    OUT_OF_MEMORY: "out of memory",
    ACCESS_UNSUPPORTED: "unsupported access to the object",
    WRITE_ONLY: "the object is write-only",
    READ_ONLY: "the object is read-only",
    NO_OBJECT: "the object does not exist",
    0x0604_0041: "the object cannot be mapped to a PDO",
    0x0604_0042: "the mapped objects exceed the length of the PDO",
    0x0604_0043: "parameters are incompatible",
    0x0604_0047: "internal incompatibility in the device",
    0x0606_0000: "access failed because of a hardware error",
    LENGTH_WRONG: "data type or length does not match",
    TOO_LONG: "data too long",
    TOO_SHORT: "data too short",
    NO_SUB_INDEX: "the sub-index does not exist",
    VALUE_INVALID: "value not valid",
    VALUE_TOO_HIGH: "value too high",
    VALUE_TOO_LOW: "value too low",
    0x0609_0036: "maximum below minimum",
    0x060A_0023: "resource not available",
    GENERAL_ERROR: "general error",
    0x0800_0020: "data cannot be transferred or stored",
    0x0800_0021: "data cannot be transferred or stored because of local control",
    DEVICE_STATE: "data cannot be transferred or stored in the present state of the device",
    0x0800_0023: "no object dictionary present",
    0x0800_0024: "no data available",
}
"""SDO abort codes of CiA 301 in words."""


def abort_text(code: int) -> str:
    """An abort code, with its meaning, for people."""
    return f"{code >> 16:04X} {code & 0xFFFF:04X}h {ABORT_TEXTS.get(code, 'unknown abort code')}"


@dataclass(frozen=True, slots=True)
class Read:
    """Upload of one object. The answer is its bytes."""

    index: int
    sub: int = 0

    def __str__(self) -> str:
        return f"{self.index:04X}h:{self.sub}"


@dataclass(frozen=True, slots=True)
class Write:
    """Download of one object: `value` as a number of `size` bytes (negative: two's complement), or as bytes.

    The answer is b"". Raises ValueError when a number does not fit, or when there is nothing to write.
    """

    index: int
    sub: int
    value: int | bytes
    size: int = 0

    def __post_init__(self) -> None:
        if self.value == b"" or (isinstance(self.value, int) and self.size < 1):
            raise ValueError(f"{self}: nothing to write; a number needs its size in bytes")
        if isinstance(self.value, int) and not -(1 << 8 * self.size - 1) <= self.value < 1 << 8 * self.size:
            raise ValueError(f"{self}: {self.value} does not fit {self.size} bytes")

    @property
    def data(self) -> bytes:
        """The bytes that go to the drive."""
        if isinstance(self.value, bytes):
            return self.value
        return (self.value & (1 << 8 * self.size) - 1).to_bytes(self.size, "little")

    def __str__(self) -> str:
        return f"{self.index:04X}h:{self.sub}"


class SdoError(Exception):
    """A transfer failed after all its tries. Abstract: it is one of the two below."""

    def __init__(self, node_id: int, step: Read | Write, text: str) -> None:
        super().__init__(f"node {node_id}, {step}: {text}")
        self.node_id = node_id
        self.index = step.index
        self.sub = step.sub
        self.text = text


class SdoAborted(SdoError):  # noqa: N818 - the standard's word
    """The drive refused the transfer, or its answers broke the protocol: `code` is the abort code."""

    def __init__(self, node_id: int, step: Read | Write, code: int) -> None:
        super().__init__(node_id, step, abort_text(code))
        self.code = code


class SdoTimeout(SdoError):  # noqa: N818 - as TimeoutError, but of SDO
    """The drive did not answer any of the attempts."""


@dataclass(slots=True)
class Transfer:
    """The transfer under way. `buffer`: what is still to be sent, or what has come so far."""

    step: Read | Write
    attempts_left: int
    deadline: float
    buffer: bytes
    initiated: bool = False
    toggle: int = 0
    announced: int | None = None
    segments: int = 0
    """That came. One may be empty."""


@dataclass(slots=True)
class _Requests:
    """How often one object was requested and answered, and when it was requested last [s]."""

    sent: int = 0
    answered: int = 0
    at: float = 0.0


class SdoClient:
    """One SDO transfer after the other with one node.

    `start` gives the first frame, `on_frame` and `tick` give those that follow; when `busy` ends, `answer()` has it.
    `dropped` counts the frames of this channel that did not belong to the transfer, `duplicates` those among them that
    answer the request before it once more, though that one was sent once, and the watchdog requests no such object.
    `late_s`: the longest time that an answer took at least [s], where that is longer than the timeout was.
    """

    def __init__(self, node_id: int, timeout_s: float, attempts: int) -> None:
        if not 1 <= node_id <= MAX_NODE_ID or timeout_s <= 0.0 or attempts < 1:
            raise ValueError(f"node {node_id}, {timeout_s} s, {attempts} attempts: expected 1…127, more than 0 of each")
        self.node_id = node_id
        self.dropped = self.duplicates = 0
        self.late_s = 0.0
        self._requests: dict[bytes, _Requests] = {}
        """By address."""
        self._answered: bytes | None = None
        """Address of the transfer that ended last, with the first answer to its only request."""
        self._addresses: set[bytes] = set()
        """Of all requests; `_requests` leaves out those that the watchdog makes too."""
        self._unconfirmed: set[bytes] = set()
        """Addresses that were written, and whose last confirmation may not have come yet."""
        self._timeout_s = timeout_s
        self._attempts = attempts
        self._transfer: Transfer | None = None
        self._answer: bytes | SdoError | None = None
        self._ends_s = 0.0
        """When the transfer under way is given up, whatever the drive answers [s]."""

    @property
    def busy(self) -> bool:
        """Whether a transfer is under way."""
        return self._transfer is not None

    def has_requested(self, at: bytes) -> bool:
        """Whether any request was about the object with this address."""
        return at in self._addresses

    def may_confirm(self, at: bytes) -> bool:
        """Whether an answer that confirms a write to this address, not taken in yet, may be one to our own request.

        A server answers in the order of the requests (CiA 301): what was written before a request that has its answer
        is confirmed by then, however often it was requested.
        """
        return at in self._unconfirmed

    def start(self, step: Read | Write, now_s: float) -> Frame:
        """Begin a transfer. Raises RuntimeError while another is under way."""
        if self._transfer is not None:
            raise RuntimeError(f"node {self.node_id}: {self._transfer.step} is under way; wait for its answer")
        self._answer = None
        self._ends_s = self._end_s(now_s)
        self._addresses.add(address(step))
        if isinstance(step, Write):
            self._unconfirmed.add(address(step))
        return self._begin(step, self._attempts, now_s)

    def again(self, now_s: float) -> Frame:
        """Restart the transfer under way: the drive has just started. Raises RuntimeError when there is none."""
        if self._transfer is None:
            raise RuntimeError(f"node {self.node_id}: no transfer is under way")
        self._ends_s = self._end_s(now_s)
        return self._begin(self._transfer.step, self._attempts, now_s)

    def answer(self) -> bytes:
        """What the last transfer brought: the object's bytes, or b"" after a write.

        Raises SdoAborted or SdoTimeout when it failed, RuntimeError when there is none yet.
        """
        if self._answer is None:
            raise RuntimeError(f"node {self.node_id}: no transfer has ended yet")
        if isinstance(self._answer, SdoError):
            raise self._answer
        return self._answer

    def tick(self, now_s: float) -> list[Frame]:
        """Let time pass: a transfer without an answer is aborted, then tried again or given up."""
        if self._transfer is None:
            return []
        if now_s >= self._ends_s:
            return self._give_up(self._transfer.step)
        return [] if now_s < self._transfer.deadline else self._fail(self._transfer, TIMED_OUT, now_s)

    def on_frame(self, frame: Frame, now_s: float) -> list[Frame]:
        """Take a frame from the bus; frames of other nodes and services are none of our business."""
        if frame.cob_id != SDO_TO_CLIENT + self.node_id:
            return []
        transfer = self._transfer
        if len(frame.data) == 8 and (transfer is None or not transfer.initiated):
            self._note_answer(frame.data[1:4], now_s)
        if len(frame.data) == 8 and frame.data[1:4] == self._answered and not _expects(transfer, frame.data):
            requests = self._requests.get(frame.data[1:4])
            self.duplicates += requests is None or requests.answered > requests.sent
            return self._drop()
        if transfer is None or len(frame.data) != 8:
            return self._drop()
        if frame.data[0] == _ABORT:
            return self._on_abort(transfer.step, frame.data)
        if transfer.initiated:
            return self._on_segment(transfer, frame.data, now_s)
        return self._on_initiated(transfer, frame.data, now_s)

    def _settle(self, step: Read | Write) -> None:
        """The drive has answered: everything that was written before is confirmed. The watchdog may have requested its
        own objects before us."""
        if step.index not in _OF_THE_WATCHDOG:
            self._unconfirmed &= {address(step)} if isinstance(step, Write) else set()

    def _note_answer(self, address: bytes, now_s: float) -> None:
        """Answers carry no number: this one came so long after the last request for the object, or later still."""
        requests = self._requests.get(address)
        if requests is None:
            return
        requests.answered += 1
        took_s, is_ours = now_s - requests.at, requests.answered <= requests.sent
        if self._timeout_s < took_s <= LONGEST_TIMEOUT_S and is_ours:
            self.late_s = max(self.late_s, took_s)
            self._timeout_s = min(LATE_FACTOR * took_s, LONGEST_TIMEOUT_S)

    def _begin(self, step: Read | Write, attempts: int, now_s: float) -> Frame:
        buffer = b"" if isinstance(step, Read) else step.data
        self._transfer = Transfer(step, attempts - 1, now_s, buffer)
        if step.index not in _OF_THE_WATCHDOG:
            requests = self._requests.setdefault(address(step), _Requests())
            requests.sent, requests.at = requests.sent + 1, now_s
        return self._request(self._transfer, _initiate(step), now_s)

    def _request(self, transfer: Transfer, data: bytes, now_s: float) -> Frame:
        transfer.deadline = now_s + self._timeout_s
        return Frame(SDO_TO_SERVER + self.node_id, data.ljust(8, b"\0"))

    def _on_abort(self, step: Read | Write, data: bytes) -> list[Frame]:
        if data[1:4] != address(step):
            return self._drop()
        self._settle(step)
        return self._finish(SdoAborted(self.node_id, step, int.from_bytes(data[4:], "little")))

    def _on_initiated(self, transfer: Transfer, data: bytes, now_s: float) -> list[Frame]:
        step = transfer.step
        if data[1:4] != address(step) or data[0] >> 5 != (2 if isinstance(step, Read) else 3):
            return self._drop()
        transfer.initiated = True
        self._settle(step)
        if isinstance(step, Write):
            return self._finish(b"") if len(step.data) <= 4 else [self._send_segment(transfer, now_s)]
        expedited, sized = data[0] & 0x02, data[0] & 0x01
        if expedited:
            return self._finish(data[4 : 8 - (data[0] >> 2 & 0x03 if sized else 0)])
        transfer.announced = int.from_bytes(data[4:], "little") if sized else None
        return [self._request(transfer, b"\x60", now_s)]

    def _on_segment(self, transfer: Transfer, data: bytes, now_s: float) -> list[Frame]:
        is_read = isinstance(transfer.step, Read)
        if data[0] >> 5 != (0 if is_read else 1):
            return self._drop()
        if data[0] >> 4 & 1 != transfer.toggle:
            return self._fail(transfer, TOGGLE_BIT_WRONG, now_s)
        transfer.toggle ^= 1
        if is_read:
            return self._on_uploaded(transfer, data, now_s)
        return [self._send_segment(transfer, now_s)] if transfer.buffer else self._finish(b"")

    def _on_uploaded(self, transfer: Transfer, data: bytes, now_s: float) -> list[Frame]:
        transfer.buffer += data[1 : 8 - (data[0] >> 1 & 0x07)]
        transfer.segments += 1
        if max(len(transfer.buffer), transfer.segments) > MAX_UPLOAD_BYTES:
            return self._fail(transfer, OUT_OF_MEMORY, now_s)
        if not data[0] & 0x01:
            return [self._request(transfer, bytes((0x60 | transfer.toggle << 4,)), now_s)]
        if transfer.announced not in (None, len(transfer.buffer)):
            return self._fail(transfer, LENGTH_WRONG, now_s)
        return self._finish(transfer.buffer)

    def _send_segment(self, transfer: Transfer, now_s: float) -> Frame:
        part, transfer.buffer = transfer.buffer[:7], transfer.buffer[7:]
        is_last = not transfer.buffer
        command = transfer.toggle << 4 | (7 - len(part)) << 1 | is_last
        return self._request(transfer, bytes((command,)) + part, now_s)

    def _fail(self, transfer: Transfer, code: int, now_s: float) -> list[Frame]:
        step = transfer.step
        abort = self._abort_frame(step, code)
        if transfer.attempts_left:
            return [abort, self._begin(step, transfer.attempts_left, now_s)]
        self._finish(self._timeout(step) if code == TIMED_OUT else SdoAborted(self.node_id, step, code))
        return [abort]

    def _end_s(self, now_s: float) -> float:
        return now_s + LONGEST_TRANSFER_S + self._attempts * self._timeout_s

    def _give_up(self, step: Read | Write) -> list[Frame]:
        text = f"not finished after {LONGEST_TRANSFER_S:g} s, though the drive answers"
        self._finish(SdoTimeout(self.node_id, step, text))
        return [self._abort_frame(step, TIMED_OUT)]

    def _abort_frame(self, step: Read | Write, code: int) -> Frame:
        return Frame(SDO_TO_SERVER + self.node_id, bytes((_ABORT,)) + address(step) + code.to_bytes(4, "little"))

    def _timeout(self, step: Read | Write) -> SdoTimeout:
        return SdoTimeout(self.node_id, step, f"no answer to {self._attempts} requests, {self._timeout_s:g} s each")

    def _finish(self, answer: bytes | SdoError) -> list[Frame]:
        transfer, self._transfer = self._transfer, None
        step = transfer.step if transfer is not None and transfer.attempts_left == self._attempts - 1 else None
        self._answered = address(step) if step is not None and step.index not in _OF_THE_WATCHDOG else None
        self._answer = answer
        return []

    def _drop(self) -> list[Frame]:
        self.dropped += 1
        return []


def _expects(transfer: Transfer | None, data: bytes) -> bool:
    """Whether the transfer under way may be what this frame answers."""
    return transfer is not None and (transfer.initiated or address(transfer.step) == data[1:4])


def address(step: Read | Write) -> bytes:
    """Index and sub-index as they are on the bus."""
    return struct.pack("<HB", step.index, step.sub)


def _initiate(step: Read | Write) -> bytes:
    if isinstance(step, Read):
        return b"\x40" + address(step)
    data = step.data
    if len(data) <= 4:
        return bytes((0x23 | (4 - len(data)) << 2,)) + address(step) + data
    return b"\x21" + address(step) + len(data).to_bytes(4, "little")
