"""A recording on disk, entry by entry, by python-can's readers: ASC, candump, BLF, TRC; MCAP and a watchdog's inputs.

The shell of this package. Memory does not grow with the file. Whatever is broken is counted, and what can be read is
given: nothing in a file raises but a file that is no recording at all.
"""

from __future__ import annotations

import contextlib
import json
import math
import re
import struct
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from datetime import datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import can

from canbase_driver.supervision.watchdog_link import (
    LEASE_AGE_UNKNOWN,
    STATE_COB_ID,
    STATE_LAYOUT,
    TRIPPED,
    WATCHING,
)
from canbase_recording import foreign_reader
from canbase_recording.entry import Entry, FrameKind, Note, RecordedFrame
from canbase_recording.text_lines import TextLines

_BROKEN: Final = (ValueError, IndexError, KeyError, TypeError, OverflowError, RecursionError, struct.error)
"""What a line of a watchdog raises that is none."""
CLOCK_STEP_S: Final = 0.1
"""A frame that is older than the one before by more: the clock was set back. By less: it was written out of order."""
GAP_S: Final = 60.0
"""A pause of this length is worth a remark."""
LATEST_S: Final = 2.0**31 - 1.0
"""Since 1970: later times do not fit into a ROS message."""
MOST_RESTARTS: Final = 1_000_000
HEAD_BYTES: Final = 4_096
WATCHDOGS: Final = (b'{"format": 2, "part": "watchdog"', b'{"format": 1, "part": "watchdog"')
LINE_BYTES: Final = 200_000
_SCREEN: Final = re.compile(
    r"\s*\((?P<at>\d+\.\d+)\)\s+(?P<channel>\S+)\s+(?:(?P<way>TX|RX)\s+[-BE ]+\s+)?"
    r"(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[(?P<length>\d+)\]\s*(?P<data>(?:[0-9A-Fa-f]{2}\s*)*|remote request)"
)
"""What candump prints on a screen with -t a or -t z, with -x too."""


class NoRecordingError(Exception):
    """The file cannot be read, or nothing in it is a recording. The text names file and reason."""


@dataclass(slots=True)
class Problems:
    """What is wrong with a recording, counted."""

    broken: int = 0
    """Lines or objects that could not be understood."""
    backward: int = 0
    """Clock steps backward; the time of the recording goes on from there."""
    backward_s: float = 0.0
    gaps: int = 0
    longest_gap_s: float = 0.0
    truncated: str = ""
    """Why reading ended before the end of the file."""
    other_channels: Counter[str] = field(default_factory=Counter)
    """Frames that were left out, by channel."""

    @property
    def sentences(self) -> list[str]:
        """For people, the worst first; empty: nothing is wrong."""
        found = []
        if self.truncated:
            found.append(f"the file ends early: {self.truncated}")
        if self.broken:
            found.append(f"{self.broken} lines or objects could not be read; they were left out")
        if self.backward:
            found.append(
                f"the clock stepped backward {self.backward} times, by {self.backward_s:.3f} s in all; "
                "times after a step continue from the last one before it"
            )
        if self.gaps:
            found.append(f"{self.gaps} pauses of more than {GAP_S:.0f} s, the longest {self.longest_gap_s:.0f} s")
        left = ", ".join(f"{count} of {channel}" for channel, count in self.other_channels.most_common(5))
        if left:
            found.append(f"frames of other channels were left out: {left}; --channel selects another one")
        return found


