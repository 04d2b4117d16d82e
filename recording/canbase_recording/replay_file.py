"""Both files of a recorded stop: the inputs for `canbase record replay`, and the robot. A shell: files alone."""

from __future__ import annotations

import contextlib
import itertools
import json
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, TextIO, TypeVar

import can
from pydantic import ValidationError

from canbase_config.robot import Robot
from canbase_recording.entry import Entry, FrameKind, RecordedFrame
from canbase_recording.recorded_inputs import NoInputsError, RecordedInputs, recorded_inputs
from canbase_recording.trip_inputs import TripHead, TripInputs, trip_head, trip_inputs
from canbase_recording.velocity_inputs import LINE_BYTES as MOST_LINE
from canbase_recording.velocity_inputs import VelocityHead, VelocityInputs, velocity_head, velocity_inputs

T = TypeVar("T")

END: Final = b"End TriggerBlock"
"""The last line of an ASC file."""
MOST_FRAMES: Final = 100_000
"""Of the .asc file: canbase writes 80,000."""
MOST_BYTES: Final = 64_000_000
"""Of the .json file: canbase writes a few MB."""


def read_inputs(path: Path) -> RecordedInputs:
    """Both files of one stop; `path`: either of them. Raises NoInputsError."""
    beside = path.with_suffix(".json")
    told = _told(beside)
    try:
        return recorded_inputs(_entries(path.with_suffix(".asc")), told)
    except NoInputsError as error:
        raise NoInputsError(f"{beside}: {error}") from error


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


def trip_beside(path: Path, inputs: RecordedInputs) -> tuple[str, TripInputs] | None:
    """The watchdog's own file of the stop in `path`, and its name. None: there is none, or none that can be read."""
    return _beside(path, inputs, "watchdog", lambda line: (head := trip_head(line), head.trip.at_s), read_trip)


def velocity_beside(path: Path, inputs: RecordedInputs) -> tuple[str, VelocityInputs] | None:
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
    inputs: RecordedInputs,
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


def _belongs(head: TripHead | VelocityHead, at_s: float, inputs: RecordedInputs) -> bool:
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


def _entries(path: Path) -> list[Entry]:
    """The frames of the .asc file: canbase wrote it whole, or not at all."""
    if not path.is_file():
        raise NoInputsError(f"there is no {path.name} beside it")
    _refuse_cut_off(path)
    try:
        with can.ASCReader(path) as reader:
            found = [_entry(message) for message in itertools.islice(reader, MOST_FRAMES + 1)]
    except (ValueError, IndexError, KeyError, OSError, can.CanError) as error:
        raise NoInputsError(f"{path.name} beside it is no recording of canbase: {error}") from error
    if len(found) > MOST_FRAMES:
        raise NoInputsError(
            f"{path.name} has more than {MOST_FRAMES} frames: canbase writes fewer; try canbase explain"
        )
    return list(found)


def _refuse_cut_off(path: Path) -> None:
    """What is missing at its end may be the stop."""
    try:
        with path.open("rb") as file:
            file.seek(max(0, path.stat().st_size - len(END) - 4))
            end = file.read()
    except OSError as error:
        raise NoInputsError(f"{path.name} cannot be read: {error.strerror or error}") from error
    if END not in end:
        raise NoInputsError(f"{path.name} is cut off: its last line is not {END.decode()!r}. Copy it again, whole")


def _entry(message: can.Message) -> RecordedFrame:
    plain = not (message.is_error_frame or message.is_extended_id or message.is_remote_frame)
    kind = FrameKind.DATA if plain else FrameKind.EXTENDED
    return RecordedFrame(message.timestamp, message.arbitration_id, bytes(message.data), not message.is_rx, kind)


def robot_of(inputs: RecordedInputs) -> Robot:
    """The robot as it was configured, with the user's own profiles out of the recording. Raises NoInputsError."""
    return _robot(inputs.robot_yaml, inputs.profiles)


def robot_beside(path: Path) -> Robot | None:
    """The robot in the .json file beside the .asc file of a stop; None: there is none. Raises NoInputsError for a file
    that has no robot."""
    beside = path.with_suffix(".json")
    if path.suffix != ".asc" or not beside.is_file():
        return None
    told = _told(beside)
    try:
        robot_yaml = dict(told["robot_yaml"])
        profiles = {str(name): str(text) for name, text in told["profiles"].items()}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise NoInputsError(f"{beside}: it has no robot.yaml as canbase writes it") from error
    try:
        return _robot(robot_yaml, profiles)
    except NoInputsError as error:
        raise NoInputsError(f"{beside}: {error}") from error


def _robot(robot_yaml: Mapping[str, Any], profiles: Mapping[str, str]) -> Robot:
    values: Any = json.loads(json.dumps(robot_yaml))
    with tempfile.TemporaryDirectory(prefix="canbase-") as folder:
        for number, (name, text) in enumerate(profiles.items()):
            own = Path(folder) / f"{number}.yaml"
            own.write_text(text, encoding="utf-8")
            for drive in values.get("drives", ()):
                drive["profile"] = str(own) if drive.get("profile") == name else drive.get("profile")
        try:
            return Robot.model_validate(values)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            key = ".".join(str(part) for part in first["loc"])
            raise NoInputsError(f"this canbase refuses the recorded robot.yaml: {key}: {first['msg']}") from error


def _told(path: Path) -> Mapping[str, Any]:
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except FileNotFoundError as error:
        raise NoInputsError(
            f"{path}: there is no such file; it is written beside the .asc, and needed for a replay "
            "(canbase explain needs the .asc alone)"
        ) from error
    except OSError as error:
        raise NoInputsError(f"{path}: cannot be read: {error.strerror or error}") from error
    if len(content) > MOST_BYTES:
        raise NoInputsError(f"{path}: longer than {MOST_BYTES // 1_000_000} MB")
    try:
        told = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise NoInputsError(f"{path}: no JSON: {error}") from error
    if not isinstance(told, dict):
        raise NoInputsError(f"{path}: no JSON object")
    return told
