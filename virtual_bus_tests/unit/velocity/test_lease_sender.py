"""The lease: its bytes as in docs/bus.md, and a sender that never blocks and never raises."""

from __future__ import annotations

import math
import socket
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from canbase_velocity.lease import lease_datagram
from canbase_velocity.lease_sender import STARTS_S, LeaseSender
from canbase_velocity.twist import ZERO, Twist

LEASE = lease_datagram(1, 2, Twist(0.5, -1.0), brakes_hard=False)


@pytest.fixture
def path() -> Iterator[str]:
    with TemporaryDirectory(prefix="canbase-") as folder:
        yield str(Path(folder) / "lease")


@pytest.fixture
def watchdog(path: str) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(path)
        receiver.setblocking(False)
        yield receiver


@pytest.fixture
def sender(path: str) -> Iterator[LeaseSender]:
    sender = LeaseSender(path)
    yield sender
    sender.close()


def test_the_bytes_of_a_lease() -> None:
    body = (
        "43 42 4c 31 01 00 00 00 00 00 00 00 02 00 00 00 00 00 00 00"  # CBL1, sequence 1, 2 ns
        "00 00 00 00 00 00 e0 3f 00 00 00 00 00 00 f0 bf 00 00 00 00"  # 0.5 m/s, -1.0 rad/s, no flags
    )
    assert LEASE[:40] == bytes.fromhex(body)
    assert LEASE[40:] == struct.pack("<I", zlib.crc32(LEASE[:40]))


@pytest.mark.parametrize(("brakes_hard", "flags"), [(False, 0), (True, 4)])
def test_the_flags_of_a_lease(brakes_hard: bool, flags: int) -> None:
    assert lease_datagram(1, 0, ZERO, brakes_hard=brakes_hard)[36:40] == bytes([flags, 0, 0, 0])


@pytest.mark.parametrize("twist", [Twist(math.nan, 0.0), Twist(0.0, math.inf), Twist(-math.inf, 0.0)])
def test_a_velocity_that_is_not_finite_is_never_leased(twist: Twist) -> None:
    with pytest.raises(ValueError, match="finite"):
        lease_datagram(1, 0, twist, brakes_hard=False)


def test_the_sequence_starts_at_1() -> None:
    with pytest.raises(ValueError, match="starts at 1"):
        lease_datagram(0, 0, ZERO, brakes_hard=True)


def test_a_lease_arrives(sender: LeaseSender, watchdog: socket.socket) -> None:
    assert sender.send(LEASE, 0.0) is None
    assert watchdog.recv(100) == LEASE
    assert sender.errors == 0


def test_a_missing_watchdog_is_counted_and_told_once_and_so_is_its_return(path: str, sender: LeaseSender) -> None:
    assert sender.send(LEASE, 0.0) is None  # it may be starting
    told = sender.send(LEASE, STARTS_S)
    assert told is not None
    assert path in told
    assert "No such file" in told
    assert sender.send(LEASE, STARTS_S) is None
    assert sender.errors == 3
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(path)
        assert sender.send(LEASE, STARTS_S) == f"leases reach the watchdog at {path} again"
        assert receiver.recv(100) == LEASE
    told = sender.send(LEASE, STARTS_S)  # it died; its socket file is left
    assert told is not None
    assert "Connection refused" in told
    assert sender.errors == 4


def test_a_watchdog_that_starts_after_the_filter_is_no_news(path: str, sender: LeaseSender) -> None:
    assert sender.send(LEASE, 100.0) is None
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(path)
        assert sender.send(LEASE, 100.1) is None
    told = sender.send(LEASE, 100.2)  # once there, it is missed at once
    assert told is not None
    assert "Connection refused" in told


@pytest.mark.usefixtures("watchdog")
def test_a_watchdog_that_hangs_blocks_nobody(sender: LeaseSender) -> None:
    told = [sender.send(LEASE, STARTS_S) for _ in range(2000)]
    assert sender.errors > 0
    assert [text for text in told if text is not None] == [text for text in told if "unavailable" in str(text)]
    assert sum(text is not None for text in told) == 1
