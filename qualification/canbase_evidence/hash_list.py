"""The list of hashes of a folder, in the form that `sha256sum -c` checks, and what differs from it. Pure.

Names are plain here (gather.py gives them): no line ends, no backslashes, which sha256sum would write escaped.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Final

NAME: Final = "SHA256SUMS"
"""Of the list itself, which is not in it."""
_LINE: Final = re.compile(r"([0-9a-f]{64}) [ *](.+)")


class HashListError(ValueError):
    """The text is no list of hashes; the message names the line."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One file that is not as it was listed."""

    name: str
    what: str
    """changed, added or removed."""


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
        if not _is_inside(match[2]) or match[2] in found:
            raise HashListError(f"line {number}: {match[2][:80]!r} is listed twice or lies outside of the folder")
        found[match[2]] = match[1]
    if not found:
        raise HashListError("it is empty")
    return found


def differences(listed: Mapping[str, str], there: Mapping[str, str]) -> tuple[Difference, ...]:
    """By name. `there`: what the folder holds now, without the list itself."""
    names = sorted({*listed, *there})
    return tuple(Difference(name, what) for name in names if (what := _what(listed.get(name), there.get(name))))


def _what(listed: str | None, there: str | None) -> str:
    if listed is None:
        return "added"
    if there is None:
        return "removed"
    return "" if listed == there else "changed"


def _is_inside(name: str) -> bool:
    path = PurePosixPath(name)
    return not path.is_absolute() and ".." not in path.parts and name == str(path) and name != NAME
