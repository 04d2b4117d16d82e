"""The thread that writes recordings of inputs, line by line: slowly, bounded in number. Nothing depends on it."""

from __future__ import annotations

import itertools
import queue
import re
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Final

from canbase_base.own_folder import replaced

WAITING: Final = 4
LINES_AT_ONCE: Final = 5
PAUSE_S: Final = 0.001
"""A pause after this many lines: the executor never waits for the interpreter for long."""
SUFFIX: Final = ".jsonl"

Lines = Callable[[], Iterator[str]]
"""Called in the thread."""


def state_folder(given: str | None, environment: Mapping[str, str], home: Path) -> Path:
    """`given`, else the first folder that systemd gives (StateDirectory=), else the user's state folder."""
    if given:
        return Path(given)
    first = environment.get("STATE_DIRECTORY", "").partition(":")[0]
    return Path(first or Path(environment.get("XDG_STATE_HOME") or home / ".local" / "state") / "canbase")


class InputFiles(threading.Thread):
    """Writes what `submit` is given, until `finish`."""

    def __init__(self, folder: Path, prefix: str, files: int, say: Callable[[str], object]) -> None:
        """`prefix`: of the names. `files`: so many of them are kept. `say`: takes a sentence, from this thread."""
        super().__init__(name="inputs", daemon=True)
        self._folder, self._prefix, self._files, self._say = folder, prefix, files, say
        self._jobs: queue.Queue[tuple[float, str, Lines] | None] = queue.Queue(WAITING)
        self._problem = ""

    def submit(self, wall_s: float, cause: str, lines: Lines) -> None:
        """Have a file written; dropped when too many wait. `wall_s`: of the stop, since 1970 [s]. Never waits."""
        if not self._jobs.full():
            self._jobs.put_nowait((wall_s, cause, lines))

    def finish(self, timeout_s: float) -> None:
        """Write what waits, at most for this long [s], and end."""
        try:
            self._jobs.put(None, timeout=timeout_s)
        except queue.Full:
            return
        if self.is_alive():
            self.join(timeout_s)

    def run(self) -> None:
        """The thread's body."""
        while (job := self._jobs.get()) is not None:
            try:
                self._write(*job)
                problem = ""
            except OSError as error:
                problem = f"inputs cannot be recorded in {self._folder}: {error.strerror or error}"
            if problem and problem != self._problem:
                self._say(f"{problem}. Check the folder (black_box.folder) and the disk")
            self._problem = problem

    def _write(self, wall_s: float, cause: str, lines: Lines) -> None:
        """A reader finds only whole files."""
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        stamp = f"{time.strftime('%Y%m%dT%H%M%S', time.gmtime(wall_s))}.{int(wall_s * 1000.0) % 1000:03d}Z"
        path = self._folder / f"{self._prefix}{stamp}_{re.sub('[^a-z0-9]+', '_', cause.lower())}{SUFFIX}"
        with replaced(path) as file:
            file.writelines(piece.encode() for piece in _slowly(lines()))
        for old in sorted(self._folder.glob(f"{self._prefix}*{SUFFIX}"))[: -self._files]:
            old.unlink(missing_ok=True)


def _slowly(pieces: Iterator[str]) -> Iterator[str]:
    """The same, many in one, with a pause after each."""
    while chunk := "".join(itertools.islice(pieces, LINES_AT_ONCE)):
        yield chunk
        time.sleep(PAUSE_S)
