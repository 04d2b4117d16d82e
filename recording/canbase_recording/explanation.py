"""A whole recording explained, read once: its network, its events, its stops. Pure; memory does not grow with it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

from canbase_config.eds_file import Eds
from canbase_config.robot import Robot
from canbase_recording.echo import EchoFilter
from canbase_recording.entry import Entry, RecordedFrame
from canbase_recording.event import Event
from canbase_recording.frame_words import Decoder
from canbase_recording.network import Network
from canbase_recording.note_events import NoteEvents
from canbase_recording.pdo_layouts import PdoLayouts
from canbase_recording.story import Story
from canbase_recording.story_finder import StoryFinder

MOST_EVENTS: Final = 3_000
"""Of the whole recording, the first ones; the stops have theirs."""
BITRATE: Final = 500_000
"""Assumed for the bus load without robot.yaml [bit/s]."""
COMMAND_S: Final = 0.2
"""Default of timeouts.command_s [s]."""


@dataclass(slots=True)
class Explanation:
    """What one recording shows."""

    robot: Robot | None
    network: Network
    decoder: Decoder
    layouts: PdoLayouts
    frames: int = 0
    notes: int = 0
    echoes: int = 0
    ended_s: float = 0.0
    events: list[Event] = field(default_factory=list)
    events_left_out: int = 0
    stories: list[Story] = field(default_factory=list)
    further_stops: int = 0


def explain(
    entries: Iterable[Entry], robot: Robot | None = None, eds_files: Sequence[Eds] = (), bitrate: int | None = None
) -> Explanation:
    """Reads all entries. `bitrate` [bit/s]: of the bus; None: that of robot.yaml, else 500 kbit/s is assumed."""
    layouts = PdoLayouts(robot)
    decoder = Decoder(layouts, robot, eds_files)
    network = Network(decoder, layouts, bitrate or (robot.bus.bitrate if robot else BITRATE))
    notes = NoteEvents(robot.timeouts.command_s if robot else COMMAND_S)
    finder, echo = StoryFinder(layouts, robot), EchoFilter()
    told = Explanation(robot, network, decoder, layouts)
    for entry in echo.without(entries):
        told.ended_s = entry.at_s
        finder.on_entry(entry)
        for event in notes.stale(entry.at_s):
            _take(told, finder, event)
        if isinstance(entry, RecordedFrame):
            told.frames += 1
            found = network.on_frame(entry)
        else:
            told.notes += 1
            found = notes.on_note(entry, powered=network.is_enabled)
        for event in found:
            _take(told, finder, event)
    for event in network.end(told.ended_s):
        _take(told, finder, event)
    if (note := notes.cut_off(told.ended_s)) is not None:
        finder.on_entry(note)
        for event in notes.on_note(note):
            _take(told, finder, event)
    finder.end(told.ended_s)
    told.stories, told.further_stops, told.echoes = finder.stories, finder.further, echo.echoes
    return told


def _take(told: Explanation, finder: StoryFinder, event: Event) -> None:
    finder.on_event(event)
    if len(told.events) < MOST_EVENTS:
        told.events.append(event)
    else:
        told.events_left_out += 1
