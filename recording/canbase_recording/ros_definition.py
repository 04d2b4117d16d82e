"""The text of a ROS message type with all types that it contains, as MCAP's schema encoding `ros2msg` has it.

Source: mcap.dev/spec/registry, "ros2msg": the definition, then each contained type once, between lines of `=`.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

SEPARATOR = "=" * 80
_INTEGERS = tuple(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
PRIMITIVES = frozenset(("bool", "byte", "char", "float32", "float64", "string", "wstring", *_INTEGERS))
_FIELD = re.compile(r"^(?P<type>[A-Za-z][A-Za-z0-9_/]*)(?:<=\d+)?(?:\[(?:<=)?\d*\])?\s+[A-Za-z]")


def whole_definition(package: str, kind: str) -> str:
    """Of an installed type such as nav_msgs, Odometry. Raises OSError: it is not installed."""
    known = [(package, kind)]
    parts = [_text(package, kind)]
    for each in known:  # grows on the way
        known += [inner for inner in dict.fromkeys(_contained(each[0], _text(*each))) if inner not in known]
    parts += [f"{SEPARATOR}\nMSG: {owner}/{inner}\n{_text(owner, inner)}" for owner, inner in known[1:]]
    return "\n".join(parts)


def _text(package: str, kind: str) -> str:
    """Of a sourced ROS 2, or of the ROS wheels in this environment."""
    try:
        folder = Path(get_package_share_directory(package))
    except (PackageNotFoundError, OSError):
        folder = Path(sys.prefix) / "share" / package
    return (folder / "msg" / f"{kind}.msg").read_text(encoding="utf-8")


def _contained(package: str, text: str) -> Iterator[tuple[str, str]]:
    """Each field that is a message."""
    for line in text.splitlines():
        field = _FIELD.match(line.split("#", 1)[0].strip())
        if field is not None and field["type"] not in PRIMITIVES:
            *owner, kind = field["type"].split("/")
            yield (owner[0] if owner else package), kind
