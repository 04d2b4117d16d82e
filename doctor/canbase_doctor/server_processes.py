"""Finds the processes of the action server on this computer, and what decides which peers they reach. Reads /proc."""

from __future__ import annotations

import contextlib
import os
import pwd
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from canbase_config.errors import ConfigError
from canbase_config.yaml_file import read_yaml
from canbase_doctor.evidence import ServerProcess
from canbase_runtime.own_process import refusal

PROC = Path("/proc")
DECIDES = ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_STATIC_PEERS", "RMW_IMPLEMENTATION")


def server_processes(proc: Path = PROC) -> tuple[ServerProcess, ...]:
    """Those of this user and of the services; a stranger's process is none, whatever it is called."""
    return tuple(ServerProcess(pid, talks_by(pid, proc), _robot(pid, proc)) for pid in sorted(_pids(proc)))


def talks_by(pid: int | str, proc: Path = PROC) -> dict[str, str]:
    """The variables of DECIDES that the process was started with. Without the right to look: none."""
    pairs = (line.partition("=") for line in _words(proc / str(pid) / "environ"))
    return {name: value for name, _, value in pairs if name in DECIDES}


def _words(path: Path) -> list[str]:
    """Of a list in /proc; none without the right to look, or when the process ended meanwhile."""
    try:
        return path.read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return []


def _robot(pid: int, proc: Path) -> str:
    """The name in the robot.yaml that a process was started with; empty: unknown."""
    words = _words(proc / str(pid) / "cmdline")
    given = next((file for word, file in pairwise(words) if word in ("--config", "-c")), "")
    try:
        return str(read_yaml(proc / str(pid) / "cwd" / given).values.get("name", "")) if given else ""
    except (ConfigError, OSError):
        return ""


def _pids(proc: Path) -> Iterator[int]:
    for folder in proc.glob("[0-9]*"):
        words = _words(folder / "cmdline")
        if int(folder.name) != os.getpid() and _is_server(words) and not refusal(int(folder.name), _users(), proc):
            yield int(folder.name)


def _users() -> set[int]:
    """Who starts canbase here: this user, and the services' user."""
    users = {os.geteuid()}
    with contextlib.suppress(KeyError):
        users.add(pwd.getpwnam("canbase").pw_uid)
    return users


def _is_server(words: list[str]) -> bool:
    """By `canbase`, by Python, by `ros2 run` and launch files."""
    by_ros = any(word.endswith("/lib/canbase/drive_distance_server") for word in words)
    by_canbase = "action-server" in words and any("canbase" in word for word in words)
    return by_ros or by_canbase or "canbase_action_server.main" in " ".join(words)
