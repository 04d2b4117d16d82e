"""Watchdog: from the moment at which a lease runs out to the quick stop frame, as another process on the bus sees it.

A real watchdog process on the virtual bus, and a robot that is faked here: it drives, its leases end, it is stopped and
reset, again and again. The floor, in turn with it: a process that only waits for that time and sends one frame.
"""

from __future__ import annotations

import json
import os
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path

import can

from canbase_config.derive import watchdog_config
from canbase_config.load import load_robot, sample
from canbase_velocity.lease import lease_datagram
from canbase_velocity.twist import Twist
from figures import Figure, quantile, raise_priority, spread
from support.ros_harness import clear_records
from support.udp_port import free_udp_port

TRIPS = 1000
LEASE_S = 0.05
CYCLE_S = 0.01
ENABLED, OFF = 0x0237, 0x0240
SPEED_BITS = 1000
QUICK_STOP, FLOOR, STATE, RESET = 0x501, 0x510, 0x1FE, 0x27E
WATCHING, TRIPPED = 1, 2
BUDGET_P99_S, BUDGET_MAX_S = 0.002, 0.010

FLOOR_CODE = """
import json, os, select, socket, sys, time, can
arguments, path, wait_s = json.loads(sys.argv[1]), sys.argv[2], float(sys.argv[3])
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(40))
except OSError:
    pass
inbox = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
inbox.bind(path)
message = can.Message(arbitration_id=0x510, data=b"", is_extended_id=False)
with can.Bus(**arguments) as bus:
    while True:
        inbox.recv(16)
        end = time.monotonic() + wait_s
        select.select([], [], [], end - time.monotonic())
        bus.send(message)
"""


class FakeRobot:
    """Driver, filter and both drives as far as the watchdog looks at them."""

    def __init__(self, bus: can.BusABC, lease_path: str) -> None:
        self._bus, self._path = bus, lease_path
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._sequence, self._cycle, self._counts = 0, 0, 0.0
        self._cycle_at = time.monotonic()
        self.speed = 0
        self.state, self.answered = 0, 0

    def close(self) -> None:
        """Closes its lease socket."""
        self._socket.close()

    def lease(self) -> float:
        """Sends one; when it was sent (time.monotonic)."""
        self._sequence += 1
        twist = Twist(0.1 if self.speed else 0.0, 0.0)
        self._socket.sendto(lease_datagram(self._sequence, time.monotonic_ns(), twist, brakes_hard=False), self._path)
        return time.monotonic()

    def until(self, done: Callable[[can.Message | None], bool], leases: bool = True) -> float:
        """Cycles, with leases or without, until `done` of a frame; when that was (time.monotonic)."""
        end_s = time.monotonic() + 3.0
        while True:
            message = self._bus.recv(max(0.0, self._cycle_at - time.monotonic()))
            now_s = time.monotonic()
            self._note(message)
            if done(message):
                return now_s
            if now_s >= end_s:
                raise TimeoutError(f"nothing came for 3 s; the watchdog is in state {self.state}")
            if now_s >= self._cycle_at:
                self._cycle_at = max(self._cycle_at + CYCLE_S, now_s)
                self._drive()
                if leases and self._cycle % 2 == 0:
                    self.lease()

    def for_s(self, duration_s: float, leases: bool = True) -> None:
        """Cycles for this long."""
        end_s = time.monotonic() + duration_s
        self.until(lambda _: time.monotonic() >= end_s, leases)

    def reset(self, number: int) -> None:
        """Until the watchdog watches again."""
        self.send(RESET, bytes([number]) + b"RST")
        self.until(lambda _: self.state == WATCHING and self.answered == number)

    def send(self, cob_id: int, data: bytes) -> None:
        """One frame."""
        self._bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))

    def _note(self, message: can.Message | None) -> None:
        if message is not None and message.arbitration_id == STATE:
            self.state, self.answered = message.data[0], message.data[6]

    def _drive(self) -> None:
        self._cycle += 1
        self._counts += self.speed * COUNTS_PER_BIT_CYCLE
        word, status = (0x0F, ENABLED) if self.speed else (0x06, OFF)
        if self._cycle % 10 == 0:
            self.send(0x77F, b"\x05")
            self.send(0x701, b"\x05")
            self.send(0x702, b"\x05")
        for node, sign in ((1, 1), (2, -1)):
            self.send(0x200 + node, struct.pack("<Hi", word, sign * self.speed))
        self.send(0x080, b"")
        for node, sign in ((1, 1), (2, -1)):
            self.send(0x180 + node, struct.pack("<Hi", status, sign * round(self._counts)))
            self.send(0x280 + node, struct.pack("<i", sign * self.speed))


