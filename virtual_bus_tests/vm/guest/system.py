"""The guest's system as scenarios use it: commands, units, signals. No ROS."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

PARTS: Final = ("watchdog", "driver", "velocity", "action-server")
TARGET: Final = "canbase@robot.target"
ROBOT_YAML: Final = Path("/etc/canbase/robot.yaml")
STACKS: Final = Path("/usr/lib/canbase-vm/stacks")
"""Programs of other authors, where somebody provides them: vm/independent_stacks.py."""
LIMIT_S: Final = 90.0
"""For a command."""


class BrokenPromiseError(AssertionError):
    """What a scenario promised did not come true."""


def unit(part: str, robot: str = "robot") -> str:
    """Name of a part's unit."""
    return f"canbase-{part}@{robot}.service"


def pids(robot: str = "robot") -> list[str]:
    """Main processes of the parts, in the order of PARTS; "0": it does not run."""
    return [show(unit(part, robot), "MainPID")[0] for part in PARTS]


def run(*words: str, check: bool = True) -> str:
    """What a command prints. Raises BrokenPromiseError when it fails, unless told not to."""
    done = subprocess.run(words, capture_output=True, text=True, timeout=LIMIT_S, check=False)
    if check and done.returncode != 0:
        raise BrokenPromiseError(f"{' '.join(words)}: exit code {done.returncode}: {done.stderr}{done.stdout}")
    return done.stdout.strip()


@contextmanager
def virtual_interface(name: str) -> Iterator[None]:
    """A CAN interface without a controller."""
    run("ip", "link", "add", name, "type", "vcan")
    try:
        run("ip", "link", "set", name, "up")
        yield
    finally:
        run("ip", "link", "del", name, check=False)


@contextmanager
def background(name: str, *command: str) -> Iterator[None]:
    """The command as a unit without a file, until it is left; what it prints is in the journal."""
    environment = ("--setenv=_ROS_WHEELS_BOOTSTRAP_COMPLETE=1", "--setenv=PYTHONUNBUFFERED=1")
    run("systemd-run", "--collect", f"--unit={name}", "--working-directory=/run", *environment, *command)
    try:
        yield
    finally:
        run("systemctl", "stop", name, check=False)


def show(name: str, *properties: str) -> list[str]:
    """Properties of a unit, in that order: one call of systemctl, which costs this processor 20 ms."""
    lines = run("systemctl", "show", f"--property={','.join(properties)}", name).splitlines()
    values = dict(line.partition("=")[::2] for line in lines)
    return [values[each] for each in properties]


def send_signal(part: str, number: signal.Signals, robot: str = "robot") -> tuple[float, str]:
    """A signal to a part's main process: when it was sent [s, monotonic], and the process."""
    (pid,) = show(unit(part, robot), "MainPID")
    now_s = time.monotonic()
    os.kill(int(pid), number)
    return now_s, pid


def set_priority(pid: int, priority: int) -> None:
    """SCHED_FIFO for all threads of a process."""
    for thread in Path(f"/proc/{pid}/task").iterdir():
        os.sched_setscheduler(int(thread.name), os.SCHED_FIFO, os.sched_param(priority))
