"""QEMU's control socket: takes the CAN adapter out and puts it in again when the guest asks for it."""

from __future__ import annotations

import json
import socket
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

ORDERS: Final[Mapping[str, dict[str, Any]]] = {
    "device_del": {"execute": "device_del", "arguments": {"id": "adapter0"}},
    "device_add": {
        "execute": "device_add",
        "arguments": {"driver": "kvaser_pci", "canbus": "bus", "id": "adapter0", "addr": "0x10"},
    },
}
"""By the word behind `@host` in the guest's output."""


class Monitor:
    """A connection to the guest's control socket."""

    def __init__(self, path: Path, told: Path) -> None:
        """`told`: the file that the guest's output goes to; what it has asked for already is done."""
        self._told = told
        self._done = len(self._orders())
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.connect(str(path))
        self._send({"execute": "qmp_capabilities"})

    def look(self) -> None:
        """Do what the guest's output asks for since the last look."""
        orders = self._orders()
        for order in orders[self._done :]:
            self._send(ORDERS[order])
        self._done = len(orders)

    def _orders(self) -> list[str]:
        *lines, _ = self._told.read_text(errors="replace").split("\n")
        return [line.split()[1] for line in lines if line.startswith("@host ")]

    def _send(self, order: dict[str, Any]) -> None:
        self._socket.sendall(json.dumps(order).encode() + b"\n")
