"""The thread that writes recordings to files, beside the control loop: slowly, and bounded in number and size.

Each recording has two files: frames and notes as .asc, and what does not fit there as .json (black_box_json.py). A
folder that cannot be written or a full disk is reported once, and once when it is over; the robot is not disturbed.
A recording on request takes neither the place nor the files of one of a stop.
"""

from __future__ import annotations

import itertools
import math
import os
import queue
import re
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from canbase_base.own_folder import replaced
from canbase_config.black_box import BlackBox
from canbase_driver.runtime.black_box import Cut, EventEntry, Recording, asc_lines
from canbase_driver.runtime.black_box_json import json_lines
from canbase_driver.runtime.black_box_notes import title
from canbase_driver.supervision.stop_history import StopRecord
from canbase_runtime.input_files import state_folder

WAITING = 4
"""Recordings that may wait to be written; more are dropped: a stop every second shows nothing new."""
REQUEST_EVERY_S = 5.0
"""Between two recordings that are requested: writing one takes the interpreter a second [s]."""
LINES_AT_ONCE = 20
ENTRIES_AT_ONCE = 2000
"""Of a ring that is sorted out, which takes less for each."""
PAUSE_S = 0.001
"""A pause after this many lines: the control thread never waits for the interpreter longer than they take, 0.3 ms."""
SUFFIXES = (".json", ".asc")
"""In the order in which they appear: who sees the second one has both."""

T = TypeVar("T")
Late = Callable[[Recording], Iterable[EventEntry]]
"""Events of the time of a recording that something else has kept, one by one; called from the writer's thread."""


Written = Callable[[str, str], None]
"""Takes the path of the .asc, and why it could not be written (empty: it was); called from the writer's thread."""


STOP, REQUEST = "stop", "record"
"""How the names of files begin."""


@dataclass(frozen=True, slots=True)
class _Job:
    kind: str
    stem: str
    cut: Cut
    record: StopRecord
    late: Late
    done: Written


class BlackBoxWriter(threading.Thread):
    """Writes what `submit` is given, until `finish`. `failure`: the defect that ended it."""

    def __init__(
        self, config: BlackBox, robot: str, say: Callable[[str], None], about: Mapping[str, Any] | None = None
    ) -> None:
        """`say`: takes a sentence for the log, from this thread. `about`: what each .json file has of robot and
        software, black_box_about.py."""
        super().__init__(name="black box", daemon=True)
        self._folder = state_folder(config.folder, os.environ, Path.home())
        self._robot = robot
        self._files = config.files
        self._say, self._about = say, about or {}
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._room = threading.BoundedSemaphore(WAITING)
        """For recordings of stops that wait."""
        self._request = threading.Lock()
        """Held while a requested recording waits or is written."""
        self._requested_at_s = -math.inf
        self._problem = ""
        self.failure: BaseException | None = None

    def submit(self, recording: Recording, record: StopRecord, late: Late = lambda _recording: ()) -> str:
        """Have it written. The path of its .asc; empty when it is dropped, or when the last one could not be written.

        Never waits.
        """
        if not self._room.acquire(blocking=False):
            return ""
        stem = f"{self._stem(STOP, record, recording.wall_offset_s)}_{_name_of(record.cause)}"
        self._jobs.put(_Job(STOP, stem, lambda _pace: recording, record, late, _unused))
        return "" if self._problem else str(self._folder / f"{stem}.asc")

    def request(
        self, keep: Callable[[], Cut], record: StopRecord, wall_offset_s: float, late: Late, done: Written
    ) -> str:
        """Have written what `keep` takes out of the ring, though nothing has stopped the base.

        Why not now; empty: `done` will be called. Never waits.
        """
        again_s = self._requested_at_s + REQUEST_EVERY_S - record.at_s
        if again_s > 0.0:
            return f"a recording was requested less than {REQUEST_EVERY_S:.0f} s ago; again in {again_s:.1f} s"
        if not self._request.acquire(blocking=False):
            return "a recording that was requested before is still being written"
        self._requested_at_s = record.at_s

        def written(path: str, problem: str) -> None:
            self._request.release()
            done(path, problem)

        self._jobs.put(_Job(REQUEST, self._stem(REQUEST, record, wall_offset_s), keep(), record, late, written))
        return ""

    def _stem(self, kind: str, record: StopRecord, wall_offset_s: float) -> str:
        wall_s = record.at_s + wall_offset_s
        stamp = time.strftime("%Y%m%dT%H%M%S", time.gmtime(wall_s))
        return f"{kind}_{self._robot}_{stamp}.{int(wall_s * 1000.0) % 1000:03d}Z"

    def finish(self, timeout_s: float) -> None:
        """Write what waits, at most for this long [s], and end."""
        self._jobs.put(None)
        self.join(timeout_s)

    def run(self) -> None:
        """The thread's body."""
        try:
            self._attempt(self._prepare)
            while (job := self._jobs.get()) is not None:
                if job.kind == STOP:
                    self._room.release()
                problem = self._attempt(lambda job=job: self._write(job))  # type: ignore[misc]
                job.done(str(self._folder / f"{job.stem}.asc"), problem)
        except BaseException as error:  # noqa: BLE001 - main sees it, stops the robot and ends the process
            self.failure = error

    def _attempt(self, act: Callable[[], None]) -> str:
        """Why it failed; empty: it did not."""
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
        return problem

    def _prepare(self) -> None:
        """Find out now, not at the first stop."""
        self._folder.mkdir(parents=True, exist_ok=True)
        probe = self._folder / f".{STOP}_{self._robot}_probe"
        probe.write_text("", encoding="ascii")
        probe.unlink()

    def _write(self, job: _Job) -> None:
        """Where one of the two files cannot be written the other one is, if it can."""
        self._folder.mkdir(parents=True, exist_ok=True)
        cut = job.cut(lambda entries: _slowly(entries, ENTRIES_AT_ONCE))
        events = [*cut.events, *_slowly(job.late(cut))]
        recording = replace(cut, events=tuple(sorted(events, key=lambda event: event[0])))
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
        self._rotate(f"{job.kind}_{self._robot}_")

    def _put(self, path: Path, lines: Iterator[str]) -> None:
        """A reader finds only whole files."""
        with replaced(path) as file:
            file.writelines(line.encode() for line in _slowly(lines))

    def _rotate(self, prefix: str) -> None:
        mine = [path for suffix in SUFFIXES for path in self._folder.glob(f"{prefix}*{suffix}")]
        for stem in sorted({path.stem for path in mine})[: -self._files]:
            for suffix in SUFFIXES:
                (self._folder / f"{stem}{suffix}").unlink(missing_ok=True)


def _unused(_path: str, _problem: str) -> None:
    """Nobody waits for the recording of a stop: the log has the problem, and the next stop reports no path."""


def _name_of(cause: str) -> str:
    return re.sub("[^a-z0-9]+", "_", cause.lower())


def _slowly(things: Iterable[T], at_once: int = LINES_AT_ONCE) -> Iterator[T]:
    """The same, with a pause after every `at_once`."""
    source = iter(things)
    while chunk := list(itertools.islice(source, at_once)):
        yield from chunk
        time.sleep(PAUSE_S)
