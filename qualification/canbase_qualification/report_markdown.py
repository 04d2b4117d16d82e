"""The report as Markdown: for a repository, a ticket, or a page that is made of it. Pure."""

from __future__ import annotations

from collections.abc import Iterator

from canbase_qualification.sections import Section, Table

FENCE = "````"
"""Longer than any that robot.yaml may have in it."""


def markdown(title: str, sections: list[Section]) -> str:
    """The whole file."""
    lines = [f"# {_text(title)}"]
    for section in sections:
        lines += ["", f"## {_text(section.title)}", *_body(section)]
    return "\n".join(lines) + "\n"


def _body(section: Section) -> Iterator[str]:
    for paragraph in section.paragraphs:
        yield from ("", _text(paragraph))
    for table in section.tables:
        yield from ("", f"**{_text(table.caption)}**", "", *_table(table))
    if section.facts:
        yield from ("", *(f"- {_text(fact)}" for fact in section.facts))
    if section.items:
        yield from ("", f"**{_text(section.list_title)}**", "", *(f"- {_text(item)}" for item in section.items))
    if section.code:
        yield from ("", f"{FENCE}yaml", section.code.replace("`", "'").rstrip("\n"), FENCE)


def _table(table: Table) -> Iterator[str]:
    yield _row(table.columns)
    yield "|" + "---|" * len(table.columns)
    yield from (_row(row) for row in table.rows)


def _row(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(_text(cell).replace("|", "∣") for cell in cells) + " |"


def _text(text: str) -> str:
    """No markup of its own but code and emphasis; on one line."""
    return " ".join(text.split()).replace("<", "&lt;").replace(">", "&gt;")
