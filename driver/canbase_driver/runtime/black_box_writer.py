"""The thread that writes recordings to files, beside the control loop: slowly, and bounded in number and size.

Each stop has two files: frames and notes as .asc, and what does not fit there as .json (black_box_json.py). A folder
that cannot be written or a full disk is reported once, and once when it is over; the robot is not disturbed.
"""

from __future__ import annotations

import itertools
import os
import queue
import re
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from canbase_config.black_box import BlackBox
from canbase_driver.runtime.black_box import EventEntry, Recording, asc_lines
from canbase_driver.runtime.black_box_json import json_lines
from canbase_driver.runtime.black_box_notes import title
from canbase_driver.supervision.stop_history import StopRecord

WAITING = 4
"""Recordings that may wait to be written; more are dropped: a stop every second shows nothing new."""
LINES_AT_ONCE = 20
PAUSE_S = 0.001
"""A pause after this many lines: the control thread never waits for the interpreter longer than they take, 0.3 ms."""
SUFFIXES = (".json", ".asc")
"""In the order in which they appear: who sees the second one has both."""

T = TypeVar("T")
Late = Callable[[Recording], Iterable[EventEntry]]
"""Events of the time of a recording that something else has kept, one by one; called from the writer's thread."""


def state_folder(environment: Mapping[str, str], home: Path) -> Path:
    """Where recordings go by default: what systemd gives (StateDirectory=), else the user's state folder."""
    given = environment.get("STATE_DIRECTORY", "").partition(":")[0]
    if given:
        return Path(given)
    return Path(environment.get("XDG_STATE_HOME") or home / ".local" / "state") / "canbase"


@dataclass(frozen=True, slots=True)
class _Job:
    stem: str
    recording: Recording
    record: StopRecord
    late: Late


class BlackBoxWriter(threading.Thread):
    """Writes what `submit` is given, until `finish`. `failure`: the defect that ended it."""

    def __init__(
        self, config: BlackBox, robot: str, say: Callable[[str], None], about: Mapping[str, Any] | None = None
    ) -> None:
        """`say`: takes a sentence for the log, from this thread. `about`: what each .json file has of robot and
        software, black_box_about.py."""
        super().__init__(name="black box", daemon=True)
        self._folder = Path(config.folder) if config.folder else state_folder(os.environ, Path.home())
        self._prefix = f"stop_{robot}_"
        self._files = config.files
        self._say, self._about = say, about or {}
        self._jobs: queue.Queue[_Job | None] = queue.Queue(WAITING)
        self._problem = ""
        self.failure: BaseException | None = None

    def submit(self, recording: Recording, record: StopRecord, late: Late = lambda _recording: ()) -> str:
        """Have it written. The path of its .asc; empty when it is dropped, or when the last one could not be written.

        Never waits.
        """
        wall_s = record.at_s + recording.wall_offset_s
        stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(wall_s))
        millis = int(wall_s * 1000.0) % 1000
        cause = re.sub("[^a-z0-9]+", "_", record.cause.lower())
        stem = f"{self._prefix}{stamp[:-1]}.{millis:03d}Z_{cause}"
        try:
            self._jobs.put_nowait(_Job(stem, recording, record, late))
        except queue.Full:
            return ""
        return "" if self._problem else str(self._folder / f"{stem}.asc")

    def finish(self, timeout_s: float) -> None:
        """Write what waits, at most for this long [s], and end."""
        try:
            self._jobs.put(None, timeout=timeout_s)
        except queue.Full:
            return
        self.join(timeout_s)

    def run(self) -> None:
        """The thread's body."""
        try:
            self._attempt(self._prepare)
            while (job := self._jobs.get()) is not None:
                self._attempt(lambda job=job: self._write(job))  # type: ignore[misc]
        except BaseException as error:  # noqa: BLE001 - main sees it, stops the robot and ends the process
            self.failure = error

    def _attempt(self, act: Callable[[], None]) -> None:
        try:
            act()
        except OSError as error:
            problem = f"the black box cannot write to {self._folder}: {error.strerror or error}"
        else:
            problem = ""
        if problem and not self._problem:
            self._say(f"{problem}. Check the folder (black_box.folder) and the disk; stops are still reported")
        elif self._problem and not problem:
            self._say(f"the black box writes to {self._folder} again")
        self._problem = problem

    def _prepare(self) -> None:
        """Find out now, not at the first stop."""
        self._folder.mkdir(parents=True, exist_ok=True)
        probe = self._folder / f".{self._prefix}probe"
        probe.write_text("", encoding="ascii")
        probe.unlink()

    def _write(self, job: _Job) -> None:
        """Where one of the two files cannot be written the other one is, if it can."""
        self._folder.mkdir(parents=True, exist_ok=True)
        events = [*job.recording.events, *_slowly(job.late(job.recording))]
        recording = replace(job.recording, events=tuple(sorted(events, key=lambda event: event[0])))
        problem: OSError | None = None
        for suffix in SUFFIXES:
            name = f"{job.stem}.asc"
            lines = (
                asc_lines(recording, title(job.record.stopped_by, job.record.cause, job.record.detail))
                if suffix == ".asc"
                else json_lines(recording, job.record, name, self._about)
            )
            try:
                self._put(self._folder / f"{job.stem}{suffix}", lines)
            except OSError as error:
                problem = problem or error
        if problem is not None:
            raise problem
        self._rotate()

    def _put(self, path: Path, lines: Iterator[str]) -> None:
        """Under another name first: a reader finds only whole files."""
        part = path.with_name(f"{path.name}.part")
        try:
            with part.open("w", encoding="utf-8") as file:
                for line in _slowly(lines):
                    file.write(line)
            part.replace(path)
        except OSError:
            part.unlink(missing_ok=True)
            raise

    def _rotate(self) -> None:
        mine = [path for suffix in SUFFIXES for path in self._folder.glob(f"{self._prefix}*{suffix}")]
        for stem in sorted({path.stem for path in mine})[: -self._files]:
            for suffix in SUFFIXES:
                (self._folder / f"{stem}{suffix}").unlink(missing_ok=True)


def _slowly(things: Iterable[T]) -> Iterator[T]:
    """The same, with a pause after every LINES_AT_ONCE."""
    source = iter(things)
    while chunk := list(itertools.islice(source, LINES_AT_ONCE)):
        yield from chunk
        time.sleep(PAUSE_S)
