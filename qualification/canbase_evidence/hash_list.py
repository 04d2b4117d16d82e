"""The list of hashes of a folder, as `sha256sum -c` checks it, and what differs from it. Reads files; follows no links.

Names are plain here (new_folder.py gives them): no line ends, no backslashes, which sha256sum would write escaped.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

NAME: Final = "SHA256SUMS"
"""Of the list itself, which is not in it."""
_LINE: Final = re.compile(r"([0-9a-f]{64}) [ *](.+)")
_CHUNK: Final = 1 << 20
_MOST_LIST_BYTES: Final = 10_000_000


class HashListError(ValueError):
    """The text is no list of hashes; the message names the line."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One file that is not as it was listed. `what`: changed, added or removed."""

    name: str
    what: str


def text_of(hashes: Mapping[str, str]) -> str:
    """`hashes`: name relative to the folder → SHA-256 in hex."""
    return "".join(f"{digest}  {name}\n" for name, digest in sorted(hashes.items()))


def read(text: str) -> dict[str, str]:
    """The inverse of `text_of`. Raises HashListError."""
    found: dict[str, str] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        match = _LINE.fullmatch(line)
        if match is None:
            raise HashListError(f"line {number}: {line[:80]!r}, expected a SHA-256 in hex, two spaces and a name")
        path = PurePosixPath(match[2])
        is_inside = not path.is_absolute() and ".." not in path.parts and match[2] == str(path) != NAME
        if not is_inside or match[2] in found:
            raise HashListError(f"line {number}: {match[2][:80]!r} is listed twice or lies outside of the folder")
        found[match[2]] = match[1]
    if not found:
        raise HashListError("it is empty")
    return found


def check(folder: Path) -> tuple[Difference, ...]:
    """What differs from the list of the folder, by name. Raises HashListError and OSError."""
    with (folder / NAME).open("rb") as file:
        content = file.read(_MOST_LIST_BYTES + 1)
    if len(content) > _MOST_LIST_BYTES:
        raise HashListError(f"longer than {_MOST_LIST_BYTES // 1_000_000} MB")
    listed, there = read(content.decode("utf-8", errors="replace")), hashes(folder)
    there.pop(NAME, None)
    changed = {name: "changed" for name in listed.keys() & there.keys() if listed[name] != there[name]}
    removed, added = listed.keys() - there.keys(), there.keys() - listed.keys()
    whole = changed | dict.fromkeys(removed, "removed") | dict.fromkeys(added, "added")
    return tuple(Difference(name, what) for name, what in sorted(whole.items()))


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
        for path in (Path(at) / name for name in [*names, *links]):
            is_file = stat.S_ISREG(path.lstat().st_mode)
            found[path.relative_to(folder).as_posix()] = _sha256(path) if is_file else "no regular file"
    return found


def _sha256(path: Path) -> str:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK):
            digest.update(chunk)
    return digest.hexdigest()


def _raise(error: OSError) -> None:
    raise error
