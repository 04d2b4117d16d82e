"""Where the sockets of a user belong: $XDG_RUNTIME_DIR (XDG Base Directory Specification), in robot.yaml too."""

from __future__ import annotations

import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Any

VARIABLE = "$XDG_RUNTIME_DIR/"


def placed(path: str, environment: Mapping[str, str], uid: int) -> str:
    """`path`, with $XDG_RUNTIME_DIR at its beginning replaced; any other path as it is.

    It counts if it belongs to the user `uid` alone; else /run/user/UID does. Without either the first folder of the
    path goes to /tmp with the number of the user in its name; the process that creates it must check its owner.
    """
    if not path.startswith(VARIABLE):
        return path
    rest = path.removeprefix(VARIABLE)
    for folder in (environment.get("XDG_RUNTIME_DIR", ""), f"/run/user/{uid}"):
        if folder.startswith("/") and _is_own(Path(folder), uid):
            return f"{folder.rstrip('/')}/{rest}"
    return f"/tmp/user{uid}-{rest}"


def with_runtime_folder(values: Mapping[str, Any], environment: Mapping[str, str], uid: int) -> dict[str, Any]:
    """The content of a robot.yaml, with `lease.socket` placed. What is of another type is left to the model."""
    lease = values.get("lease")
    if not isinstance(lease, dict) or not isinstance(lease.get("socket"), str):
        return dict(values)
    return {**values, "lease": {**lease, "socket": placed(lease["socket"], environment, uid)}}


def _is_own(folder: Path, uid: int) -> bool:
    try:
        found = folder.stat()
    except OSError:
        return False
    return stat.S_ISDIR(found.st_mode) and found.st_uid == uid and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
