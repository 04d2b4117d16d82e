"""Lines of the files in which a part records its own inputs: bounded JSON, its head, and finite times. Pure."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from canbase_recording.recorded_inputs import NoInputsError


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


def finite(value: Any) -> float:
    """A time [s]. Raises ValueError for NaN, infinity and what is no number."""
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{number} is no time")
    return number
