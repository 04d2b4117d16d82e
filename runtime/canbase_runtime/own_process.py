"""Whether a process is one of canbase, before it gets a signal or is described: by its user and its executable.

A process id and a command line are claims: anybody may bind a socket first, or call a program as canbase does.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Final

PROC: Final = Path("/proc")


class NotOursError(OSError):
    """The process is not one of canbase of this user. Its text has the reason."""


def refusal(pid: int, users: Collection[int], proc: Path = PROC) -> str:
    """Why this process is not one of canbase that one of these users has started; empty: it is one."""
    folder = proc / str(pid)
    try:
        user = folder.stat().st_uid
        executable = Path(os.readlink(folder / "exe"))
        words = (folder / "cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError as error:
        return f"process {pid} cannot be checked: {error.strerror or error}"
    if user not in users:
        return f"process {pid} belongs to user {user}"
    if not executable.name.startswith("python") and executable != Path(sys.executable).resolve():
        return f"process {pid} does not run Python"
    if not any("canbase" in word for word in words):
        return f"process {pid} does not run canbase"
    return ""


def send_signal(pid: int, number: signal.Signals) -> None:
    """To a process of canbase of this user alone. Raises NotOursError, and OSError where it has ended.

    The descriptor is taken before the check, so that another process with the same number gets nothing.
    """
    descriptor = os.pidfd_open(pid)
    try:
        if why := refusal(pid, (os.geteuid(),)):
            raise NotOursError(why)
        signal.pidfd_send_signal(descriptor, number)
    finally:
        os.close(descriptor)
