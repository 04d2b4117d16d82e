"""The last seconds of CAN frames, commands and states in memory, and as a text of Vector's ASC format. No files.

No threads either. python-can, SavvyCAN, CANalyzer and others read ASC; what is no frame (commands, states) stands
between the frames as comment lines, which readers pass over and people can read. The same as exact values is an event,
for black_box_json.py.
"""

from __future__ import annotations

import heapq
import io
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import can

MAX_FRAMES = 80_000
"""A full bus of 1 Mbit/s for ten seconds; about 15 MB in memory, 6 MB in a file."""
WAITED = 2_500
"""More frames than wait in a socket while the driver does not run."""
MAX_NOTES = 10_000
MAX_EVENTS = 12_000
"""About 2 MB in a file; 7 MB where another node floods the driver with states of the longest texts."""

FrameEntry = tuple[float, int, bytes, bool]
"""Local monotonic time [s], COB-ID, data, received. A plain tuple: the garbage collector need not look at it."""
NoteEntry = tuple[float, str]
"""Local monotonic time [s] and one line of text."""
EventEntry = tuple[float, str, Mapping[str, Any]]
"""Local monotonic time [s], what it is (docs/ros_api.md, "The black box"), and its values: plain ones alone."""


@dataclass(frozen=True, slots=True)
class Recording:
    """What was in the ring. `wall_offset_s` on top of a monotonic time is the time since 1970 [s]."""

    frames: tuple[FrameEntry, ...]
    notes: tuple[NoteEntry, ...]
    wall_offset_s: float
    events: tuple[EventEntry, ...] = ()

    @property
    def began_s(self) -> float:
        """Local monotonic time of the zero of the ASC file: its first entry [s]."""
        return min([frame[0] for frame in self.frames[:WAITED]] + [note[0] for note in self.notes[:1]], default=0.0)


Pace = Callable[[Iterable[Any]], Iterable[Any]]
"""Gives the same things, with pauses between them or without."""
Cut = Callable[[Pace], Recording]


class Ring:
    """Keeps the newest entries. Any thread may add: appending to a deque is atomic in CPython, and so is copying it."""

    def __init__(self, seconds: float) -> None:
        """`seconds`: how far a recording goes back."""
        self._seconds = seconds
        self._frames: deque[FrameEntry] = deque(maxlen=MAX_FRAMES)
        self._notes: deque[NoteEntry] = deque(maxlen=MAX_NOTES)
        self._events: deque[EventEntry] = deque(maxlen=MAX_EVENTS)

    @property
    def seconds(self) -> float:
        """How far a recording goes back."""
        return self._seconds

    def frame(self, now_s: float, cob_id: int, data: bytes, received: bool) -> None:
        """A frame was received, or given to the bus. `now_s`: when the kernel had it."""
        self._frames.append((now_s, cob_id, data, received))

    def note(self, now_s: float, text: str) -> None:
        """Something else happened."""
        self._notes.append((now_s, text))

    def event(self, now_s: float, what: str, values: Mapping[str, Any]) -> None:
        """The same with its exact values. They are kept as they are: nobody may change them."""
        self._events.append((now_s, what, values))

    def cut(self, now_s: float, wall_offset_s: float) -> Recording:
        """What happened in the last seconds before `now_s`."""
        return self.cut_later(now_s, wall_offset_s)(iter)

    def cut_later(self, now_s: float, wall_offset_s: float) -> Cut:
        """The same, kept as it is now and sorted out when it is called: that takes longer than keeping it."""
        since = now_s - self._seconds
        frames, notes, events = self._frames.copy(), self._notes.copy(), self._events.copy()
        return lambda pace: Recording(
            tuple(entry for entry in pace(frames) if entry[0] >= since),
            tuple(entry for entry in pace(notes) if entry[0] >= since),
            wall_offset_s,
            tuple(entry for entry in pace(events) if entry[0] >= since),
        )


def in_order(frames: Sequence[FrameEntry]) -> Iterator[FrameEntry]:
    """By time, one by one: a frame that waited in the socket came before others that were sent meanwhile.

    A sort of all of them at once would hold the interpreter up for milliseconds.
    """
    waiting = list(frames[:WAITED])
    heapq.heapify(waiting)
    for at in range(len(waiting), len(frames)):
        yield heapq.heappushpop(waiting, frames[at])
    yield from sorted(waiting)


def asc_lines(recording: Recording, title: str) -> Iterator[str]:
    """The recording as an ASC file, piece by piece in the order of time; `title` is its first comment."""
    text = io.StringIO()
    writer = can.ASCWriter(text)
    start = recording.began_s
    writer.log_event(f"// {title}", start + recording.wall_offset_s)
    notes = deque(recording.notes)
    for at, cob_id, data, received in in_order(recording.frames):
        while notes and notes[0][0] <= at:
            _write_note(text, *notes.popleft(), start)
        writer.on_message_received(
            can.Message(at + recording.wall_offset_s, cob_id, is_extended_id=False, data=data, is_rx=received)
        )
        yield _taken(text)
    for note in notes:
        _write_note(text, *note, start)
    text.write("End TriggerBlock\n")
    yield _taken(text)


def _write_note(text: io.StringIO, at: float, line: str, start: float) -> None:
    text.write(f"// {at - start:.6f} {line}\n")


def _taken(text: io.StringIO) -> str:
    """What was written since the last call."""
    piece = text.getvalue()
    text.seek(0)
    text.truncate()
    return piece
