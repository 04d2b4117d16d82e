"""The thread that writes recordings to files, beside the control loop: slowly, and bounded in number and size.

A folder that cannot be written or a full disk is reported once, and once when it is over; the robot is not disturbed.
"""

from __future__ import annotations

import itertools
import os
import queue
import re
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from canbase_config.black_box import BlackBox
from canbase_driver.runtime.black_box import Recording, asc_lines

WAITING = 4
"""Recordings that may wait to be written; more are dropped: a stop every second shows nothing new."""
LINES_AT_ONCE = 20
PAUSE_S = 0.001
"""A pause after this many lines: the control thread never waits for the interpreter longer than they take, 0.3 ms."""


def state_folder(environment: Mapping[str, str], home: Path) -> Path:
    """Where recordings go by default: what systemd gives (StateDirectory=), else the user's state folder."""
    given = environment.get("STATE_DIRECTORY", "").partition(":")[0]
    if given:
        return Path(given)
    return Path(environment.get("XDG_STATE_HOME") or home / ".local" / "state") / "canbase"


@dataclass(frozen=True, slots=True)
class _Job:
    path: Path
    recording: Recording
    title: str


class BlackBoxWriter(threading.Thread):
    """Writes what `submit` is given, until `finish`. `failure`: the defect that ended it."""

    def __init__(self, config: BlackBox, robot: str, say: Callable[[str], None]) -> None:
        """`say`: takes a sentence for the log, from this thread."""
        super().__init__(name="black box", daemon=True)
        self._folder = Path(config.folder) if config.folder else state_folder(os.environ, Path.home())
        self._prefix = f"stop_{robot}_"
        self._files = config.files
        self._say = say
        self._jobs: queue.Queue[_Job | None] = queue.Queue(WAITING)
        self._problem = ""
        self.failure: BaseException | None = None

    def submit(self, recording: Recording, cause: str, wall_s: float, title: str) -> str:
        """Have it written. The path that it gets; empty when it is dropped, or when the last one could not be written.

        `wall_s`: time of the stop since 1970 [s]. Never waits.
        """
        stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(wall_s))
        millis = int(wall_s * 1000.0) % 1000
        name = f"{self._prefix}{stamp[:-1]}.{millis:03d}Z_{re.sub('[^a-z0-9]+', '_', cause.lower())}.asc"
        path = self._folder / name
        try:
            self._jobs.put_nowait(_Job(path, recording, title))
        except queue.Full:
            return ""
        return "" if self._problem else str(path)

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
        """Under another name first: a reader finds only whole files."""
        self._folder.mkdir(parents=True, exist_ok=True)
        part = job.path.with_suffix(".part")
        try:
            with part.open("w", encoding="utf-8") as file:
                lines = asc_lines(job.recording, job.title)
                while chunk := "".join(itertools.islice(lines, LINES_AT_ONCE)):
                    file.write(chunk)
                    time.sleep(PAUSE_S)
            part.replace(job.path)
        except OSError:
            part.unlink(missing_ok=True)
            raise
        self._rotate()

    def _rotate(self) -> None:
        mine = sorted(path for path in self._folder.glob(f"{self._prefix}*.asc"))
        for path in mine[: -self._files]:
            path.unlink(missing_ok=True)
