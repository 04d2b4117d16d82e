"""The words that a support bundle may hold: those of canbase's own messages, keys and states, and names of the robot.

Nothing is searched for that looks like a secret. A word that canbase's own source does not have is replaced, whatever
it is, and a line that consists mostly of such words is left out.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Final

LEFT_OUT: Final = "…"
PACKAGES: Final = (
    "canbase_config", "canbase_runtime", "canbase_driver", "canbase_watchdog", "canbase_velocity", "canbase_deploy",
    "canbase_action_server", "canbase_commissioning", "canbase_doctor", "canbase_fleet", "canbase_cli",
    "canbase_web",
)  # fmt: skip
"""Whose messages, keys and states are words of a bundle."""
LONGEST: Final = 2000
"""Of a line [characters]; the rest is left out."""
_WORD: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_EDGES: Final = "()[]{}<>\"'`,;:.!?="
_NUMBER: Final = re.compile(
    r"[+-]?(?:\d{1,7}|0x[0-9A-Fa-f]{1,8}|[0-9A-Fa-f]{4}h|[0-9A-Fa-f]{8}h?|\d{1,7}(?:ns|us|ms|s|min|mm|m|V|A|Nm|Hz|kHz|rpm|"
    r"K|C|kB|MB|GB|h)|\d{1,4}[eE][+-]?\d{1,3})"
)
_TIME: Final = re.compile(
    r"\d{4}-\d\d-\d\d(?:T\d\d:\d\d:\d\d(?:\.\d{1,9})?(?:Z|[+-]\d\d:?\d\d)?)?|\d\d:\d\d:\d\d(?:\.\d{1,9})?"
)
_INTERFACE: Final = re.compile(r"(?:v|sl|vx)?can\d{1,3}|udp_multicast|239(?:\.\d{1,3}){3}")
_SEPARATOR: Final = re.compile(r"[^A-Za-z0-9_+]+|\+(?!\d)")
_SYMBOLS: Final = frozenset("°±→µ·×–—…≤≥%#&*/\\|~^@$-+")
_ABOUT_SECRETS: Final = re.compile(
    r"(?i)passw|passphrase|\bpass\b|pwd|psk|\bpin\b|secret|token|credential|api.?key|login|cookie|bearer|authori"
)
"""A line with such a word and with a word that is not known is left out whole."""
MOST_UNKNOWN: Final = 1.0 / 3.0
"""Of the words of a line."""


class Words:
    """What may be in a text."""

    def __init__(self, known: Iterable[str]) -> None:
        """`known`: in lower case."""
        self._known = frozenset(known)

    def __contains__(self, word: str) -> bool:
        return word.lower() in self._known

    def also(self, names: Iterable[str]) -> Words:
        """With the names of a robot, too: of drives, sources, topics and frames."""
        return Words(self._known | {word.lower() for name in names for word in _WORD.findall(name)})

    def knows_all(self, text: str) -> bool:
        """Whether each of its words is known, or a number, a time, an object or a CAN interface."""
        return all(self._is_known(chunk) for chunk in text.split())

    def value(self, text: str) -> str:
        """A short text, such as a state: whole or not at all."""
        return text if len(text) <= LONGEST and self.knows_all(text) else self.line(text)

    def line(self, text: str) -> str:
        """A line with LEFT_OUT in place of each unknown word; LEFT_OUT alone, where most of it is unknown."""
        chunks = re.split(r"(\s+)", text[:LONGEST])
        words = [chunk for chunk in chunks if _WORD.search(chunk) or not chunk.isascii()]
        unknown = sum(not self._is_known(word) for word in words)
        if not unknown:
            return self._replaced(chunks) if words or not text.strip() else LEFT_OUT
        known = len(words) - unknown
        if known < 3 or unknown > MOST_UNKNOWN * len(words) or _ABOUT_SECRETS.search(text):
            return LEFT_OUT
        return self._replaced(chunks)

    def lines(self, text: str) -> str:
        """Each line by itself; of several that are left out in a row one."""
        kept: list[str] = []
        for each in text.splitlines():
            shown = self.line(each)
            if shown != LEFT_OUT or kept[-1:] != [LEFT_OUT]:
                kept.append(shown)
        return "".join(f"{each}\n" for each in kept)

    def _replaced(self, chunks: Iterable[str]) -> str:
        return "".join(chunk if self._is_known(chunk) else LEFT_OUT for chunk in chunks)

    def _is_known(self, chunk: str) -> bool:
        if not chunk.strip():
            return True
        plain = chunk.strip(_EDGES)
        if _TIME.fullmatch(plain) or _INTERFACE.fullmatch(plain):
            return True
        if any(not each.isascii() and each not in _SYMBOLS for each in plain):
            return False
        parts = [part for part in _SEPARATOR.split(plain) if part]
        numbers = sum(len(part) for part in parts if part.isdigit())
        return numbers <= 16 and all(part in self or _NUMBER.fullmatch(part) for part in parts)


def own_words() -> Words:
    """Of the installed packages. Where their source is not installed, there are few, and more is left out."""
    return Words(word for path in _sources() for word in _words_of(path))


def _sources() -> Iterator[Path]:
    for package in PACKAGES:
        found = find_spec(package)
        for folder in (found.submodule_search_locations or ()) if found else ():
            yield from sorted(path for path in Path(folder).rglob("*.py") if not path.name.startswith("bundle_"))


def _words_of(path: Path) -> Iterator[str]:
    """Of its texts, without those that only explain it, and of the names of fields and attributes."""
    explained = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        texts: tuple[str | None, ...] = ()
        match node:
            case ast.Expr(value=ast.Constant() as constant):
                explained.add(constant)
            case ast.Constant(value=str(text)) if node not in explained:
                texts = (text,)
            case ast.AnnAssign(target=ast.Name(id=name)) | ast.Attribute(attr=name) | ast.keyword(arg=name):
                texts = (name,)
        for text in filter(None, texts):
            yield from (word.lower() for word in _WORD.findall(text))
