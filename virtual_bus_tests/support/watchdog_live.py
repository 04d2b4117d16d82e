"""The small robot of the watchdog's unit tests in real time: a thread on a python-can bus and a lease socket."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

import can

from canbase_watchdog.frames import Frame
from support.watchdog_story import FakeDrive, lease

TURN_S = 0.002
TRIPPED = 2
TO_THE_DRIVES = (0x000, 0x501, 0x502, 0x601, 0x602)


class LiveRobot:
    """Two drives, a driver at 100 Hz that obeys the watchdog, a filter at 50 Hz. Its fields switch them off."""

    def __init__(self, bus_arguments: dict[str, Any], lease_socket: str) -> None:
        self._bus = can.Bus(**bus_arguments)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._path = lease_socket
        self._thread = threading.Thread(target=self._run)
        self._going = True
        self.drives = (FakeDrive(1), FakeDrive(2))
        self.driver = self.filter = True
        self.word, self.speed, self.leased = 0x06, 0, 0
        self.last_lease = self.last_heartbeat = 0.0
        self.heard: list[tuple[float, Frame]] = []
        """What came on the bus from the watchdog, with the monotonic time of its arrival."""

    def __enter__(self) -> LiveRobot:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._going = False
        self._thread.join()
        self._socket.close()
        self._bus.shutdown()

    def drive_at(self, bits: int, timeout_s: float = 5.0) -> None:
        """Enable, and return when both wheels turn so fast. The filter orders first, then the driver obeys."""
        ordered_s, self.leased = time.monotonic(), bits
        self.wait_for(lambda: self.last_lease > ordered_s, timeout_s)
        self.word, self.speed = 0x0F, bits
        self.wait_for(lambda: all(abs(drive.speed[0] - bits) < 1 for drive in self.drives), timeout_s)

    def wait_until_still(self, timeout_s: float = 3.0) -> float:
        """Monotonic time [s] at which both wheels stood."""
        self.wait_for(lambda: all(abs(drive.speed[0]) < 1 for drive in self.drives), timeout_s)
        return time.monotonic()

    def wait_for(self, condition: Callable[[], object], timeout_s: float) -> None:
        """Look every 2 ms; fails after `timeout_s`."""
        end = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end, f"not within {timeout_s} s; heard last {self.heard[-5:]}"
            time.sleep(TURN_S)

    def first(self, cob_id: int, since: float, timeout_s: float = 3.0) -> tuple[float, Frame]:
        """The first frame with this identifier after `since`."""

        def found() -> list[tuple[float, Frame]]:
            return [(at, frame) for at, frame in list(self.heard) if at >= since and frame.cob_id == cob_id]

        self.wait_for(found, timeout_s)
        return found()[0]

    def _run(self) -> None:
        turn, before, sequence = 0, time.monotonic(), 0
        while self._going:
            self._listen(before + TURN_S)
            now_s = time.monotonic()
            for drive in self.drives:
                self._send(drive.step(now_s - before, now_s))
            if self.driver and turn % 5 == 0:
                self._drive(turn, now_s)
            if self.filter and turn % 10 == 0:
                sequence += 1
                self._lease(sequence, now_s)
            turn, before = turn + 1, now_s

    def _listen(self, until: float) -> None:
        while (left := until - time.monotonic()) > 0:
            message = self._bus.recv(left)
            if message is None:
                continue
            frame = Frame(message.arbitration_id, bytes(message.data))
            if frame.cob_id in (*TO_THE_DRIVES, 0x1FE, 0x77E):
                self.heard.append((time.monotonic(), frame))
            if frame.cob_id in TO_THE_DRIVES:
                self._tell_drives(frame)
            if frame.cob_id == 0x1FE and frame.data[0] == TRIPPED:
                self.word, self.speed, self.leased = 0x00, 0, 0

    def _tell_drives(self, frame: Frame) -> None:
        for drive in self.drives:
            self._send(drive.on_frame(frame))

    def _drive(self, turn: int, now_s: float) -> None:
        out = [Frame(0x200 + drive.node_id, struct.pack("<Hi", self.word, self.speed)) for drive in self.drives]
        out.append(Frame(0x080, b""))
        if turn % 50 == 0:
            self.last_heartbeat = now_s
            out.insert(0, Frame(0x77F, b"\x05"))
        self._send(out)
        for frame in out:
            self._tell_drives(frame)

    def _lease(self, sequence: int, now_s: float) -> None:
        try:
            self._socket.sendto(lease(sequence, now_s, self.leased / 1000), self._path)
        except (FileNotFoundError, ConnectionRefusedError, BlockingIOError):
            return
        self.last_lease = now_s

    def _send(self, frames: list[Frame]) -> None:
        for frame in frames:
            self._bus.send(can.Message(arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False))
