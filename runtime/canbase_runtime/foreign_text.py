"""Text that comes from outside (frame ids, names, states of other nodes) before it is logged, shown or stored.

A newline in it would forge a line of the log, an escape sequence would control the terminal. Every message that has
such text in it passes it through here. Nothing else of it changes: what can be printed stays as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

NAME_LENGTH: Final = 80
"""Of a name or a frame [characters]."""
SENTENCE_LENGTH: Final = 500
"""Of a detail or an answer of another node [characters]."""
LINE_LENGTH: Final = 4000
"""Of a line of the log [characters]."""
CUT: Final = "…"


def printable(text: object, length: int = NAME_LENGTH) -> str:
    """`text` on one line: what cannot be printed (control characters, line ends, turned writing) escaped, as Python
    writes it; at most `length` characters, the last one CUT where more was left out."""
    whole = str(text)
    kept = "".join(_escaped(character) for character in whole[:length])
    return kept if len(whole) <= length and len(kept) <= length else kept[: length - 1] + CUT


def clean(message: Any, length: int = LINE_LENGTH) -> Any:
    """A ROS message with all its texts `printable`, in nested messages too; changed in place, and returned."""
    for field, kind in message.get_fields_and_field_types().items():
        value = getattr(message, field)
        if isinstance(value, str):
            setattr(message, field, printable(value, length))
        elif hasattr(value, "get_fields_and_field_types"):
            clean(value, length)
        elif _may_hold_text(kind) and isinstance(value, Sequence):
            cleaned = [printable(each, length) if isinstance(each, str) else clean(each, length) for each in value]
            setattr(message, field, cleaned)
    return message


def _may_hold_text(kind: str) -> bool:
    """A sequence of texts or of messages, not of numbers: those are many."""
    return "string" in kind or "/" in kind


def _escaped(character: str) -> str:
    return character if character.isprintable() else character.encode("unicode_escape").decode("ascii")
