"""`canbase record export`: a recording as an MCAP file of ROS messages, which Foxglove and PlotJuggler open."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final

from geometry_msgs.msg import TwistStamped
from rcl_interfaces.msg import Log
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from canbase_config.robot import Robot
from canbase_recording.can_message import (
    FRAME_DEFINITION,
    FRAME_TYPE,
    FRAMES_TOPIC,
    NOTES_TOPIC,
    TEXT_DEFINITION,
    TEXT_TYPE,
    pack_frame,
    pack_text,
)
from canbase_recording.entry import FrameKind, Note, RecordedFrame
from canbase_recording.event import Event, Level
from canbase_recording.frame_words import Decoder
from canbase_recording.mcap_file import McapFile
from canbase_recording.network import Network
from canbase_recording.note_events import NoteEvents
from canbase_recording.notes import CommandNote, parse_note
from canbase_recording.pdo_layouts import PdoLayouts
from canbase_recording.recording_file import RecordingFile
from canbase_recording.ros_definition import whole_definition
from canbase_recording.wheel_states import WheelStates
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable

JOINTS_TOPIC, ORDERED_TOPIC, COMMAND_TOPIC, LOG_TOPIC = "/joint_states", "/joint_states_ordered", "/cmd_vel", "/rosout"
RAW_SUFFIX: Final = "_raw"
"""Of the topics of joints whose numbers have no unit: without robot.yaml."""
_TYPES: Final = {JOINTS_TOPIC: "sensor_msgs/msg/JointState", ORDERED_TOPIC: "sensor_msgs/msg/JointState",
                 COMMAND_TOPIC: "geometry_msgs/msg/TwistStamped", LOG_TOPIC: "rcl_interfaces/msg/Log"}  # fmt: skip
_LEVELS: Final = {Level.INFO: 20, Level.WARNING: 30, Level.ALARM: 40}
"""rcl_interfaces/msg/Log: INFO, WARN, ERROR."""


class McapExport:
    """Writes one recording. `file` is complete when `run` has returned no problem."""

    def __init__(self, recording: RecordingFile, file: McapFile, robot: Robot | None) -> None:
        """Raises OSError."""
        self._recording, self._file = recording, file
        layouts = PdoLayouts(robot)
        self._network = Network(Decoder(layouts, robot), layouts, robot.bus.bitrate if robot else 500_000)
        self._notes = NoteEvents(robot.timeouts.command_s if robot else 0.2)
        self._wheels = WheelStates(layouts, robot)
        self._raw = "" if robot else RAW_SUFFIX
        file.add_topic(FRAMES_TOPIC, FRAME_TYPE, FRAME_DEFINITION)
        file.add_topic(NOTES_TOPIC, TEXT_TYPE, TEXT_DEFINITION)
        for topic, kind in _TYPES.items():
            suffix = self._raw if topic in (JOINTS_TOPIC, ORDERED_TOPIC) else ""
            package, name = kind.split("/msg/")
            file.add_topic(topic + suffix, kind, whole_definition(package, name))

    def run(self) -> str:
        """All of it. Returns why the file is not complete; empty: it is. Raises OSError."""
        for entry in self._recording.entries():
            if isinstance(entry, RecordedFrame):
                self._on_frame(entry)
            else:
                self._on_note(entry)
        return self._file.close()

    def _on_frame(self, frame: RecordedFrame) -> None:
        at_ns, kind = self._at_ns(frame.at_s), frame.kind
        message = pack_frame(
            at_ns, frame.cob_id, frame.data, sent=frame.sent, remote=kind is FrameKind.REMOTE,
            extended=kind is FrameKind.EXTENDED, error=kind is FrameKind.ERROR,
        )  # fmt: skip
        self._file.add(FRAMES_TOPIC, message, at_ns)
        for event in self._network.on_frame(frame):
            self._log(event)
        measured, ordered = self._wheels.on_frame(frame)
        if measured:
            self._joints(JOINTS_TOPIC, at_ns, self._wheels.measured, angles=True)
        if ordered:
            self._joints(ORDERED_TOPIC, at_ns, self._wheels.ordered, angles=False)

    def _on_note(self, note: Note) -> None:
        at_ns = self._at_ns(note.at_s)
        self._file.add(NOTES_TOPIC, pack_text(note.text), at_ns)
        for event in self._notes.on_note(note):
            self._log(event)
        parsed = parse_note(note)
        if isinstance(parsed, CommandNote):
            self._command(parsed, at_ns)

    def _at_ns(self, at_s: float) -> int:
        return round((self._recording.began_s + at_s) * 1e9)

    def _stamped(self, message: Any, at_ns: int) -> Any:
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(at_ns, 1_000_000_000)
        return message

    def _joints(self, topic: str, at_ns: int, speeds: dict[str, float], *, angles: bool) -> None:
        message: Any = self._stamped(JointState(), at_ns)
        message.name = sorted(speeds)
        message.velocity = [speeds[name] for name in message.name]
        if angles:
            message.position = self._wheels.angles(message.name)
        self._file.add(topic + self._raw, serialize_message(message), at_ns)

    def _command(self, note: CommandNote, at_ns: int) -> None:
        if not math.isfinite(note.linear_mps + note.angular_radps):
            return
        message: Any = self._stamped(TwistStamped(), at_ns)
        message.twist.linear.x, message.twist.angular.z = note.linear_mps, note.angular_radps
        self._file.add(COMMAND_TOPIC, serialize_message(message), at_ns)

    def _log(self, event: Event) -> None:
        at_ns = self._at_ns(event.at_s)
        message: Any = Log()
        message.stamp.sec, message.stamp.nanosec = divmod(at_ns, 1_000_000_000)
        message.level, message.name = _LEVELS[event.level], printable(event.who)
        message.msg = printable(event.text, SENTENCE_LENGTH)
        self._file.add(LOG_TOPIC, serialize_message(message), at_ns)


def export(source: Path, target: Path, robot: Robot | None, channel: str | None) -> tuple[RecordingFile, McapFile, str]:
    """Reads `source` and writes `target`, which must not exist. Why it is not complete; empty: it is.

    Raises NoRecordingError, and OSError when `target` cannot be written.
    """
    with RecordingFile(source, channel) as recording:
        file = McapFile(target)
        return recording, file, McapExport(recording, file, robot).run()
