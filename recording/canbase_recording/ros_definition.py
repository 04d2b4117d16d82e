"""The text of a ROS message type with all types that it contains, as MCAP's schema encoding `ros2msg` has it. Pure.

Source: mcap.dev/spec/registry, "ros2msg": the definition, then each contained type once, between lines of `=`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

SEPARATOR = "=" * 80
_INTEGERS = tuple(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
PRIMITIVES = frozenset(("bool", "byte", "char", "float32", "float64", "string", "wstring", *_INTEGERS))
IN_MSG_FILES = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}
"""The names that rosidl's Python classes have for types of .msg files."""
_FIELD = re.compile(r"^(?P<type>[A-Za-z][A-Za-z0-9_/]*)(?:<=\d+)?(?:\[(?:<=)?\d*\])?\s+[A-Za-z]")
_SEQUENCE = re.compile(r"^sequence<(?P<type>[^,]+)(?:, (?P<most>\d+))?>$")
_ARRAY = re.compile(r"^(?P<type>.+)\[(?P<count>\d+)\]$")
_BOUNDED = re.compile(r"^(?P<type>w?string)<(?P<most>\d+)>$")


def definition(name: str, read: Callable[[str, str, str], str]) -> str:
    """The whole definition of `name`, such as nav_msgs/msg/Odometry or canbase/action/DriveDistance_FeedbackMessage.

    `read`: the text of one type, by package, msg or action, and its own name; what it raises comes through.
    """
    package, space, own = name.split("/")
    text = read(package, space, own)
    known, parts = {(package, own)}, [text]
    waiting = _contained(package, space, text)
    while waiting:
        package, space, own = waiting.pop(0)
        if (package, own) in known:
            continue
        known.add((package, own))
        inner = read(package, space, own)
        parts.append(f"{SEPARATOR}\nMSG: {package}/{own}\n{inner}")
        waiting += _contained(package, space, inner)
    return "\n".join(parts)


def of_fields(fields: Mapping[str, str]) -> str:
    """The text of a type from the fields of its Python class (`get_fields_and_field_types`), without constants."""
    return "\n".join(f"{_msg_type(kind)} {name}" for name, kind in fields.items()) + "\n"


def _msg_type(kind: str) -> str:
    if match := _SEQUENCE.match(kind):
        most = f"<={match['most']}" if match["most"] else ""
        return f"{_msg_type(match['type'])}[{most}]"
    if match := _ARRAY.match(kind):
        return f"{_msg_type(match['type'])}[{match['count']}]"
    if match := _BOUNDED.match(kind):
        return f"{match['type']}<={match['most']}"
    return IN_MSG_FILES.get(kind, kind)


def _contained(package: str, space: str, text: str) -> list[tuple[str, str, str]]:
    """Each field that is a message. Parts of an action name each other with their package; their files are actions."""
    found = []
    for line in text.splitlines():
        field = _FIELD.match(line.split("#", 1)[0].strip())
        if field is None or field["type"] in PRIMITIVES:
            continue
        *owner, kind = field["type"].split("/")
        of = owner[0] if owner else package
        found.append((of, space if of == package and "_" in kind else "msg", kind))
    return found
