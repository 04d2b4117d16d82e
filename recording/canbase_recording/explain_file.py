"""Explains a recording on disk: the shell around `explanation.py`. Reads files; sends nothing, changes nothing."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Final

from canbase_config.eds_file import Eds, read_eds
from canbase_config.robot import Robot
from canbase_driver.supervision.watchdog_link import CAUSES
from canbase_recording.entry import Entry
from canbase_recording.explanation import Explanation, explain
from canbase_recording.input_lines import NoInputsError
from canbase_recording.recording_facts import OwnTrip, RecordingFacts
from canbase_recording.recording_file import NoRecordingError, RecordingFile
from canbase_recording.replay_file import trip_head_beside
from canbase_recording.stop_file import read_stop

LOOK_EVERY: Final = 20_000
"""Entries between two reports of progress."""
Progress = Callable[[int, int], None]
"""Bytes that are read, and bytes in all."""


def explain_file(
    path: Path,
    robot: Robot | None = None,
    *,
    config: str = "",
    channel: str | None = None,
    eds_files: Sequence[Path] = (),
    bitrate: int | None = None,
    progress: Progress | None = None,
) -> tuple[RecordingFacts, Explanation]:
    """`config`: where `robot` is from, for people. Raises NoRecordingError, and EdsError for an EDS file of no use."""
    known = known_objects(eds_files)
    with RecordingFile(path, channel) as recording:
        entries: Iterable[Entry] = recording.entries()
        if progress is not None:
            entries = _with_progress(entries, recording, progress)
        told = explain(entries, robot, known, bitrate)
        if not told.frames:
            raise NoRecordingError(f"{path}: {recording.format}, and no frame in it{_why(recording)}")
        problems = tuple(recording.problems.sentences)
    trip = _own_trip(path, robot, known, bitrate)
    return RecordingFacts(path.name, recording.format, recording.began_text, config, problems, trip), told


def _own_trip(path: Path, robot: Robot | None, known: Sequence[Eds], bitrate: int | None) -> OwnTrip | None:
    """What the watchdog recorded of the stop of a black box; None: nothing that is beside it."""
    if path.suffix != ".asc" or not path.with_suffix(".json").is_file():
        return None
    try:
        stop = read_stop(path)
    except NoInputsError:
        return None
    found = trip_head_beside(path, stop)
    if found is None:
        return None
    file, trip = path.with_name(found[0]), found[1].trip
    at_s, told = trip.at_s - stop.began_s, None
    if at_s < 0.0:
        with contextlib.suppress(NoRecordingError), RecordingFile(file) as recording:
            told = explain(recording.entries(), robot, known, bitrate)
    return OwnTrip(str(file), trip.detail or CAUSES.get(trip.cause, "unknown cause"), at_s, told)


def known_objects(eds_files: Sequence[Path]) -> list[Eds]:
    """The manufacturer's EDS files, then canbase's own of a CiA 402 drive. Raises EdsError."""
    ours = Path(str(files("canbase_config"))) / "eds" / "canbase_cia402.eds"
    return [read_eds(path) for path in (*eds_files, ours)]


def _with_progress(entries: Iterable[Entry], recording: RecordingFile, progress: Progress) -> Iterator[Entry]:
    for number, entry in enumerate(entries):
        if number % LOOK_EVERY == 0:
            progress(recording.position, recording.size)
        yield entry
    progress(recording.size, recording.size)


def _why(recording: RecordingFile) -> str:
    found = recording.problems.sentences
    return f": {found[0]}" if found else ""
