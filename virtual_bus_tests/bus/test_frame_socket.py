"""Frames read and written at the socket of a bus, beside python-can on the same bus."""

from __future__ import annotations

import errno
import itertools
import random
import socket
import struct
import time
from collections.abc import Iterator
from typing import Any

import can
import pytest
from can.interfaces.udp_multicast import utils

from canbase_base import frame_socket
from support.udp_port import free_udp_port

pytestmark = pytest.mark.bus
FRAME = struct.Struct("=IB3x8s")
"""linux/can.h, struct can_frame."""
PLAIN = {
    "timestamp": 0.0,
    "arbitration_id": 0x181,
    "is_extended_id": False,
    "is_remote_frame": False,
    "is_error_frame": False,
    "channel": None,
    "dlc": 8,
    "data": bytes(8),
    "is_fd": False,
    "bitrate_switch": False,
    "error_state_indicator": False,
}
"""A datagram on the simulated bus, before it is packed."""
MANY = 1000


class SocketBus:
    """A `can.BusABC` on a socket whose other end the test holds: the kernel of this computer may have no CAN."""

    def __init__(self, own: socket.socket) -> None:
        own.setsockopt(socket.SOL_SOCKET, 35, 1)  # asm-generic/socket.h, SO_TIMESTAMPNS, as python-can sets it
        self.own, self.closed = own, False

    def fileno(self) -> int:
        return self.own.fileno()

    def shutdown(self) -> None:
        self.closed = True
        self.own.close()


def send(bus: Any, fields: dict[str, Any]) -> None:
    """A datagram onto the simulated bus, past python-can's checks."""
    packer: Any = utils
    bus._multicast.send(packer.msgpack.packb(fields), 1.0)


def read(bus: frame_socket.FrameSocket) -> frame_socket.Received:
    """The next frame, which comes within a second."""
    received = bus.read(1.0)
    assert received is not None
    return received


@pytest.fixture
def udp() -> dict[str, Any]:
    return {"interface": "udp_multicast", "channel": "239.74.163.2", "port": free_udp_port(), "hop_limit": 0}


@pytest.fixture
def ends() -> Iterator[tuple[socket.socket, socket.socket]]:
    """Two ends of one bus of datagrams."""
    one, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with one, other:
        yield one, other


