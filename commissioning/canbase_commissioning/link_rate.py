"""The commands that give a SocketCAN interface another bit rate (iproute2, `ip link … type can`). Pure."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from canbase_commissioning.can_interface import Link

QUEUE_LENGTH = 64
"""Frames; as docs/commissioning.md has it."""
RESTART_MS = 100


def commands(link: Link, bitrate: int, *, listen_only: bool = False) -> tuple[tuple[str, ...], ...]:
    """What sets up the interface. `listen_only`: the controller sends no error frames and no acknowledgements."""
    length = link.queue_length or QUEUE_LENGTH
    restart_ms = "0" if listen_only else str(link.restart_ms or RESTART_MS)
    can = ("type", "can", "bitrate", str(bitrate), "restart-ms", restart_ms, "listen-only", _word(listen_only))
    return (
        ("ip", "link", "set", link.name, "down"),
        ("ip", "link", "set", link.name, *can),
        ("ip", "link", "set", link.name, "txqueuelen", str(length), "up"),
    )


def as_text(words: Sequence[Sequence[str]]) -> str:
    """For a person who types them."""
    return "\n".join(f"  sudo {shlex.join(line)}" for line in words)


def _word(is_on: bool) -> str:
    return "on" if is_on else "off"
