"""Where the records of latched stops are, whose they are, and who could change them."""

from __future__ import annotations

import contextlib
import os
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from canbase_base.lasting import forgets

PARTS: Final = ("driver", "watchdog", "velocity")
SUFFIX: Final = ".latch"
_MACHINE: Final = (Path("/etc/machine-id"), Path("/sys/firmware/devicetree/base/serial-number"))
_OTHERS: Final = stat.S_IWGRP | stat.S_IWOTH


def latch_folder(environment: Mapping[str, str], home: Path, robot: str) -> Path:
    """Where the records of this robot are: the last of what systemd gives (StateDirectory=), else by the robot's name
    in the user's state folder."""
    given = environment.get("STATE_DIRECTORY", "").split(":")
    if len(given) > 1:
        return Path(given[-1])
    state = Path(environment.get("XDG_STATE_HOME") or home / ".local" / "state") / "canbase"
    return (Path(given[0]) if given[0] else state) / robot


def machine() -> str:
    """What identifies this computer: its machine-id, and the serial number of a board that has one."""
    found = []
    for path in _MACHINE:
        with contextlib.suppress(OSError):
            found.append(path.read_bytes().rstrip(b"\0\n").decode(errors="replace"))
    return " ".join(found)


def forgetful(path: Path) -> str:
    """The file system of that record that is not known to last over a reboot; empty: it lasts."""
    try:
        mounts = Path("/proc/self/mountinfo").read_text("utf-8", "replace")
    except OSError:
        mounts = ""
    return forgets(os.path.realpath(path.parent), mounts)


def wrong_access(descriptor: int, folder: int, path: Path) -> str:
    """Users besides root who could change the open record, in its open folder; empty: none."""
    file, parent, me = os.fstat(descriptor), os.fstat(folder), os.geteuid()
    if not stat.S_ISREG(file.st_mode):
        return f"{path} is no regular file"
    if file.st_uid != me:
        return f"{path} belongs to user {file.st_uid}, this is user {me}"
    if parent.st_uid not in (0, me):
        return f"{path.parent} belongs to user {parent.st_uid}, this is user {me}"
    if (file.st_mode | parent.st_mode) & _OTHERS:
        return f"others than user {me} may write {path} or its folder"
    return ""
