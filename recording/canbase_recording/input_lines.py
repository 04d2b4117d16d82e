"""Lines of the files in which a part records its own inputs: bounded JSON, its head, and finite times. Pure."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError


class NoInputsError(Exception):
    """A file is none of canbase's recordings of a stop, or of another version. The text says what is wrong."""


def json_line(line: str, number: int, most_bytes: int) -> Any:
    """What is in line `number`. Raises NoInputsError for one that is longer, or no JSON."""
    if len(line) > most_bytes:
        raise NoInputsError(f"line {number}: longer than {most_bytes // 1000:,} kB")
    try:
        return json.loads(line)
    except (ValueError, RecursionError) as error:
        raise NoInputsError(f"line {number}: no JSON ({error}); was the file cut off?") from error


def head_of(line: str, most_bytes: int, part: str, version: int, what: str) -> Mapping[str, Any]:
    """The first line of a file of `part` in this `version` of its form. Raises NoInputsError; `what`: for people."""
    head = json_line(line, 1, most_bytes)
    if not isinstance(head, dict) or head.get("part") != part:
        raise NoInputsError(f"line 1: it is no file of the inputs of {what}")
    if head.get("format") != version:
        found = str(head.get("format"))[:20]
        raise NoInputsError(f"format {found!r}, expected {version}: of another version of canbase?")
    return head


Time = Annotated[float, Field(allow_inf_nan=False)]
"""Monotonic [s]."""


def readers(kinds: Mapping[str, tuple[Any, ...]]) -> Mapping[str, TypeAdapter[Any]]:
    """By what a line is: its values behind that word and its time."""
    whole: Any = tuple  # to mypy an alias with values in it is no type
    shapes = {what: (str, Time, *values) for what, values in kinds.items()}
    return {what: TypeAdapter(whole[shape]) for what, shape in shapes.items()}


def read_call(values: Any, number: int, known: Mapping[str, TypeAdapter[Any]], of: str) -> Any:
    """A line as a tuple of what it is, its time and its values. Raises NoInputsError; `of`: for people."""
    try:
        return known[values[0]].validate_python(values)
    except ValidationError as error:
        raise NoInputsError(f"line {number}: no input of {of} ({first_of(error)})") from error
    except (KeyError, TypeError, IndexError) as error:
        raise NoInputsError(f"line {number}: no input of {of} ({str(error)[:80]})") from error


def first_of(error: ValidationError) -> str:
    """What is wrong first, and where."""
    first = error.errors(include_url=False, include_input=False)[0]
    return f"{'.'.join(map(str, first['loc']))}: {first['msg']}"[:200]
