"""`canbase record export`: a recording as an MCAP file of ROS messages, which Foxglove and PlotJuggler open."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from mcap_ros2.writer import Writer

from canbase_config.robot import Robot
from canbase_recording.entry import FrameKind, Note, RecordedFrame
from canbase_recording.event import Event, Level
from canbase_recording.frame_words import Decoder
from canbase_recording.mcap_schemas import (
    COMMAND_TOPIC,
    FRAMES_TOPIC,
    JOINTS_TOPIC,
    LOG_TOPIC,
    NOTES_TOPIC,
    ORDERED_TOPIC,
    SENT,
    TYPES,
    definition,
)
from canbase_recording.network import Network
from canbase_recording.note_events import NoteEvents
from canbase_recording.notes import CommandNote, parse_note
from canbase_recording.pdo_layouts import PdoLayouts
from canbase_recording.recording_file import RecordingFile
from canbase_recording.wheel_states import WheelStates
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable

RAW_SUFFIX: Final = "_raw"
"""Of the topics of joints whose numbers have no unit: without robot.yaml."""
_LEVELS: Final = {Level.INFO: 20, Level.WARNING: 30, Level.ALARM: 40}
"""rcl_interfaces/msg/Log: INFO, WARN, ERROR."""


class McapExport:
    """Writes one recording. `written`: messages by topic."""

    def __init__(self, recording: RecordingFile, writer: Writer, robot: Robot | None) -> None:
        """Raises OSError."""
        self._recording, self._writer = recording, writer
        layouts = PdoLayouts(robot)
        self._network = Network(Decoder(layouts, robot), layouts, robot.bus.bitrate if robot else 500_000)
        self._notes = NoteEvents(robot.timeouts.command_s if robot else 0.2)
        self._wheels = WheelStates(layouts, robot)
        self._suffix = {} if robot else dict.fromkeys((JOINTS_TOPIC, ORDERED_TOPIC), RAW_SUFFIX)
        self._schemas = {name: writer.register_msgdef(name, definition(name)) for name in TYPES.values()}
        self.written: Counter[str] = Counter()

    def run(self) -> None:
        """All of it. Raises OSError."""
        for entry in self._recording.entries():
            events = self._on_frame(entry) if isinstance(entry, RecordedFrame) else self._on_note(entry)
            for event in events:
                self._log(event)

    def _on_frame(self, frame: RecordedFrame) -> Iterable[Event]:
        kind, data = frame.kind, frame.data[:8]
        message = {
            "id": frame.cob_id, "is_rtr": kind is FrameKind.REMOTE, "is_extended": kind is FrameKind.EXTENDED,
            "is_error": kind is FrameKind.ERROR, "dlc": len(data), "data": data.ljust(8, b"\0"),
        }  # fmt: skip
        self._add(FRAMES_TOPIC, frame.at_s, message, SENT if frame.sent else "")
        measured, ordered = self._wheels.on_frame(frame)
        if measured:
            self._joints(JOINTS_TOPIC, frame.at_s, self._wheels.measured, angles=True)
        if ordered:
            self._joints(ORDERED_TOPIC, frame.at_s, self._wheels.ordered, angles=False)
        return self._network.on_frame(frame)

    def _on_note(self, note: Note) -> Iterable[Event]:
        self._add(NOTES_TOPIC, note.at_s, {"data": note.text})
        parsed = parse_note(note)
        if isinstance(parsed, CommandNote):
            linear, angular = ({"x": 0.0, "y": 0.0, "z": 0.0} for _ in range(2))
            linear["x"], angular["z"] = parsed.linear_mps, parsed.angular_radps
            self._add(COMMAND_TOPIC, note.at_s, {"twist": {"linear": linear, "angular": angular}})
        return self._notes.on_note(note)

    def _joints(self, topic: str, at_s: float, speeds: dict[str, float], *, angles: bool) -> None:
        names = sorted(speeds)
        angle = self._wheels.angles(names) if angles else []
        velocity = [speeds[name] for name in names]
        self._add(topic, at_s, {"name": names, "position": angle, "velocity": velocity, "effort": []})

    def _log(self, event: Event) -> None:
        text = {"name": printable(event.who), "msg": printable(event.text, SENTENCE_LENGTH)}
        self._add(LOG_TOPIC, event.at_s, {"level": _LEVELS[event.level], **text, "file": "", "function": "", "line": 0})

    def _add(self, topic: str, at_s: float, message: dict[str, Any], frame_id: str = "") -> None:
        at_ns = round((self._recording.began_s + at_s) * 1e9)
        stamp = dict(zip(("sec", "nanosec"), divmod(at_ns, 1_000_000_000), strict=True))
        stamped = {"stamp": stamp, "header": {"stamp": stamp, "frame_id": frame_id}, **message}
        name = topic + self._suffix.get(topic, "")
        self._writer.write_message(name, self._schemas[TYPES[topic]], stamped, at_ns, at_ns)
        self.written[name] += 1


def export(source: Path, target: Path, robot: Robot | None, channel: str | None) -> tuple[RecordingFile, Counter[str]]:
    """Reads `source` and writes `target`, which must not exist: messages by topic.

    Raises NoRecordingError; FileExistsError; OSError when `target` is not complete.
    """
    with RecordingFile(source, channel) as recording, target.open("xb") as stream:
        writer = Writer(stream)
        made = McapExport(recording, writer, robot)
        made.run()
        writer.finish()
    return recording, made.written
