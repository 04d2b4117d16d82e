"""Which robot a command means: one rule for all commands.

1. `--config FILE`, or a FILE that a command takes; else the environment variable CANBASE_ROBOT.
2. Else the robot that runs or is installed on this computer. Of several none is meant.
3. Else robot.yaml in the current folder, if it belongs to this user.
4. Else none: the sample of the bench is meant only where `--bench` names it.
"""

from __future__ import annotations

import os
import pwd
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from canbase_runtime import own_process
from canbase_runtime.single_instance import holder_at

VARIABLE: Final = "CANBASE_ROBOT"
ETC: Final = Path("/etc/canbase")
"""robot.yaml of each robot that `canbase setup install` has installed, as NAME.yaml; `installed/NAME.txt` lists its
files."""
USER: Final = "canbase"
"""The user of the services."""
SOCKETS: Final = Path("/proc/net/unix")
TASKS: Final = ("@canbase.driver.", "@canbase.velocity process.")
"""Abstract sockets of the processes that have robot.yaml on their command line."""
WAYS: Final = (
    "Name one: --config FILE, or the environment variable CANBASE_ROBOT. Without both it is the robot that runs or is "
    "installed here, or robot.yaml in this folder. `canbase up --bench` starts a simulated one"
)


_NAMED: Final = re.compile(
    "[\0/](?:driver|velocity|motor_driver|velocity_mux)\0(?:.*\0)?(?:--config|-c)(?:\0|=)([^\0]+)", re.DOTALL
)
"""Also as `ros2 run` and launch files call them."""


class NoRobotError(Exception):
    """No robot is meant, or more than one; the text has the ways to name one."""


@dataclass(frozen=True, slots=True)
class Meant:
    """The robot.yaml that is meant. `why`: for people; empty where the command line names it."""

    path: Path
    why: str = ""


def choose(given: Path | None, variable: str, here: Mapping[Path, str], local: Path | None, refused: str) -> Meant:
    """The rule. Raises NoRobotError.

    `here`: robots of this computer, each with what it does here. `local`: robot.yaml of the current folder; None: there
    is none that counts, and `refused` says why, where there is one.
    """
    if given is not None:
        return Meant(given)
    if variable:
        return Meant(Path(variable), VARIABLE)
    if len(here) > 1:
        listed = "; ".join(f"{path} ({why})" for path, why in sorted(here.items()))
        raise NoRobotError(f"several robots are on this computer: {listed}. Name one: --config FILE, or {VARIABLE}")
    for path, why in here.items():
        return Meant(path, why)
    if local is not None:
        return Meant(local, "in this folder")
    raise NoRobotError(f"no robot is named, runs or is installed here{refused and f', and {refused}'}. {WAYS}")


def which_robot(given: Path | None) -> Meant:
    """The robot.yaml that a command means. Raises NoRobotError."""
    variable = os.environ.get(VARIABLE, "")
    if given is not None or variable:
        return choose(given, variable, {}, None, "")
    local, refused = in_folder(Path.cwd() / "robot.yaml")
    return choose(None, "", {**installed(), **running()}, local, refused)


def installed(etc: Path = ETC) -> dict[Path, str]:
    """Robots that are installed. Raises NoRobotError where this user may not see whether there are any."""
    try:
        names = os.listdir(etc / "installed")
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise NoRobotError(f"{etc}: {error.strerror}: whether a robot is installed cannot be seen. {WAYS}") from error
    return {etc / f"{name.removesuffix('.txt')}.yaml": "installed" for name in names if name.endswith(".txt")}


def running(sockets: Path = SOCKETS, proc: Path = own_process.PROC) -> dict[Path, str]:
    """Robots whose driver or velocity process runs here, started by root, the services' user or this one."""
    pids = {pid for name in _names(sockets) if (pid := _holder(name)) is not None}
    ours = [pid for pid in sorted(pids) if not own_process.refusal(pid, _users(), proc)]
    return {path: "runs here" for pid in ours if (path := _config_of(proc / str(pid))) is not None}


def in_folder(path: Path) -> tuple[Path | None, str]:
    """`path` if it is a file of this user; else None, and why it does not count, empty where there is nothing."""
    try:
        owner = path.stat().st_uid
    except OSError:
        return None, ""
    if owner != os.geteuid():
        return None, f"{path} belongs to user {owner}"
    return path, ""


def _names(sockets: Path) -> Iterator[str]:
    """Abstract sockets of canbase's tasks: the eighth word of a line, which may contain spaces."""
    try:
        lines = sockets.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return
    words = (line.split(maxsplit=7) for line in lines)
    yield from {each[7] for each in words if len(each) == 8 and each[7].startswith(TASKS)}


def _holder(name: str) -> int | None:
    """Its process; None: it has ended, or its queue of callers is full."""
    try:
        return holder_at(f"\0{name[1:]}")
    except OSError:
        return None


def _users() -> set[int]:
    try:
        service = {pwd.getpwnam(USER).pw_uid}
    except KeyError:
        service = set()
    return {0, os.geteuid()} | service


def _config_of(process: Path) -> Path | None:
    """The robot.yaml on its command line; None: it has none, or cannot be looked at."""
    try:
        line = (process / "cmdline").read_bytes().decode(errors="surrogateescape")
        named = _NAMED.search(line)
        if named is None:
            return None
        path = Path(named[1])
        return path if path.is_absolute() else Path(os.readlink(process / "cwd")) / path
    except OSError:
        return None
