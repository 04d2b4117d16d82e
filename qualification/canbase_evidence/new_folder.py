"""The folder of evidence while it is filled: files that are copied or written into it, each under a plain name."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path, PurePosixPath
from typing import Final

from canbase_doctor.careful_read import read_end

MOST_BYTES: Final = 200_000_000
"""Of one file that is taken."""


class GatherError(Exception):
    """Something that was named cannot be taken; the message has the path and why."""


@dataclass(slots=True)
class Folder:
    """The folder while it is filled."""

    root: Path
    taken: set[str] = field(default_factory=set)

    def put(self, place: str, name: str, content: bytes) -> str:
        """Writes one file below `place`; its name in the folder. Two of one name are kept apart."""
        plain = re.sub(r"[^A-Za-z0-9._-]", "_", name).lstrip(".")[-120:] or "file"
        free = next(n for n in _numbered(f"{place}/{plain}" if place else plain) if n not in self.taken)
        self.taken.add(free)
        path = self.root / free
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        return free

    def copy(self, place: str, path: Path) -> str:
        """The same with a file as it is. Raises GatherError."""
        return self.put(place, path.name, taken(path))


def taken(path: Path) -> bytes:
    """The whole file. Links and what is no regular file are refused: others may write in these folders."""
    try:
        _, content = read_end(path, MOST_BYTES + 1)
    except OSError as error:
        raise GatherError(f"{path}: {error.strerror or error}") from error
    if len(content) > MOST_BYTES:
        raise GatherError(f"{path}: longer than {MOST_BYTES // 1_000_000} MB")
    return content


def _numbered(name: str) -> Iterator[str]:
    """`name`, then with a number before its ending."""
    path = PurePosixPath(name)
    return (str(path.with_name(f"{path.stem}-{n}{path.suffix}")) if n > 1 else name for n in count(1))
