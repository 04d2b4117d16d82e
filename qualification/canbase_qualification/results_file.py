"""results.jsonl: outcomes as they come, and sorted once all are there. What was cut off is read up to there."""

from __future__ import annotations

import fcntl
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO, Final

from canbase_base.own_folder import replaced
from canbase_qualification.outcome import BrokenLineError, Outcome

NAME: Final = "results.jsonl"


class ResultsError(ValueError):
    """A file that cannot be used: a sentence with its name, and what can be done."""


def read(path: Path) -> Iterator[Outcome]:
    """All whole lines. ResultsError: a line in the middle is no outcome. OSError."""
    for _, _, outcome in _lines(path):
        yield outcome


def _lines(path: Path) -> Iterator[tuple[int, bytes, Outcome]]:
    """Where each whole line begins, its bytes, and its outcome."""
    at = 0
    with path.open("rb") as file:
        for number, line in enumerate(file, start=1):
            if not line.endswith(b"\n"):  # cut off: nothing follows
                return
            try:
                yield at, line, Outcome.of_line(line.decode("utf-8"))
            except (BrokenLineError, UnicodeDecodeError) as error:
                raise ResultsError(f"{path}:{number}: {error}. Delete this line, or choose another --output") from error
            at += len(line)


class ResultsFile:
    """Open for writing, by one process at a time. As a context.

    `done`: kind and seed of each outcome that was there when it was opened.
    """

    def __init__(self, folder: Path) -> None:
        """ResultsError: a line is no outcome, or another process writes there. OSError."""
        self.path = folder / NAME
        self._file: IO[bytes] = self.path.open("ab")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self.before = tuple(read(self.path)) if self.path.stat().st_size else ()
            self._cut()
        except BlockingIOError as error:
            self._file.close()
            raise ResultsError(f"{self.path}: another canbase prove qualify writes there") from error
        except ResultsError:
            self._file.close()
            raise
        self.done = frozenset((outcome.kind, outcome.seed) for outcome in self.before)

    def __enter__(self) -> ResultsFile:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def _cut(self) -> None:
        """Takes away what is behind the last whole line."""
        end = sum(len(line) for _, line, _ in _lines(self.path))
        self._file.truncate(end)

    def append(self, outcomes: Iterable[Outcome]) -> None:
        """All of them at once; they are in the file when this returns."""
        self._file.write(b"".join(f"{outcome.line()}\n".encode() for outcome in outcomes))
        self._file.flush()

    def sort(self) -> None:
        """By kind and seed: the same runs give the same file, whoever was faster. A crash leaves the file as it was."""
        places = sorted((outcome.key, at, len(line)) for at, line, outcome in _lines(self.path))
        with self.path.open("rb") as old, replaced(self.path) as file:
            for _, at, length in places:
                old.seek(at)
                file.write(old.read(length))
