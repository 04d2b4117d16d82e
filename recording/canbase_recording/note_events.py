"""What the notes of a black box say happened: who drives, what filter and driver did, and commands that ended. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from canbase_driver.runtime.black_box_notes import driver_note
from canbase_driver.supervision.stop_history import DRIVER, NOBODY
from canbase_recording.entry import Note
from canbase_recording.event import Event, EventKind, Level
from canbase_recording.notes import CommandNote, DriverNote, FilterNote, MuxNote, TitleNote, parse_note
from canbase_runtime.driver_state import DriverState
from canbase_runtime.stop_cause import StopCause

ORDERED_S: Final = 0.3
"""A motion that was ordered so short before is still under way [s]."""
STOPPED: Final = (DriverState.STOPPING, DriverState.LATCHED)
WATCHDOG: Final = "watchdog"
POWERED: Final = (DriverState.ENABLED, DriverState.STOPPING)


class NoteEvents:
    """Takes notes in the order of their time. Only changes are events."""

    def __init__(self, command_timeout_s: float) -> None:
        """`command_timeout_s`: of cmd_vel at the driver, `timeouts.command_s` [s]."""
        self._timeout_s = command_timeout_s
        self._moved_s = self._commanded_s = -math.inf
        self._moves = False
        self._is_stale = True
        self._filter: FilterNote | None = None
        self._mux: MuxNote | None = None
        self._driver: DriverState | None = None
        self._title: TitleNote | None = None

    def on_note(self, note: Note, *, powered: bool = False) -> Sequence[Event]:
        """What this note changes. `powered`: a drive reports operation enabled."""
        parsed = parse_note(note)
        if isinstance(parsed, CommandNote):
            return self._on_command(parsed)
        if isinstance(parsed, FilterNote):
            return self._on_filter(parsed)
        if isinstance(parsed, MuxNote):
            return self._on_mux(parsed)
        if isinstance(parsed, DriverNote):
            return self._on_driver(parsed, powered=powered)
        if isinstance(parsed, TitleNote):
            self._title, text = parsed, _why_written(parsed)
            return [Event(parsed.at_s, EventKind.TITLE, Level.INFO, "recording", text)]
        return ()

    def stale(self, now_s: float) -> Sequence[Event]:
        """The event that commands ended while they ordered motion, once."""
        if self._is_stale or now_s - self._commanded_s <= self._timeout_s:
            return ()
        self._is_stale = True
        if not self._moves:
            return ()
        text = f"no message since {self._commanded_s:.3f} s, while it ordered motion"
        return [Event(now_s, EventKind.COMMAND, Level.ALARM, "cmd_vel", text)]

    def _on_command(self, note: CommandNote) -> Sequence[Event]:
        events = [*self.stale(note.at_s)]
        was = self._moves
        self._commanded_s, self._moves = note.at_s, note.moves
        self._moved_s = note.at_s if note.moves else self._moved_s
        self._is_stale = False
        if was != note.moves:
            text = f"orders {note.linear_mps:.2f} m/s {note.angular_radps:.2f} rad/s" if note.moves else "orders zero"
            events.append(Event(note.at_s, EventKind.COMMAND, Level.INFO, "cmd_vel", text))
        return events

    def _on_filter(self, note: FilterNote) -> Sequence[Event]:
        before, self._filter = self._filter, note
        if before is not None and (before.cause, before.orders_motion) == (note.cause, note.orders_motion):
            return ()
        if note.cause is StopCause.NONE:
            news = before is not None and before.cause is not StopCause.NONE
            return [Event(note.at_s, EventKind.FILTER, Level.INFO, "safety_filter", "free")] if news else ()
        holds = not note.orders_motion
        stops = holds and note.at_s - self._moved_s <= ORDERED_S and (before is None or before.cause is not note.cause)
        what = f"{'stops' if holds else 'slows down'}: {note.cause.value}{f' ({note.detail})' if note.detail else ''}"
        return [Event(note.at_s, EventKind.FILTER, Level.ALARM if stops else Level.INFO, "safety_filter", what)]

    def _on_mux(self, note: MuxNote) -> Sequence[Event]:
        before, self._mux = self._mux, note
        if before is not None and before.active == note.active:
            return ()
        lost = before is not None and not note.active and note.at_s - self._moved_s <= ORDERED_S
        text = f"follows {note.active}" if note.active else f"no source: {note.detail}"
        return [Event(note.at_s, EventKind.MUX, Level.ALARM if lost else Level.INFO, "velocity_mux", text)]

    def cut_off(self, ended_s: float) -> Note | None:
        """The driver's note of the stop for which the recording was written, where the recording ends before it: at
        standstill a stop is over at once. None: nothing is missing."""
        title = self._title
        if title is None or title.stopped_by not in (DRIVER, WATCHDOG) or self._driver in STOPPED:
            return None
        return Note(ended_s, driver_note(f"{DriverState.STOPPING.name}: {title.cause} ({title.detail})"))

    def _on_driver(self, note: DriverNote, *, powered: bool) -> Sequence[Event]:
        before, self._driver = self._driver, note.state
        why = f": {note.cause}" if note.cause else ""
        text = f"{note.state.name}{why}{f' ({note.detail})' if note.detail else ''}"
        stops = note.state in STOPPED or (before in POWERED and note.state is not DriverState.ENABLED)
        begins = before is not None or note.state is not DriverState.LATCHED or powered
        level = Level.ALARM if stops and begins else Level.INFO
        earlier = "" if begins else " (since before the recording)"
        return [Event(note.at_s, EventKind.DRIVER, level, "motor_driver", text + earlier)]


def _why_written(title: TitleNote) -> str:
    if title.stopped_by == NOBODY:
        return f"written without a stop: {title.cause} ({title.detail})"
    return f"written for a stop by {title.stopped_by}: {title.cause} ({title.detail})"