def socketcan(end: socket.socket, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(can, "Bus", lambda **_: SocketBus(end))
    return frame_socket.open_bus({"interface": "socketcan", "channel": "can0"})


def drawn(rng: random.Random) -> can.Message:
    """A frame of any kind that a bus may carry."""
    kind = rng.choice(["data", "data", "data", "remote", "extended", "error", "fd"])
    extended = kind == "extended"
    largest = 0x1FFF_FFFF if extended else 0x7FF
    length = rng.choice([0, 1, 7, 8]) if kind != "fd" else rng.choice([0, 8, 12, 64])
    return can.Message(
        arbitration_id=rng.choice([0, 1, largest - 1, largest, rng.randrange(largest)]),
        is_extended_id=extended,
        is_remote_frame=kind == "remote",
        is_error_frame=kind == "error",
        is_fd=kind == "fd",
        dlc=length if kind == "remote" else None,
        data=None if kind == "remote" else rng.randbytes(length),
        check=True,
    )


def test_each_frame_on_the_simulated_bus_is_what_python_can_says_of_it(udp: dict[str, Any]) -> None:
    rng = random.Random(7)
    reader, sender = frame_socket.open_bus(udp), can.Bus(**udp)
    with can.Bus(**udp) as library:
        for _ in range(MANY):
            sender.send(drawn(rng))
            said, received = library.recv(1.0), read(reader)
            assert said is not None
            can_id, data, at_s = received
            assert (can_id <= frame_socket.MAX_COB_ID) == (
                not (said.is_extended_id or said.is_remote_frame or said.is_error_frame or said.is_fd)
            )
            assert can_id & frame_socket.ERROR_CLASS == said.arbitration_id
            assert bool(can_id & frame_socket.EXTENDED) == said.is_extended_id
            assert bool(can_id & frame_socket.REMOTE) == said.is_remote_frame
            assert bool(can_id & frame_socket.ERROR) == said.is_error_frame
            assert bool(can_id & frame_socket.FLEXIBLE) == said.is_fd
            assert data == bytes(said.data)
            assert at_s == pytest.approx(said.timestamp, abs=0.05)  # of two sockets
    reader.close()
    sender.shutdown()


@pytest.mark.parametrize(
    "wrong",
    [
        {"bitrate_switch": True},
        {"error_state_indicator": True},
        {"dlc": 3},
        {"arbitration_id": 0x800},
        {"arbitration_id": -1},
        {"data": bytes(9), "dlc": 9},
        {"more": 1},
    ],
    ids=str,
)
def test_a_datagram_that_is_no_frame_for_python_can_is_none_here(udp: dict[str, Any], wrong: dict[str, Any]) -> None:
    reader, sender = frame_socket.open_bus(udp), can.Bus(**udp)
    with can.Bus(**udp) as library:
        send(sender, PLAIN | wrong)
        with pytest.raises(can.CanOperationError):
            library.recv(1.0)
        assert read(reader)[0] == frame_socket.NO_FRAME
        send(sender, PLAIN)
        assert read(reader)[:2] == (0x181, bytes(8))
    reader.close()
    sender.shutdown()


def test_a_number_in_the_place_of_the_data_takes_no_memory(
    udp: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    reader, sender = frame_socket.open_bus(udp), can.Bus(**udp)
    send(sender, PLAIN | {"data": 2**31})
    made: list[dict[str, Any]] = []
    monkeypatch.setattr(can, "Message", lambda **fields: made.append(fields))
    assert read(reader)[0] == frame_socket.NO_FRAME
    assert made == []
    reader.close()
    sender.shutdown()


@pytest.mark.parametrize(
    ("problem", "advice"),
    [
        (OSError(errno.EAFNOSUPPORT, "no"), "sudo modprobe can_raw"),
        (OSError(errno.ENODEV, "no"), "is the adapter connected"),
        (OSError(errno.EPERM, "no"), "Check `bus` in robot.yaml or --channel"),
        (can.CanInitializationError("no"), "Check `bus` in robot.yaml or --channel"),
        (ImportError("no"), "Check `bus` in robot.yaml or --channel"),
    ],
)
def test_a_bus_that_cannot_be_opened_is_named_with_what_to_do(
    problem: Exception, advice: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuses(**_arguments: object) -> None:
        raise problem

    monkeypatch.setattr(can, "Bus", refuses)
    with pytest.raises(frame_socket.BusError, match=f"the CAN bus socketcan can0 cannot be opened: .*{advice}"):
        frame_socket.open_bus({"interface": "socketcan", "channel": "can0"})


def test_what_it_writes_is_a_frame_for_python_can(udp: dict[str, Any]) -> None:
    writer = frame_socket.open_bus(udp)
    with can.Bus(**udp) as library:
        for length in range(9):
            writer.write(0x181 + length, bytes(range(length)), 0.1)
            said = library.recv(1.0)
            assert said is not None
            assert (said.arbitration_id, bytes(said.data)) == (0x181 + length, bytes(range(length)))
            assert {said.is_extended_id, said.is_remote_frame, said.is_error_frame, said.is_fd} == {False}
    writer.close()


def test_what_it_requests_is_a_remote_frame_for_python_can(udp: dict[str, Any]) -> None:
    writer = frame_socket.open_bus(udp)
    with can.Bus(**udp) as library:
        writer.request(0x701, 1, 0.1)
        said = library.recv(1.0)
        assert said is not None
        assert (said.arbitration_id, said.dlc, said.is_remote_frame, said.is_extended_id) == (0x701, 1, True, False)
        assert bytes(said.data) == b""
    assert read(writer)[:2] == (frame_socket.REMOTE | 0x701, b"")  # each sender hears itself
    writer.close()


def test_a_request_on_socketcan_has_the_flag_and_the_length_of_the_answer(
    ends: tuple[socket.socket, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    bus = socketcan(ends[0], monkeypatch)
    bus.request(0x705, 1, 0.1)
    assert FRAME.unpack(ends[1].recv(100)) == (frame_socket.REMOTE | 0x705, 1, bytes(8))


def test_a_socketcan_frame_has_its_flags_its_length_and_the_time_of_the_kernel(
    ends: tuple[socket.socket, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    bus = socketcan(ends[0], monkeypatch)
    before_s = time.time()
    for can_id in (
        0x181,
        0x7FF,
        frame_socket.EXTENDED | 0x181,
        frame_socket.REMOTE | 0x181,
        frame_socket.ERROR | 0x040,
    ):
        for length in range(9):
            ends[1].send(FRAME.pack(can_id, length, bytes(range(8))))
            seen = bus.read(0.0)
            assert seen is not None
            assert seen[:2] == (can_id, bytes(range(length)))
            assert before_s <= seen[2] <= time.time()
    ends[1].send(bytes(72))  # CAN FD
    assert bus.read(0.0)[0] > frame_socket.MAX_COB_ID
    assert bus.read(0.0) is None


def test_a_socketcan_frame_is_written_as_the_kernel_wants_it(
    ends: tuple[socket.socket, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    bus = socketcan(ends[0], monkeypatch)
    bus.write(0x201, b"\x0f\x00\x10", 0.0)
    assert ends[1].recv(100) == FRAME.pack(0x201, 3, b"\x0f\x00\x10")


def test_a_full_buffer_is_an_error_after_the_timeout_and_nothing_is_sent_later(
    ends: tuple[socket.socket, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    bus = socketcan(ends[0], monkeypatch)
    sent = itertools.count()

    def write_until_it_fails() -> None:
        while True:
            bus.write(0x201, next(sent).to_bytes(4, "little"), 0.01)

    with pytest.raises(BlockingIOError):
        write_until_it_fails()
    refused = next(sent) - 1
    assert refused > 0
    taken = [int.from_bytes(ends[1].recv(100, socket.MSG_DONTWAIT)[8:12], "little") for _ in range(refused)]
    assert taken == list(range(refused))
    with pytest.raises(BlockingIOError):
        ends[1].recv(100, socket.MSG_DONTWAIT)


def test_waiting_ends_with_the_frame_or_with_the_time(
    ends: tuple[socket.socket, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    bus = socketcan(ends[0], monkeypatch)
    began = time.monotonic()
    assert bus.read(0.05) is None
    assert time.monotonic() - began >= 0.05
    ends[1].send(FRAME.pack(0x181, 0, b""))
    began = time.monotonic()
    assert bus.read(10.0)[0] == 0x181
    assert time.monotonic() - began < 5.0


def test_a_bus_that_is_gone_raises_and_a_closed_one_is_closed(
    ends: tuple[socket.socket, socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    bus = socketcan(ends[0], monkeypatch)
    ends[1].close()
    with pytest.raises(OSError, match="refused"):
        bus.write(0x201, b"", 0.0)
    bus.close()
    with pytest.raises(OSError, match="Bad file descriptor"):
        bus.read(0.0)
    assert bus._bus.closed
