"""Frames of a CAN bus, read and written at its socket: no object and no waiting for a frame that is there already.

python-can opens and configures the bus. Its `recv` waits by one system call, takes by a second one, and builds a
`can.Message` of 15 fields; a hundred times a second, each time out of cold caches, that was a third of what the control
loop took of the processor. A bus that is no socket (`virtual`, serial adapters) is read by python-can as before.

Identifiers have the flags of linux/can.h above them. Whatever is greater than MAX_COB_ID is no data frame of CANopen.
"""

from __future__ import annotations

import errno
import os
import select
import socket
import struct
from collections.abc import Callable, Mapping
from typing import Any, Final, Protocol

import can

from canbase_base.local_frames import keep_to_this_computer

MAX_COB_ID: Final = 0x7FF
MAX_DATA_BYTES: Final = 8
EXTENDED: Final = 0x8000_0000
"""linux/can.h, CAN_EFF_FLAG."""
REMOTE: Final = 0x4000_0000
"""linux/can.h, CAN_RTR_FLAG."""
ERROR: Final = 0x2000_0000
"""linux/can.h, CAN_ERR_FLAG: the controller reports about itself."""
ERROR_CLASS: Final = 0x1FFF_FFFF
"""linux/can.h, CAN_ERR_MASK."""
FLEXIBLE: Final = 0x1_0000_0000
"""A CAN FD frame; the kernel has no flag for it."""
NO_FRAME: Final = -1
"""In the place of an identifier, and so is any negative one: a datagram on a simulated bus that is no CAN frame."""

_CAN_FRAME: Final = struct.Struct("=IB3x8s")
"""linux/can.h, struct can_frame: identifier, length, data."""
_LARGEST: Final = 72
"""struct canfd_frame."""
_TIMESPEC: Final = struct.Struct("@ll")
_ANCILLARY: Final = socket.CMSG_SPACE(_TIMESPEC.size)
_DATAGRAM: Final = 4096
"""A longer one is cut, and then no frame."""
_FLAGS: Final = (
    "is_extended_id", "is_remote_frame", "is_error_frame", "is_fd", "bitrate_switch", "error_state_indicator",
)  # fmt: skip
"""Fields of a datagram that are all false in a plain frame."""
_FIELDS: Final = frozenset({"timestamp", "arbitration_id", "channel", "dlc", "data", *_FLAGS})
_CHECK: Final = "Check `bus` in robot.yaml or --channel, and that the interface is up (ip -details link show)."
_ADVICE: Final[Mapping[int | None, str]] = {
    errno.EAFNOSUPPORT: "This Linux has no SocketCAN: sudo modprobe can_raw.",
    errno.ENODEV: f"No such interface: is the adapter connected, and its kernel module loaded? {_CHECK}",
}

Received = tuple[int, bytes, float]
"""Identifier with flags, data, and when the kernel received it by the wall clock [s]; 0.0: unknown."""


class FrameSocket(Protocol):
    """One open bus. Errors are those of python-can (can.CanError), OSError and ValueError."""

    def fileno(self) -> int | None:
        """What to wait on with select; None for a bus that has no such thing."""

    def read(self, timeout_s: float) -> Received | None:
        """The oldest frame that waits, or the first one that comes in `timeout_s`; None: none came."""

    def write(self, cob_id: int, data: bytes, timeout_s: float) -> None:
        """Send a data frame with an 11-bit identifier. Raises where the bus does not take it in `timeout_s`."""

    def request(self, cob_id: int, length: int, timeout_s: float) -> None:
        """Send a remote frame for a data frame of this length. Raises like `write`, and NotImplementedError where the
        adapter has none."""

    def close(self) -> None:
        """Close the bus."""


class BusError(Exception):
    """The bus cannot be opened, or not be used. The text has the likely reason, and what to look at."""


def open_bus(arguments: Mapping[str, Any]) -> FrameSocket:
    """Opens `can.Bus(**arguments)`. Raises BusError."""
    try:
        return _opened(arguments)
    except (can.CanError, OSError, ValueError, TypeError, ImportError, NotImplementedError) as error:
        named = f"{arguments.get('interface')} {arguments.get('channel')}"
        advice = _ADVICE.get(getattr(error, "errno", None), _CHECK)
        raise BusError(f"the CAN bus {named} cannot be opened: {error}. {advice}") from error


def _opened(arguments: Mapping[str, Any]) -> FrameSocket:
    bus = can.Bus(**arguments)
    try:
        keep_to_this_computer(arguments, bus)
        return _OF_INTERFACE.get(str(arguments.get("interface")), _Library)(bus)
    except BaseException:
        bus.shutdown()
        raise


