"""What an installation consists of, as data: nothing here touches the machine. `execute.py` does."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from pathlib import PurePosixPath


class Existing(enum.Enum):
    """What happens to a file that is there already, with other contents."""

    REPLACE = "replace"
    """It is ours: the new one takes its place."""
    BACK_UP = "back up"
    """The new one takes its place; the old one stays beside it, with `.old` behind its name."""
    KEEP = "keep"
    """It is the owner's: it stays as it is."""


@dataclass(frozen=True, slots=True)
class WriteFile:
    """A file with these contents and this mode, owned by root and, if `group`, by that group."""

    path: PurePosixPath
    text: str
    mode: int = 0o644
    group: str = ""
    existing: Existing = Existing.REPLACE


@dataclass(frozen=True, slots=True)
class Link:
    """A symbolic link: how systemd notes that a unit is enabled."""

    path: PurePosixPath
    target: str


@dataclass(frozen=True, slots=True)
class Remove:
    """A file or link that is no longer wanted. Not being there is as good."""

    path: PurePosixPath


@dataclass(frozen=True, slots=True)
class Run:
    """A command for the running system; left out with a prefix. `may_fail`: the rest is carried out all the same."""

    argv: tuple[str, ...]
    may_fail: bool = False


@dataclass(frozen=True, slots=True)
class FirstRecords:
    """Clear records of stops for a robot that has never had any; left out with a prefix, for they are this computer's.

    `folder`: of this robot alone; where it is there already nothing is done. `user`: whom the services run as.
    """

    folder: PurePosixPath
    robot: str
    user: str


Action = WriteFile | Link | Remove | Run | FirstRecords
