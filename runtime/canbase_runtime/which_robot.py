"""Which robot a command means: one rule for all commands.

1. `--config FILE`, or a FILE that a command takes; else the environment variable CANBASE_ROBOT.
2. Else the robot that runs or is installed on this computer. Of several none is meant; and none at all where one runs
   and its file cannot be seen, or where it cannot be seen whether one is installed.
3. Else robot.yaml in the current folder, if it belongs to this user, and nobody else may write it or its folder.
4. Else none: the sample of the bench is meant only where `--bench` names it.
"""

from __future__ import annotations

import os
import pwd
import re
import stat
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from canbase_base.single_instance import holder_at
from canbase_runtime import own_process

VARIABLE: Final = "CANBASE_ROBOT"
ETC: Final = Path("/etc/canbase")
"""robot.yaml of each robot that `canbase setup install` has installed, as NAME.yaml; `installed/NAME.txt` lists its
files."""
USER: Final = "canbase"
"""The user of the services."""
SOCKETS: Final = Path("/proc/net/unix")
TASKS: Final = ("@canbase.driver.", "@canbase.velocity process.")
"""Abstract sockets of the processes that have robot.yaml on their command line."""
NAME_IT: Final = f"Name the robot: --config FILE, or {VARIABLE}=FILE"
OTHERS: Final = f"{NAME_IT}, or put its robot.yaml in this folder. `canbase up --bench` starts a simulated one"


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
        raise NoRobotError(f"several robots are on this computer: {listed}. {NAME_IT}")
    for path, why in here.items():
        return Meant(path, why)
    if local is not None:
        return Meant(local, "in this folder")
    raise NoRobotError(
        f"no robot is named, and none of this user runs or is installed here{refused and f', and {refused}'}. {OTHERS}"
    )


def which_robot(given: Path | None) -> Meant:
    """The robot.yaml that a command means. Raises NoRobotError."""
    variable = os.environ.get(VARIABLE, "")
    if given is not None or variable:
        return choose(given, variable, {}, None, "")
    local, refused = in_folder(Path.cwd() / "robot.yaml")
    here = installed()
    return choose(None, "", {**here, **running(here)}, local, refused)


def installed(etc: Path = ETC) -> dict[Path, str]:
    """Robots that are installed. Raises NoRobotError where this user may not see whether there are any."""
    try:
        names = os.listdir(etc / "installed")
    except FileNotFoundError:
        return {}
    except OSError as error:
        why = f"{etc}: {error.strerror}: only root and the group {USER} see whether a robot is installed"
        raise NoRobotError(f"{why}. {NAME_IT}") from error
    return {etc / f"{name.removesuffix('.txt')}.yaml": "installed" for name in names if name.endswith(".txt")}


def running(known: Collection[Path], sockets: Path = SOCKETS, proc: Path = own_process.PROC) -> dict[Path, str]:
    """Robots whose driver or velocity process runs here, started by root, the services' user or this one. Raises
    NoRobotError where one of those, or of the user behind `sudo`, has a file that this user does not see or trust.

    `known`: files of installed robots, whose services name them to everybody. Another user may bind such a name too:
    that is no robot of this user's.
    """
    found = {}
    for name in _names(sockets):
        try:
            holder = holder_at(f"\0{name[1:]}")
        except OSError as error:
            raise NoRobotError(
                f"a robot runs here, and its file cannot be seen ({error.strerror}). {NAME_IT}"
            ) from error
        if holder is None or holder[1] not in _users() | _behind_sudo():
            continue
        pid, user = holder
        path = _config_of(proc / str(pid))
        why = "" if path in known else own_process.refusal(pid, _users(), proc) or _elsewhere(path, proc / str(pid))
        if path is None or why:
            raise NoRobotError(f"a robot of user {user} runs here; its file cannot be used: {why}. {NAME_IT}")
        found[path] = "runs here"
    return found


def in_folder(path: Path) -> tuple[Path | None, str]:
    """`path` if it is a file of this user, which nobody else may write or replace; else None, and why it does not
    count, empty where there is nothing."""
    try:
        file, folder = path.lstat(), path.parent.stat()
    except OSError:
        return None, ""
    if not stat.S_ISREG(file.st_mode):
        return None, f"{path} is no regular file"
    if file.st_uid != os.geteuid():
        return None, f"{path} belongs to user {file.st_uid}"
    if folder.st_uid not in (0, os.geteuid()) or _others_write(file) or _others_write(folder):
        return None, f"others may write {path} or its folder"
    return path, ""


def _others_write(found: os.stat_result) -> bool:
    """A group of the owner alone, of the same number, is nobody else."""
    return bool(found.st_mode & stat.S_IWOTH) or bool(found.st_mode & stat.S_IWGRP and found.st_gid != found.st_uid)


def _names(sockets: Path) -> Iterator[str]:
    """Abstract sockets of canbase's tasks: the eighth word of a line, which may contain spaces."""
    try:
        lines = sockets.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return
    words = (line.split(maxsplit=7) for line in lines)
    yield from {each[7] for each in words if len(each) == 8 and each[7].startswith(TASKS)}


def _users() -> set[int]:
    try:
        service = {pwd.getpwnam(USER).pw_uid}
    except KeyError:
        service = set()
    return {0, os.geteuid()} | service


def _behind_sudo() -> set[int]:
    user = os.environ.get("SUDO_UID", "")
    return {int(user)} if user.isdecimal() else set()


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


def _elsewhere(path: Path | None, process: Path) -> str:
    """Why this is no file of this computer as that process sees it, which may be in a container; empty: it is."""
    if path is None:
        return f"process {process.name} names none"
    try:
        same = path.samefile(f"{process}/root{path}")
    except OSError as error:
        return f"{path}: {error.strerror}"
    return "" if same else f"process {process.name} sees another {path}"
