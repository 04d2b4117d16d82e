"""What is wrong with a robot.yaml, as the user reads it: one block for each problem, with the place and the way out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
        text = ": ".join(part for part in (place, self.key, wrong) if part)
        return f"{text}\n    {self.hint}" if self.hint else text


class ConfigError(Exception):
    """The file is of no use: it cannot be read, is no YAML, or does not describe a robot. Its text is for the user."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        super().__init__("\n".join(str(problem) for problem in problems))
        self.problems = tuple(problems)