class RecordingFile:
    """One file. `problems` and `frames` are complete when `entries` is at its end."""

    def __init__(self, path: Path, channel: str | None = None) -> None:
        """`channel`: as the file names it; None: that of its first frame. Raises NoRecordingError."""
        self.path, self.problems = path, Problems()
        self.frames = 0
        self._position = 0
        self.began_text = ""
        """Date and time of the first entry, as the file gives them; empty: it does not."""
        self.began_s = 0.0
        """The same in seconds since 1970; 0: the file has no date."""
        self._channel = channel
        self._last_s, self._raw_last_s, self._shift_s = 0.0, math.nan, 0.0
        self._lines: TextLines | None = None
        try:
            self.size = path.stat().st_size
            self._file = path.open("rb")
        except OSError as error:
            raise NoRecordingError(f"{path}: cannot be read: {error.strerror or error}") from error
        try:
            self.format, self._messages = self._choose()
        except BaseException:
            self._file.close()
            raise

    @property
    def position(self) -> int:
        """How many of its `size` bytes have been read."""
        return self.size if self._file.closed else self._position or self._file.tell()

    def __enter__(self) -> RecordingFile:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def entries(self) -> Iterator[Entry]:
        """All of it, once, in the order of the file."""
        try:
            for message in self._messages():
                yield from self._notes()
                if isinstance(message, Note):
                    yield Note(self._time(message.at_s), message.text[:NOTE_LENGTH])
                elif (frame := self._frame(message)) is not None:
                    yield frame
            yield from self._notes()
        except OSError as error:
            self.problems.truncated = error.strerror or str(error)
        if self._lines is not None:
            self.problems.broken = max(self.problems.broken, self._lines.frame_lines - self.frames_read)
            self.problems.broken += self._lines.cut_lines

    @property
    def frames_read(self) -> int:
        """With those of other channels."""
        return self.frames + self.problems.other_channels.total()

    def _choose(self) -> tuple[str, Callable[[], Iterable[Any]]]:
        try:
            head = self._file.read(HEAD_BYTES)
        except OSError as error:
            raise NoRecordingError(f"{self.path}: cannot be read: {error.strerror or error}") from error
        self._file.seek(0)
        text = head.decode("utf-8", errors="replace")
        first = next((line for line in text.splitlines() if line.strip()), "")
        for begin, name, read in (
            (b"LOGG", "BLF", self._foreign),
            (b"\x89MCAP", "MCAP", self._foreign),
            (WATCHDOGS, "inputs of a watchdog", self._inputs),
        ):
            if head.startswith(begin):
                return name, read
        if first.startswith(";") and (self.path.suffix.lower() == ".trc" or first.startswith(";$FILEVERSION")):
            return "TRC", lambda: self._by_lines(can.TRCReader, is_asc=False)
        if _SCREEN.match(first):
            return "candump", self._screen
        if re.match(r"\(\d+(?:\.\d+)?\)\s+\S+\s+[0-9A-Fa-f]+#", first):
            return "candump", lambda: self._by_lines(can.CanutilsLogReader, is_asc=False)
        if re.search(r"^\s*(?:date\s|base\s+(?:hex|dec)|begin\s+triggerblock)", text, re.IGNORECASE | re.MULTILINE):
            self.began_text = _date(text)
            self.began_s = _seconds(self.began_text)
            return "ASC", lambda: self._by_lines(can.ASCReader, is_asc=True)
        what = "it is empty" if not head else f"it begins with {first[:40]!r}"
        raise NoRecordingError(
            f"{self.path}: no recording that is known here (ASC, candump -L, BLF, TRC, MCAP of canbase record export, "
            f"watchdog_….jsonl): {what}. Inputs of mux and filter (velocity_….jsonl): canbase record replay"
        )

    def _by_lines(self, reader: Callable[..., Iterable[can.Message]], *, is_asc: bool) -> Iterator[can.Message]:
        """A reader that stumbles over a line is replaced by a new one, which goes on behind that line."""
        self._lines = lines = TextLines(self._file, is_asc=is_asc)
        since_s = 0.0
        for _ in range(MOST_RESTARTS):
            try:
                current = reader(lines)
                for message in current:
                    if is_asc and getattr(current, "timestamps_format", None) == "relative":
                        since_s += message.timestamp
                        message.timestamp = since_s
                    yield message
                return
            except Exception:  # noqa: BLE001 - python-can's, whatever it raises for a line that it does not understand
                lines.resume()
        self.problems.truncated = f"{MOST_RESTARTS} lines could not be read"

    def _screen(self) -> Iterator[can.Message]:
        self._lines = TextLines(self._file, is_asc=False)
        while line := self._lines.readline():
            match = _SCREEN.fullmatch(line.rstrip())
            if match is None:
                continue
            remote = match["data"].startswith("remote")
            data = b"" if remote else bytes.fromhex(match["data"])
            yield can.Message(
                timestamp=float(match["at"]), arbitration_id=int(match["id"], 16), is_extended_id=len(match["id"]) > 3,
                data=data, is_remote_frame=remote, channel=match["channel"], is_rx=match["way"] != "TX",
                is_fd=len(data) > 8,
            )  # fmt: skip

    def _foreign(self) -> Iterator[can.Message | Note]:
        """By a library in a process of its own. What follows a broken container cannot be found again."""
        if self.format == "MCAP" and find_spec("mcap_ros2") is None:
            self.problems.truncated = "MCAP needs a Python package: pip install 'mcap-ros2-support>=0.5,<1'"
            return
        for message in foreign_reader.messages(self.format, self._file, self.size, self.problems):
            if isinstance(message, int):
                self._position = message
            else:
                yield message

    def _inputs(self) -> Iterator[can.Message]:
        """The frames that a watchdog received: of a stop in which the driver died with its own recording. Its verdicts
        are its state frames: on most buses it does not receive its own."""
        offset_s, leased_s = 0.0, math.nan
        while line := self._file.readline(LINE_BYTES):
            if not line.endswith(b"\n"):
                self.problems.truncated = "its last line is cut off"
                return
            try:
                told = json.loads(line)
                if isinstance(told, dict):
                    offset_s = float(told["wall_offset_s"])
                elif told[0] == "lease":
                    leased_s = float(told[1])
                elif told[0] == "verdict":
                    _, at_s, cause, node_id, _ = told
                    yield can.Message(
                        offset_s + at_s,
                        STATE_COB_ID,
                        is_extended_id=False,
                        data=_state(cause, node_id, at_s - leased_s),
                    )
                elif told[0] == "frame":
                    _, at_s, cob_id, data = told
                    yield can.Message(
                        offset_s + at_s, cob_id, is_extended_id=False, data=bytes.fromhex(data), check=True
                    )
            except _BROKEN:
                self.problems.broken += 1

    def _notes(self) -> Iterator[Note]:
        while self._lines is not None and self._lines.notes:
            at_s, text = self._lines.notes.popleft()
            yield Note(self._last_s if at_s is None else max(at_s, self._last_s), text[:NOTE_LENGTH])

    def _frame(self, message: can.Message) -> RecordedFrame | None:
        if not 0 <= message.arbitration_id < MOST_IDENTIFIERS:
            self.problems.broken += 1
            return None
        channel = "" if message.channel is None else str(message.channel)
        if self._channel is None:
            self._channel = channel
        if channel != self._channel:
            if len(self.problems.other_channels) < MOST_CHANNELS or channel in self.problems.other_channels:
                self.problems.other_channels[channel] += 1
            return None
        self.frames += 1
        kind = frame_kind(message)
        sent = not message.is_rx
        return RecordedFrame(self._time(message.timestamp), message.arbitration_id, bytes(message.data), sent, kind)

    def _time(self, raw_s: float) -> float:
        """Seconds since the first entry, which never go back."""
        if not 0.0 <= raw_s < LATEST_S:  # nan too
            self.problems.broken += 1
            return self._last_s
        if math.isnan(self._raw_last_s):
            relative = self.format in RELATIVE and raw_s < DATED_S
            self._shift_s = 0.0 if relative else -raw_s
            self.began_s = self.began_s if relative else raw_s
            self._raw_last_s = raw_s
        step_s = raw_s - self._raw_last_s
        if step_s < -CLOCK_STEP_S:
            self.problems.backward += 1
            self.problems.backward_s -= step_s
            self._shift_s -= step_s
        if step_s > GAP_S:
            self.problems.gaps += 1
            self.problems.longest_gap_s = max(self.problems.longest_gap_s, step_s)
        self._raw_last_s = raw_s if step_s > 0.0 or step_s < -CLOCK_STEP_S else self._raw_last_s
        if self.began_s + raw_s + self._shift_s < LATEST_S:
            self._last_s = max(self._last_s, raw_s + self._shift_s)
        else:
            self.problems.broken += 1
        return self._last_s


