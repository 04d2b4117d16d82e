"""The code that is installed here: one hash, so that results of tests are known to be of exactly this code."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from canbase_runtime.version import is_compiled

PACKAGES: Final = (
    "canbase_config",
    "canbase_base",
    "canbase_runtime",
    "canbase_driver",
    "canbase_velocity",
    "canbase_watchdog",
    "canbase_action_server",
)
"""What runs on a robot."""
COMPILED: Final = "-compiled"
"""Behind the hash where the modules run compiled."""
_SUFFIXES: Final = (".py", ".yaml", ".eds")


@cache
def code_sha256() -> str:
    """SHA-256 in hex of all modules, drive profiles and EDS files of PACKAGES, COMPILED behind it where they are.

    A source tree and a wheel that was made of it have the same.
    """
    return tree_sha256({package: _folder(package) for package in PACKAGES}) + (COMPILED if is_compiled() else "")


def tree_sha256(folders: Mapping[str, Path]) -> str:
    """Of names and contents of the files in some packages, wherever these lie. `folders`: by the package's name."""
    digest = hashlib.sha256()
    for package, folder in folders.items():
        files = (file for file in folder.rglob("*") if file.suffix in _SUFFIXES)
        for name in sorted(file.relative_to(folder).as_posix() for file in files):
            digest.update(f"{package}/{name}\0".encode() + hashlib.sha256((folder / name).read_bytes()).digest())
    return digest.hexdigest()


def _folder(package: str) -> Path:
    found = find_spec(package)
    if found is None or found.origin is None:
        raise ModuleNotFoundError(f"{package} is not installed", name=package)
    return Path(found.origin).parent
