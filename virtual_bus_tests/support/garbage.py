"""What anybody may send to the port of a simulated bus (udp_multicast) that is no frame of CANopen."""

from __future__ import annotations

import random
import socket
from typing import Any, Final

import msgpack  # type: ignore[import-untyped]

GROUP: Final = "239.74.163.2"
FRAME: Final[dict[str, Any]] = {
    "timestamp": 0.0,
    "arbitration_id": 0x181,
    "is_extended_id": False,
    "is_remote_frame": False,
    "is_error_frame": False,
    "channel": None,
    "dlc": 1,
    "data": b"\1",
    "is_fd": False,
    "bitrate_switch": False,
    "error_state_indicator": False,
}
"""A frame as python-can packs it."""
BROKEN: Final[tuple[dict[str, Any], ...]] = (
    {"arbitration_id": 1.5},
    {"arbitration_id": float("nan")},
    {"arbitration_id": 1.5, "is_error_frame": True},
    {"arbitration_id": -1},
    {"arbitration_id": 0x800},
    {"arbitration_id": 2**63},
    {"arbitration_id": "x"},
    {"arbitration_id": None},
    {"dlc": 9, "data": bytes(9)},
    {"dlc": 64, "data": bytes(64), "is_fd": True},
    {"dlc": 2},
    {"dlc": -1},
    {"data": "text"},
    {"data": [1, 2, 999]},
    {"nobody": "knows this"},
)
"""Each with the rest of FRAME."""


def datagrams(number: int) -> list[bytes]:
    """The same for every run: broken frames, other things in MessagePack, random bytes."""
    chance = random.Random(50)
    packed = [msgpack.packb(FRAME | broken) for broken in BROKEN]
    others = [b"", b"\x00", b"\xc1", b"\x80", b"\x91" * 4000, b"\xdd\xff\xff\xff\xff", msgpack.packb([1, "a", None])]
    half = [whole[: len(whole) // 2] for whole in packed]
    noise = [chance.randbytes(chance.randrange(1, 200)) for _ in range(50)]
    return [chance.choice([*packed, *others, *half, *noise]) for _ in range(number)]


def send(port: int, number: int) -> None:
    """To all that listen on this port, none of it beyond this computer."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        for datagram in datagrams(number):
            sender.sendto(datagram, (GROUP, port))
