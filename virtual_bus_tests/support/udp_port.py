"""UDP ports for simulated buses: robots beside each other on this computer have one each."""

from __future__ import annotations

import socket

_held_ports: list[socket.socket] = []
"""They hold the ports that this process was given, until it ends."""


def free_udp_port() -> int:
    """A UDP port that is free now: benches on one machine are distinguished by it. No other test is given it as long
    as this process lives: between this call and the start of the bench the port itself is free."""
    while True:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            port: int = probe.getsockname()[1]
        holder = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            holder.bind(f"\0canbase-test-port-{port}")
        except OSError:
            holder.close()
            continue
        _held_ports.append(holder)
        return port
