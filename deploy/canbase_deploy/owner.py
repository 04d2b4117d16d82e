"""The owner's files in /etc/canbase: robot.yaml, its environment, and files of his own that robot.yaml names. Pure."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import PurePosixPath
from typing import Final

from canbase_runtime import which_robot
from canbase_runtime.which_robot import USER as USER

ETC: Final = PurePosixPath(which_robot.ETC)
OURS: Final = (ETC / "can", ETC / "installed")
"""Folders in which no file is the owner's."""
RESERVED: Final = (*OURS, ETC / "keys")
YAML: Final = (".yaml", ".yml")
"""What robot.yaml may name. All else in /etc/canbase, such as the environment of the services, is no file of it."""
_REFERENCE: Final = re.compile(r"[A-Za-z0-9_.+/-]+")


def owner_paths(name: str) -> tuple[PurePosixPath, PurePosixPath]:
    """robot.yaml and environment of a robot: an upgrade and an ordinary `uninstall` keep them."""
    return ETC / f"{name}.yaml", ETC / f"{name}.env"


def is_the_owners(path: PurePosixPath) -> bool:
    """Whether the owner edits this file: all in /etc/canbase but what is ours."""
    return path.is_relative_to(ETC) and not any(path.is_relative_to(folder) for folder in OURS)


def old(path: PurePosixPath) -> PurePosixPath:
    """Where a file is kept when another one takes its place."""
    return path.with_name(f"{path.name}.old")


def place(reference: str) -> PurePosixPath:
    """Where a file that robot.yaml names by a relative path has to be for the installed robot.yaml."""
    return ETC / reference


def misplaced(reference: str) -> str:
    """Why this file cannot be brought beside the installed robot.yaml, and what to do; empty: it can."""
    path = place(reference)
    if ".." in path.parts:
        return f"robot.yaml names {reference}: expected a file beside robot.yaml or in a folder below it; move it there"
    if not _REFERENCE.fullmatch(reference):
        return f"robot.yaml names {reference!r}: expected letters, digits and _ . + - in its name; rename it"
    if path.suffix not in YAML:
        return f"robot.yaml names {reference}: expected a name that ends with .yaml or .yml; rename it"
    if any(path.is_relative_to(folder) for folder in RESERVED):
        return f"robot.yaml names {reference}: {path.parent} is taken; expected another folder, such as drives"
    return ""


def modes(paths: Iterable[PurePosixPath]) -> str:
    """For tmpfiles.d: the services may read these files and enter their folders, others may not."""
    files = sorted(set(paths))
    folders = sorted({folder for path in files for folder in path.parents if ETC in folder.parents})
    return "".join(f"d {folder} 0750 root {USER}\n" for folder in folders) + "".join(
        f"z {path} 0640 root {USER}\n" for path in files
    )
