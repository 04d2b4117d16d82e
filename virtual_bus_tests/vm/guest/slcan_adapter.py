"""A CAN adapter on a serial line: the kernel's slcan on a pseudo-terminal, its other end in this program, on can0.

What an adapter's firmware does: lines of Lawicel's protocol in, frames out, and the other way. Words on standard input
make its controller error passive (`passive`), take it off the bus (`off`), or put it back (`active`).
"""

from __future__ import annotations

import fcntl
import os
import pty
import select
import struct
import sys
import termios
import tty

import can

from vm.guest.system import set_priority

N_SLCAN = 17
"""Line discipline, linux/tty.h."""
SIOCGIFNAME, IFNAMSIZ = 0x8910, 16
"""linux/sockios.h, linux/if.h: of a terminal the interface that its line discipline has made."""
STATES = {"passive": b"e1a\rsp128000\r", "off": b"sb256000\r", "active": b"sa000000\r"}
"""drivers/net/can/slcan: an error frame (no acknowledge), the state, its counters of sent and received errors."""
OPEN = b"O"
PRIORITY = 55
"""SCHED_FIFO: hardware, as the simulated drives."""


def frame_of(line: bytes) -> can.Message | None:
    """`t1232AABB`: a frame with an 11-bit identifier. None: a command, which needs no answer."""
    if line[:1] != b"t":
        return None
    length = int(line[4:5])
    data = bytes.fromhex(line[5 : 5 + 2 * length].decode())
    return can.Message(arbitration_id=int(line[1:4], 16), is_extended_id=False, data=data)


def line_of(message: can.Message) -> bytes:
    """The same as text."""
    return f"t{message.arbitration_id:03X}{message.dlc}{bytes(message.data).hex().upper()}\r".encode()


class Adapter:
    """Between the terminal's end and the bus. In any state but `active` nothing passes."""

    def __init__(self, terminal: int, bus: can.BusABC) -> None:
        self._terminal, self._bus = terminal, bus
        self._passes = True
        self._rest = b""

    def run(self) -> None:
        """Until standard input ends."""
        while True:
            ready, _, _ = select.select([self._terminal, self._bus.fileno(), sys.stdin.fileno()], [], [])
            if self._terminal in ready:
                self._from_kernel()
            if self._bus.fileno() in ready:
                self._from_bus()
            if sys.stdin.fileno() in ready and not self._obey(sys.stdin.readline().strip()):
                return

    def _from_kernel(self) -> None:
        *lines, self._rest = (self._rest + os.read(self._terminal, 4096)).split(b"\r")
        for line in lines:
            frame = frame_of(line)
            if line == OPEN:
                self._passes = True
            elif frame is not None and self._passes:
                self._bus.send(frame)

    def _from_bus(self) -> None:
        message = self._bus.recv(0.0)
        if message is not None and self._passes and not message.is_error_frame:
            os.write(self._terminal, line_of(message))

    def _obey(self, word: str) -> bool:
        if word in STATES:
            os.write(self._terminal, STATES[word])
            self._passes = word == "active"
        return bool(word)


def main() -> None:
    """Prints the interface's name. It exists as long as this runs."""
    ours, kernels = pty.openpty()
    for end in (ours, kernels):
        tty.setraw(end)
    fcntl.ioctl(kernels, termios.TIOCSETD, struct.pack("i", N_SLCAN))
    name = fcntl.ioctl(kernels, SIOCGIFNAME, bytes(IFNAMSIZ))
    print(name.partition(b"\0")[0].decode(), flush=True)
    set_priority(os.getpid(), PRIORITY)
    with can.Bus(interface="socketcan", channel="can0") as bus:
        Adapter(ours, bus).run()


if __name__ == "__main__":
    main()
