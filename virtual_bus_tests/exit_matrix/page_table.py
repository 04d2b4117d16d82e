"""A table of docs/stop_times.md that several runs write, row by row: what a run did not measure stays as it was."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

NOTHING: Final = "–"
"""A cell without a value."""

Key = tuple[str, ...]
Row = Mapping[str, str]
"""Text by the name of its column."""
Rows = Mapping[Key, Row]


@dataclass(frozen=True, slots=True)
class PageTable:
    """`keys`: the columns that name a row; `columns`: the others. All of `left` are text, the others figures."""

    keys: tuple[str, ...]
    columns: tuple[str, ...]
    left: tuple[str, ...] = ()

    def rows(self, section: str) -> dict[Key, dict[str, str]]:
        """The rows that a page has now, by their keys; columns that are new, or that are gone, do not matter."""
        lines = [_cells(line) for line in section.splitlines() if line.startswith("|")]
        if not lines:
            return {}
        names, found = lines[0], {}
        for cells in lines[2:]:
            row = dict(zip(names, cells, strict=False))
            found[tuple(row.get(key, NOTHING) for key in self.keys)] = row
        return found

    def merged(self, section: str, new: Rows, order: Iterable[Key] = ()) -> str:
        """The table with the columns that `new` gives; every other row and column stays.

        Rows of `order` come first and in that order, the others as they were.
        """
        rows = self.rows(section)
        for key, row in new.items():
            rows[key] = {**rows.get(key, {}), **row}
        first = [key for key in dict.fromkeys(order) if key in rows]
        keys = [*first, *(key for key in rows if key not in set(first))]
        return "\n".join([*self._head(), *(self._line(key, rows[key]) for key in keys)])

    def _head(self) -> Sequence[str]:
        names = (*self.keys, *self.columns)
        rule = "".join("---|" if name in (*self.keys, *self.left) else "---:|" for name in names)
        return f"| {' | '.join(names)} |", f"|{rule}"

    def _line(self, key: Key, row: Row) -> str:
        return f"| {' | '.join((*key, *(row.get(name, NOTHING) for name in self.columns)))} |"


def _cells(line: str) -> tuple[str, ...]:
    return tuple(cell.strip() for cell in line.strip().strip("|").split("|"))