COUNTS_PER_BIT_CYCLE = 0.1 / 60.0 * 4096 * CYCLE_S
"""Encoder of the sample robot: 0.1 rpm a bit, 4096 counts a revolution."""


def measure(trips: int = TRIPS) -> list[Figure]:
    """The figure; each trip takes about 0.3 s."""
    raise_priority(45)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="canbase-", dir="/tmp")))
        robot = load_robot(sample("bench")).robot
        arguments = robot.bus.arguments() | {"port": free_udp_port()}
        bus = stack.enter_context(can.Bus(**arguments))
        config = watchdog_config(robot)
        path = str(folder / "lease")
        config = replace(config, bus_arguments=arguments, lease_socket=path, lease_timeout_s=LEASE_S)
        os.environ.update(clear_records(folder, config.robot))
        _child(stack, ["-m", "canbase_watchdog", "--config-json", config.to_json()])
        floor_path = str(folder / "floor")
        _child(stack, ["-c", FLOOR_CODE, json.dumps(arguments), floor_path, str(LEASE_S)])
        floor = stack.enter_context(closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)))
        fake = stack.enter_context(closing(FakeRobot(bus, path)))
        while not (Path(path).exists() and Path(floor_path).exists()):
            time.sleep(0.05)
        fake.until(lambda _: fake.state == WATCHING)
        ours, theirs = [], []
        for trip in range(trips):
            ours.append(_trip(fake))
            theirs.append(_floor(fake, floor, floor_path))
            fake.reset(trip % 255 + 1)
    kept = quantile(ours, 0.99) <= BUDGET_P99_S and max(ours) <= BUDGET_MAX_S
    ratio = quantile(ours, 0.99) / quantile(theirs, 0.99)
    what = f"watchdog: a lease runs out → quick stop frame seen on the bus, {trips} trips"
    beside = f"a process that waits as long and sends one frame: {spread(theirs)}"
    return [Figure(what, spread(ours), beside, ratio, "p99 ≤ 2 ms, max ≤ 10 ms", kept)]


def _trip(robot: FakeRobot) -> float:
    """From the end of the last lease to the frame [s]."""
    robot.speed = SPEED_BITS
    robot.for_s(0.045)
    expires_s = robot.lease() + LEASE_S
    seen_s = robot.until(lambda m: m is not None and m.arbitration_id == QUICK_STOP, leases=False)
    robot.speed = 0
    return seen_s - expires_s


def _floor(robot: FakeRobot, floor: socket.socket, path: str) -> float:
    robot.for_s(0.025)
    floor.sendto(b"", path)
    expires_s = time.monotonic() + LEASE_S
    return robot.until(lambda m: m is not None and m.arbitration_id == FLOOR) - expires_s


def _child(stack: ExitStack, arguments: list[str]) -> None:
    environment = os.environ | {"_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}
    child = subprocess.Popen([sys.executable, *arguments], env=environment, stderr=subprocess.DEVNULL)
    stack.callback(child.wait)
    stack.callback(child.kill)


if __name__ == "__main__":
    for figure in measure(int(sys.argv[1]) if len(sys.argv) > 1 else TRIPS):
        print(figure)
