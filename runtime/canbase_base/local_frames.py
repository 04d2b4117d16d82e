"""A simulated bus (udp_multicast) takes frames of this computer alone: the kernel drops all others.

python-can binds the port on all interfaces, so that every computer of the network could write a frame. A filter on the
socket (SO_ATTACH_FILTER, socket(7), packet(7)) passes what came over the loopback interface, and what the kernel
itself turned round on its way out: multicast that this computer sent. Where `bus.extra.hop_limit` lets frames leave
this computer, those of others are wanted, and there is no filter.
"""

from __future__ import annotations

import ctypes
import os
import socket
import struct
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final, Protocol

SO_ATTACH_FILTER: Final = 26
"""asm-generic/socket.h; Python's socket module has no name for it."""
PACKET_LOOPBACK: Final = 5
"""linux/if_packet.h: turned round by the kernel."""
QUEUED: Final = 100_000
"""More datagrams than a socket keeps."""
_ANCILLARY: Final = 0xFFFF_F000
"""linux/filter.h, SKF_AD_OFF: from here on loads are about the packet, not of it."""
_PACKET_TYPE: Final = _ANCILLARY + 4
_INTERFACE: Final = _ANCILLARY + 8
_LOAD: Final = 0x20
_JUMP_IF_EQUAL: Final = 0x15
_RETURN: Final = 0x06
_WHOLE: Final = 0xFFFF_FFFF
_STEP: Final = struct.Struct("HBBI")
"""linux/filter.h, sock_filter: code, jump if true, jump if false, operand."""


class HasSocket(Protocol):
    """A `can.BusABC` on a socket."""

    def fileno(self) -> int:
        """Of the socket. Raises NotImplementedError where there is none."""


def keep_to_this_computer(arguments: Mapping[str, Any], bus: HasSocket) -> None:
    """Set the filter on a bus that was opened with these arguments of `can.Bus`; only a simulated one gets it.

    Raises OSError where the kernel refuses it.
    """
    if arguments.get("interface") == "udp_multicast" and arguments.get("hop_limit") == 0:
        program = ctypes.create_string_buffer(b"".join(_STEP.pack(*step) for step in _program()))
        filter_ = struct.pack("HP", len(_program()), ctypes.addressof(program))
        with socket.socket(fileno=os.dup(bus.fileno())) as copy:
            copy.setsockopt(socket.SOL_SOCKET, SO_ATTACH_FILTER, filter_)
            _drop_what_came_before(copy)


def _drop_what_came_before(socket_: socket.socket) -> None:
    with suppress(BlockingIOError):
        for _ in range(QUEUED):
            socket_.recv(1, socket.MSG_DONTWAIT)


def _program() -> tuple[tuple[int, int, int, int], ...]:
    return (
        (_LOAD, 0, 0, _INTERFACE),
        (_JUMP_IF_EQUAL, 2, 0, socket.if_nametoindex("lo")),
        (_LOAD, 0, 0, _PACKET_TYPE),
        (_JUMP_IF_EQUAL, 0, 1, PACKET_LOOPBACK),
        (_RETURN, 0, 0, _WHOLE),
        (_RETURN, 0, 0, 0),
    )