class _Library:
    """Any bus of python-can."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus

    def fileno(self) -> int | None:
        """See FrameSocket."""
        try:
            return self._bus.fileno()
        except NotImplementedError:
            return None

    def read(self, timeout_s: float) -> Received | None:
        """See FrameSocket."""
        message = self._bus.recv(timeout_s)
        return None if message is None else _received(message)

    def write(self, cob_id: int, data: bytes, timeout_s: float) -> None:
        """See FrameSocket."""
        self._bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False), timeout=timeout_s)

    def request(self, cob_id: int, length: int, timeout_s: float) -> None:
        """See FrameSocket."""
        frame = can.Message(arbitration_id=cob_id, dlc=length, is_remote_frame=True, is_extended_id=False)
        self._bus.send(frame, timeout=timeout_s)

    def close(self) -> None:
        """See FrameSocket."""
        self._bus.shutdown()


class _Socket(_Library):
    """A bus that is a socket, read through a second descriptor of it."""

    def __init__(self, bus: can.BusABC) -> None:
        super().__init__(bus)
        self._socket = socket.socket(fileno=os.dup(bus.fileno()))

    def read(self, timeout_s: float) -> Received | None:
        """See FrameSocket."""
        received = self._take()
        if received is None and timeout_s > 0.0:
            select.select([self._socket], [], [], timeout_s)
            received = self._take()
        return received

    def close(self) -> None:
        """See FrameSocket."""
        self._socket.close()
        super().close()

    def _take(self) -> Received | None:
        raise NotImplementedError


class _SocketCan(_Socket):
    """SocketCAN: a frame is 16 bytes."""

    def _take(self) -> Received | None:
        try:
            frame, ancillary, _flags, _address = self._socket.recvmsg(_LARGEST, _ANCILLARY, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return None
        if len(frame) != _CAN_FRAME.size:
            return FLEXIBLE, b"", _time_s(ancillary)
        can_id, length, data = _CAN_FRAME.unpack(frame)
        return can_id, data[:length], _time_s(ancillary)

    def write(self, cob_id: int, data: bytes, timeout_s: float) -> None:
        """See FrameSocket."""
        self._write(_CAN_FRAME.pack(cob_id, len(data), data), timeout_s)

    def request(self, cob_id: int, length: int, timeout_s: float) -> None:
        """See FrameSocket."""
        self._write(_CAN_FRAME.pack(cob_id | REMOTE, length, b""), timeout_s)

    def _write(self, frame: bytes, timeout_s: float) -> None:
        try:
            self._socket.send(frame, socket.MSG_DONTWAIT)
        except BlockingIOError:
            select.select([], [self._socket], [], timeout_s)
            self._socket.send(frame, socket.MSG_DONTWAIT)


class _UdpMulticast(_Socket):
    """python-can's simulated bus: a frame is a mapping in msgpack, which python-can brings."""

    def __init__(self, bus: can.BusABC) -> None:
        super().__init__(bus)
        from can.interfaces.udp_multicast import utils

        self._unpacked = utils.msgpack.unpackb  # type: ignore[attr-defined]

    def _take(self) -> Received | None:
        try:
            datagram, ancillary, _flags, _address = self._socket.recvmsg(_DATAGRAM, _ANCILLARY, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return None
        try:
            return _decoded(self._unpacked(datagram), _time_s(ancillary))
        except Exception:  # noqa: BLE001 - a datagram can be anything, msgpack and python-can may raise anything
            return NO_FRAME, b"", 0.0


_OF_INTERFACE: Final[dict[str, Callable[[can.BusABC], FrameSocket]]] = {
    "socketcan": _SocketCan,
    "udp_multicast": _UdpMulticast,
}


def _decoded(fields: dict[str, Any], at_s: float) -> Received:
    """Raises anything for what is no frame: python-can checks all but the plainest ones."""
    cob_id, data = fields.get("arbitration_id"), fields.get("data")
    if type(data) is not bytes:  # for a number python-can makes so many bytes
        return NO_FRAME, b"", 0.0
    if (
        fields.keys() == _FIELDS
        and (type(cob_id) is int and 0 <= cob_id <= MAX_COB_ID)
        and (len(data) == fields.get("dlc") and len(data) <= MAX_DATA_BYTES)
        and all(fields.get(flag) is False for flag in _FLAGS)
    ):
        return cob_id, data, at_s
    return _received(can.Message(check=True, **(fields | {"timestamp": at_s})))


def _received(message: can.Message) -> Received:
    if type(message.arbitration_id) is not int:  # python-can lets a simulated bus have 1.5
        return NO_FRAME, b"", 0.0
    flags = (
        (EXTENDED if message.is_extended_id else 0)
        | (REMOTE if message.is_remote_frame else 0)
        | (ERROR if message.is_error_frame else 0)
        | (FLEXIBLE if message.is_fd else 0)
    )
    return message.arbitration_id | flags, bytes(message.data), message.timestamp


def _time_s(ancillary: list[tuple[int, int, bytes]]) -> float:
    """python-can sets SO_TIMESTAMPNS on both kinds of socket, so there is one."""
    for _level, _kind, stamp in ancillary:
        seconds, nanoseconds = _TIMESPEC.unpack(stamp)
        return float(seconds + 1e-9 * nanoseconds)
    return 0.0
