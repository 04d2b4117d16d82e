"""The real process of the watchdog on a bus of its own, beside the small robot of `watchdog_live.py`."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from support.ros_harness import clear_records
from support.udp_port import free_udp_port
from support.watchdog_live import LiveRobot
from support.watchdog_story import config


class Watched:
    """The process, the robot, and a stand-in for systemd's notify socket."""

    def __init__(self, folder: Path, stderr: int = subprocess.PIPE) -> None:
        bus = {"interface": "udp_multicast", "channel": "239.74.163.2", "port": free_udp_port(), "hop_limit": 0}
        self.config = replace(config(), bus_arguments=bus, lease_socket=str(folder / "run" / "lease"))
        self.systemd = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.systemd.bind(str(folder / "notify"))
        self.systemd.setblocking(False)
        self.robot = LiveRobot(bus, self.config.lease_socket)
        self.state = clear_records(folder, self.config.robot)
        self._notify, self._stderr = str(folder / "notify"), stderr
        self.process = self.start()

    def start(self) -> subprocess.Popen[str]:
        """The process, once more."""
        environment = {"NOTIFY_SOCKET": self._notify, "_ROS_WHEELS_BOOTSTRAP_COMPLETE": "1"}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "canbase_watchdog", "--config-json", self.config.to_json()],
            env=os.environ | environment | self.state,
            stderr=self._stderr,
            text=True,
        )
        return self.process

    def notified(self) -> list[str]:
        """What systemd was told since the last call."""
        lines = []
        while True:
            try:
                lines.append(self.systemd.recv(1024).decode())
            except BlockingIOError:
                return lines

    def end(self, number: signal.Signals) -> tuple[int, str]:
        """By a signal: exit code and log."""
        self.process.send_signal(number)
        _, log = self.process.communicate(timeout=5.0)
        return self.process.returncode, log


@contextmanager
def watched_process(folder: Path) -> Iterator[Watched]:
    """From the process' first state frame on; killed at the end."""
    it = Watched(folder)
    try:
        with it.robot:
            it.robot.first(0x1FE, 0.0, timeout_s=10.0)
            yield it
    finally:
        it.process.kill()
        it.process.communicate()
        it.systemd.close()
