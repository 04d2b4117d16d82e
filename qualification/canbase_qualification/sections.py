"""What a report consists of, without any markup: sections with paragraphs, a list, tables, a plot, code."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Table:
    """Cells are texts; what is between backquotes is code."""

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class Section:
    """In this order. `plot`: the name of one that only the page has."""

    key: str
    title: str
    paragraphs: tuple[str, ...] = ()
    plot: str = ""
    tables: tuple[Table, ...] = ()
    facts: tuple[str, ...] = ()
    """A list that goes with the tables."""
    list_title: str = ""
    items: tuple[str, ...] = ()
    code: str = ""
    """A whole file, to look at."""
