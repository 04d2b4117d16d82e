"""The files in which watchdog, mux and filter recorded their inputs, alone and beside a stop. A shell: files alone."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Final, TextIO, TypeVar

from canbase_recording.input_lines import NoInputsError
from canbase_recording.stop_file import StopFile
from canbase_recording.trip_inputs import TripHead, TripInputs, trip_head, trip_inputs
from canbase_recording.velocity_inputs import LINE_BYTES as MOST_LINE
from canbase_recording.velocity_inputs import VelocityHead, VelocityInputs, velocity_head, velocity_inputs

T = TypeVar("T")

INPUTS_SUFFIX: Final = ".jsonl"
MOST_BESIDE: Final = 200
"""Files of a part that are looked at to find the one of a stop."""
AFTER_S: Final = 5.0
"""What a part has so long after the stop still belongs to it [s]."""
CLOCK_S: Final = 3600.0
"""The wall clock was set by less between the two files of one stop [s]."""


def part_of(path: Path) -> str:
    """Whose inputs a file has: `watchdog` or `velocity`. Raises NoInputsError for another one."""
    try:
        head = json.loads(_first_line(path))
        part = head["part"]
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise NoInputsError(f"{path}: line 1: no JSON of canbase's inputs of a stop") from error
    return str(part)


def read_trip(path: Path) -> TripInputs:
    """The inputs of a watchdog's trip. Raises NoInputsError."""
    return _read(path, trip_inputs)


def read_velocity(path: Path) -> VelocityInputs:
    """The inputs of mux and filter. Raises NoInputsError."""
    return _read(path, velocity_inputs)


def trip_beside(path: Path, inputs: StopFile) -> tuple[str, TripInputs] | None:
    """The watchdog's own file of the stop in `path`, and its name. None: there is none, or none that can be read."""
    return _beside(path, inputs, "watchdog", lambda line: (head := trip_head(line), head.trip.at_s), read_trip)


def velocity_beside(path: Path, inputs: StopFile) -> tuple[str, VelocityInputs] | None:
    """The same of mux and filter."""
    return _beside(path, inputs, "velocity", lambda line: (head := velocity_head(line), head.at_s), read_velocity)


def _read(path: Path, make: Callable[[Iterable[str]], T]) -> T:
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            return make(_bounded(file))
    except OSError as error:
        raise NoInputsError(f"{path}: cannot be read: {error.strerror or error}") from error
    except NoInputsError as error:
        raise NoInputsError(f"{path}: {error}") from error


def _beside(
    path: Path,
    inputs: StopFile,
    part: str,
    head_of: Callable[[str], tuple[TripHead | VelocityHead, float]],
    read: Callable[[Path], T],
) -> tuple[str, T] | None:
    """The one that is nearest in time."""
    robot = str(inputs.robot_yaml.get("name", ""))
    found: list[tuple[float, Path]] = []
    for each in sorted(path.parent.glob(f"{part}_*{INPUTS_SUFFIX}"), reverse=True)[:MOST_BESIDE]:
        with contextlib.suppress(NoInputsError):
            head, at_s = head_of(_first_line(each))
            if head.robot == robot and _belongs(head, at_s, inputs):
                found.append((abs(at_s - inputs.at_s), each))
    for _, each in sorted(found):
        with contextlib.suppress(NoInputsError):
            return each.name, read(each)
    return None


def _belongs(head: TripHead | VelocityHead, at_s: float, inputs: StopFile) -> bool:
    near = inputs.began_s <= at_s <= inputs.at_s + AFTER_S
    return near and abs(head.wall_offset_s - inputs.wall_offset_s) < CLOCK_S


def _first_line(path: Path) -> str:
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            return file.readline(MOST_LINE + 1)
    except OSError as error:
        raise NoInputsError(f"{path}: cannot be read: {error.strerror or error}") from error


def _bounded(file: TextIO) -> Iterator[str]:
    """No line is read beyond what is refused anyway."""
    while line := file.readline(MOST_LINE + 1):
        yield line
