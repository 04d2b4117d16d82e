"""The files in which watchdog, mux and filter recorded their inputs, alone and beside a stop. A shell: files alone."""

from __future__ import annotations

import contextlib
import json
import math
import re
from collections.abc import Callable, Iterable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Final, TextIO, TypeVar

from canbase_driver.supervision.watchdog_link import CAUSES
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
HUNG_S: Final = 1.0
"""A driver that hung had nothing to record: its recording begins so short before its stop at most [s] ..."""
SAME_BOOT_S: Final = 1.0
"""... and since the same start of the computer: the clocks of both files agree to this [s]."""
RESET_S: Final = 0.5
"""Between a trip and the power after its reset at least [s]."""
_STAMP: Final = re.compile(r"_(\d{8}T\d{6}\.\d{3})Z_")
"""When a stop was, in the name of its file."""


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
    """The watchdog's own file of the stop in `path`, and its name. None: there is none, or none that can be read.

    While a driver hangs nothing is recorded: then the trip may be any time before its recording begins.
    """
    return _beside(path, inputs, "watchdog", _trip_of, read_trip)


def trip_head_beside(path: Path, inputs: StopFile) -> tuple[str, TripHead] | None:
    """The same, and of it what its first line has."""
    return _beside(path, inputs, "watchdog", _trip_of, lambda each: trip_head(_first_line(each)))


def velocity_beside(path: Path, inputs: StopFile) -> tuple[str, VelocityInputs] | None:
    """The same of mux and filter."""
    return _beside(path, inputs, "velocity", lambda line: (head := velocity_head(line), head.at_s), read_velocity)


def _trip_of(line: str) -> tuple[TripHead, float]:
    head = trip_head(line)
    return head, head.trip.at_s


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
    """The one that is nearest in time; else the last one before, where the driver hung."""
    others = list(_other_stops(path, inputs))
    found: list[tuple[float, Path]] = []
    last_s, hung = -math.inf, None
    for each in sorted(path.parent.glob(f"{part}_*{INPUTS_SUFFIX}"), reverse=True)[:MOST_BESIDE]:
        with contextlib.suppress(NoInputsError):
            head, at_s = head_of(_first_line(each))
            apart_s = abs(head.wall_offset_s - inputs.wall_offset_s)
            if head.robot != _robot(inputs) or apart_s >= CLOCK_S or inputs.was_enabled(at_s + RESET_S, inputs.at_s):
                continue  # of an earlier stop, which was reset
            if inputs.began_s <= at_s <= inputs.at_s or _is_soon_after(at_s, inputs, others):
                found.append((abs(at_s - inputs.at_s), each))
            elif last_s < at_s < inputs.began_s:
                last_s, hung = at_s, each if apart_s < SAME_BOOT_S and _is_of_hung(head, inputs) else None
    for each in [file for _, file in sorted(found)] or filter(None, [hung]):
        with contextlib.suppress(NoInputsError):
            return each.name, read(each)
    return None


def _robot(inputs: StopFile) -> str:
    return str(inputs.robot_yaml.get("name", ""))


def _is_soon_after(at_s: float, inputs: StopFile, others: Iterable[float]) -> bool:
    """It may still belong to this stop, and no other stop is nearer."""
    after_s = at_s - inputs.at_s
    return 0.0 < after_s <= AFTER_S and all(abs(at_s - other_s) >= after_s for other_s in others)


def _is_of_hung(head: TripHead | VelocityHead, inputs: StopFile) -> bool:
    """The driver stopped for this trip, and recorded nothing before."""
    if not isinstance(head, TripHead) or inputs.stopped_by != "watchdog" or inputs.at_s - inputs.began_s > HUNG_S:
        return False
    return inputs.detail.startswith(f"watchdog: {CAUSES.get(head.trip.cause, '?')}")


def _other_stops(path: Path, inputs: StopFile) -> Iterator[float]:
    """Times of the robot's other stops, by the names of their files [s]."""
    for each in path.parent.glob("stop_*.asc"):
        stamp = _STAMP.search(each.name)
        if stamp is not None and each.stem != path.stem and each.name.startswith(f"stop_{_robot(inputs)}_"):
            with contextlib.suppress(ValueError):
                stopped = datetime.strptime(f"{stamp[1]}+0000", "%Y%m%dT%H%M%S.%f%z")
                yield stopped.timestamp() - inputs.wall_offset_s


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