def _state(cause: int, node_id: int, lease_s: float) -> bytes:
    """The watchdog's state frame for a verdict: tripped, or without a cause watching."""
    lease_ms = LEASE_AGE_UNKNOWN if math.isnan(lease_s) else min(round(1000.0 * lease_s), LEASE_AGE_UNKNOWN)
    return STATE_LAYOUT.pack(TRIPPED if cause else WATCHING, cause, 0, node_id, lease_ms, 0, 0)


MOST_CHANNELS: Final = 100
MOST_IDENTIFIERS: Final = 1 << 29
"""Of extended frames; python-can's readers check none."""
NOTE_LENGTH: Final = 1_200
"""Characters; those of canbase are shorter."""
RELATIVE: Final = ("ASC", "TRC")
"""Formats whose times begin with the recording ..."""
DATED_S: Final = 100_000_000.0
"""... except in a TRC file with the date of its start: then its times are seconds since 1970."""
_DATES: Final = (
    "%a %b %d %H:%M:%S.%f %Y",
    "%a %b %d %H:%M:%S %Y",
    "%a %b %d %I:%M:%S.%f %p %Y",
    "%a %b %d %I:%M:%S %p %Y",
)


def _seconds(date: str) -> float:
    """Since 1970, of a date of an ASC file in local time; 0: it is none that is known."""
    for form in _DATES:
        with contextlib.suppress(ValueError, OverflowError):
            began_s = datetime.strptime(date, form).timestamp()  # noqa: DTZ007 - the file has no zone
            return began_s if 0.0 <= began_s < LATEST_S else 0.0
    return 0.0


def frame_kind(message: can.Message) -> FrameKind:
    """What kind of frame python-can has read."""
    if message.is_error_frame:
        return FrameKind.ERROR
    if message.is_extended_id:
        return FrameKind.EXTENDED
    return FrameKind.REMOTE if message.is_remote_frame else FrameKind.DATA


def _date(text: str) -> str:
    """Of the header of an ASC file."""
    for pattern in (r"^\s*begin\s+triggerblock\s+(\S.+)$", r"^\s*date\s+(.+)$"):
        if match := re.search(pattern, text, re.IGNORECASE | re.MULTILINE):
            return match[1].strip()[:60]
    return ""
