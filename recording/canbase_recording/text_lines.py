"""The lines of a recording in a text format, as python-can's readers take them. Notes go aside; sizes are bounded."""

from __future__ import annotations

import io
import re
from collections import deque
from typing import Final

LONGEST_LINE: Final = 16_384
"""Characters; the longest line of a format that is read here is shorter."""
_ASC_HEADER: Final = re.compile(
    r"date\s|base\s|(?:no\s+)?internal\s+events|(?:begin|end)\s+triggerblock|\d+\.\d+\s+start of measurement",
    re.IGNORECASE,
)
_ASC_NOTE: Final = re.compile(r"(?:(\d+\.\d+)\s+)?//\s?(?:(\d+\.\d+) )?(.*)", re.DOTALL)
"""python-can writes an event's time before the slashes, canbase a note's behind them."""
RESUMED: Final = ("internal events logged\n",)
"""What a new ASC reader needs before it takes the next line as a frame."""


class TextLines(io.TextIOBase):
    """A text file line by line. `notes`: comment lines that were passed since they were last taken, with their time.

    `frame_lines` counts the lines that should have been frames.
    """

    def __init__(self, file: io.BufferedIOBase, *, is_asc: bool) -> None:
        self.notes: deque[tuple[float | None, str]] = deque()
        self.frame_lines = self.cut_lines = 0
        self.header: dict[str, str] = {}
        """First words of the header's lines, in lower case, and the whole line."""
        self._file, self._is_asc = file, is_asc
        self._next: deque[str] = deque()

    def read(self, size: int | None = -1) -> str:
        """Not used by the readers of formats that have lines."""
        raise io.UnsupportedOperation("read")

    def write(self, text: str) -> int:
        """This file is read alone."""
        raise io.UnsupportedOperation("write")

    def close(self) -> None:
        """A reader closes what it has read; the file belongs to `RecordingFile`."""

    def resume(self) -> None:
        """A new reader takes over after a line that the one before could not read."""
        if self._is_asc:
            self._next.extend((self.header.get("base", "base hex timestamps absolute\n"), *RESUMED))

    def readline(self, size: int | None = -1) -> str:  # type: ignore[override]
        """The next line for the reader; empty at the end."""
        if self._next:
            return self._next.popleft()
        while raw := self._file.readline(LONGEST_LINE):
            line = raw.decode("utf-8", errors="replace")
            if not raw.endswith(b"\n") and len(raw) >= LONGEST_LINE:
                self._skip_rest()
                self.cut_lines += 1
                continue
            if self._is_asc and "//" in line and _ASC_NOTE.fullmatch(line.strip()):
                self._note(line.strip())
                continue
            if self._is_asc and _ASC_HEADER.match(line.strip()):
                self._keep_header(line.strip())
            elif line.strip() and not line.startswith(";"):  # a comment of TRC
                self.frame_lines += 1
            return line if line.endswith("\n") else line + "\n"
        return ""

    def _skip_rest(self) -> None:
        while (raw := self._file.readline(LONGEST_LINE)) and not raw.endswith(b"\n"):
            continue

    def _note(self, line: str) -> None:
        match = _ASC_NOTE.fullmatch(line)
        if match is not None:
            at_s = match[1] or match[2]
            self.notes.append((float(at_s) if at_s else None, match[3]))

    def _keep_header(self, line: str) -> None:
        key = line.split(None, 1)[0].lower()
        if key not in ("begin", "end"):
            self.header.setdefault(key, line + "\n")
