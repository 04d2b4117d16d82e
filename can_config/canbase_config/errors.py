"""What is wrong with a robot.yaml, as the user reads it: one block for each problem, with the place and the way out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

MOST_TOLD = 20
"""Problems that are printed; of the others the number."""
MOST_CHARACTERS = 200
"""Of a key, printed."""
Loc = tuple[str | int, ...]
"""Where a value is: keys and list positions from the top of the file, as pydantic counts them."""


def key_path(loc: Loc) -> str:
    """`loc` as people write it: `drives[1].gear_ratio`."""
    path = ""
    for part in loc:
        path += f"[{part}]" if isinstance(part, int) else f".{part}"
    return path.removeprefix(".")


@dataclass(frozen=True, slots=True)
class Place:
    """Where a value stands: file, line from 1 (None: it is about the whole file), and the key as that file has it."""

    file: str
    line: int | None
    key: str


@dataclass(frozen=True, slots=True)
class Problem:
    """One thing that is wrong. `line` counts from 1; None: it is about the whole file."""

    file: str
    line: int | None
    key: str
    what: str
    expected: str = ""
    hint: str = ""

    def __str__(self) -> str:
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        wrong = f"{self.what}, expected {self.expected}" if self.expected else self.what
        text = ": ".join(part for part in (place, printable(self.key, MOST_CHARACTERS), wrong) if part)
        return f"{printable(text)}\n    {printable(self.hint)}" if self.hint else printable(text)


def printable(text: str, most: int = 1_000) -> str:
    """`text` for a terminal: of a long one the begin, and no character that the terminal would obey."""
    shown = "".join(one if one.isprintable() else repr(one)[1:-1] for one in text[:most])
    return shown if len(text) <= most else f"{shown}…"


class ConfigError(Exception):
    """The file is of no use: it cannot be read, is no YAML, or does not describe a robot. Its text is for the user."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        told = [str(problem) for problem in problems[:MOST_TOLD]]
        more = [f"and {len(problems) - MOST_TOLD} more"] if len(problems) > MOST_TOLD else []
        super().__init__("\n".join([*told, *more]))
        self.problems = tuple(problems)
