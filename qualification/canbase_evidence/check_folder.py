"""Whether a folder of evidence is as it was written. Reads files; follows no links."""

from __future__ import annotations

import hashlib
import os
import stat
from pathlib import Path
from typing import Final

from canbase_evidence.hash_list import NAME, Difference, HashListError, differences, read

_CHUNK: Final = 1 << 20
_MOST_LIST_BYTES: Final = 10_000_000


def check(folder: Path) -> tuple[Difference, ...]:
    """What differs from the list. Raises HashListError and OSError."""
    listed = read(_list_text(folder / NAME))
    there = hashes(folder)
    there.pop(NAME, None)
    return differences(listed, there)


def list_sha256(folder: Path) -> str:
    """Of the list itself: what to write down elsewhere. Raises OSError."""
    return _sha256(folder / NAME)


def hashes(folder: Path) -> dict[str, str]:
    """Name relative to the folder → SHA-256 in hex. What is no regular file (a link, a FIFO) has no hash: its kind.

    Raises OSError for what cannot be read.
    """
    found: dict[str, str] = {}
    for at, folders, names in os.walk(folder, onerror=_raise):
        links = [name for name in folders if (Path(at) / name).is_symlink()]
        for name in [*names, *links]:
            path = Path(at) / name
            found[path.relative_to(folder).as_posix()] = _content(path)
    return found


def _content(path: Path) -> str:
    return _sha256(path) if stat.S_ISREG(path.lstat().st_mode) else "no regular file"


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK):
            digest.update(chunk)
    return digest.hexdigest()


def _list_text(path: Path) -> str:
    with path.open("rb") as file:
        content = file.read(_MOST_LIST_BYTES + 1)
    if len(content) > _MOST_LIST_BYTES:
        raise HashListError(f"longer than {_MOST_LIST_BYTES // 1_000_000} MB")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise HashListError(f"not UTF-8: {error.reason}") from error


def _raise(error: OSError) -> None:
    raise error
