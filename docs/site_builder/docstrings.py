"""Turns docstrings, plain text with `names` and lists as in Markdown, into the reStructuredText that Sphinx reads."""

from __future__ import annotations

import builtins
import re
from typing import Any

from docutils import nodes
from sphinx.addnodes import pending_xref

_CODE = re.compile(r"(`+[^`]+`+)")
_MARKUP = re.compile(r"([*|\\])|(?<=\w)(_)(?!\w)")
_ITEM = re.compile(r"\s*(?:[-*•]|\d+\.|#\.)\s+")


def as_restructured_text(_app: Any, _what: str, _name: str, _thing: Any, _options: Any, lines: list[str]) -> None:
    """Sphinx's event autodoc-process-docstring: changes `lines` in place."""
    lines[:] = converted(lines)


def without_builtins(_app: Any, doctree: nodes.document) -> None:
    """Sphinx's event doctree-read: `float` and its like are no links. Sphinx would search all names for each."""
    for link in list(doctree.findall(pending_xref)):
        if hasattr(builtins, link.get("reftarget", "")):
            link.replace_self(link.children)


def converted(lines: list[str]) -> list[str]:
    """The same text for docutils: markup characters escaped outside of code, lists and indented blocks set apart."""
    out: list[str] = []
    for line in lines:
        starts_item = _ITEM.match(line) is not None
        if out and out[-1].strip() and line.strip() and _needs_blank(out[-1], line, starts_item):
            out.append("")
        out.append(_escaped(line))
    return out


def plain(line: str) -> str:
    """One line of a docstring for docutils."""
    return _escaped(line)


def _needs_blank(before: str, line: str, starts_item: bool) -> bool:
    follows_item = _ITEM.match(before) is not None
    if starts_item:
        return not follows_item and _indent(line) >= _indent(before)
    if follows_item:
        return _indent(line) <= _indent(before)
    return _indent(line) != _indent(before)


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def _escaped(line: str) -> str:
    parts = _CODE.split(line)
    return "".join(_code(part) if number % 2 else _text(part, number > 0) for number, part in enumerate(parts))


def _code(part: str) -> str:
    return f"``{part.strip('`')}``"


def _text(part: str, after_code: bool) -> str:
    escaped = _MARKUP.sub(r"\\\1\2", part)
    return rf"\ {escaped}" if after_code and escaped[:1].isalnum() else escaped
