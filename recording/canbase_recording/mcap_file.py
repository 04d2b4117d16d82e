"""An MCAP file of ROS messages as they are on the wire (CDR), by Foxglove's library. No ROS in here."""

from __future__ import annotations

from pathlib import Path

from mcap.well_known import MessageEncoding, Profile, SchemaEncoding
from mcap.writer import Writer


class McapFile:
    """One new file. It is complete when `close` has returned; before that, its finished chunks can be recovered."""

    def __init__(self, path: Path) -> None:
        """Raises OSError: FileExistsError where the file exists."""
        self._path = path
        self._stream = path.open("xb")
        self._writer = Writer(self._stream)
        self._writer.start(profile=Profile.ROS2, library="canbase")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self.messages = 0

    @property
    def topics(self) -> int:
        """How many topics it has."""
        return len(self._channels)

    def add_topic(self, topic: str, type_name: str, definition: str) -> None:
        """A topic of a type such as nav_msgs/msg/Odometry, with its whole definition. Raises OSError."""
        if type_name not in self._schemas:
            self._schemas[type_name] = self._writer.register_schema(type_name, SchemaEncoding.ROS2, definition.encode())
        self._channels[topic] = self._writer.register_channel(
            topic=topic, message_encoding=MessageEncoding.CDR, schema_id=self._schemas[type_name]
        )

    def add(self, topic: str, data: bytes, received_ns: int) -> None:
        """One message in CDR, with its receive time by the system clock. Raises OSError."""
        self._writer.add_message(self._channels[topic], log_time=received_ns, data=data, publish_time=received_ns)
        self.messages += 1

    def close(self) -> str:
        """Writes the rest. Returns why that failed; empty: it did not."""
        try:
            self._writer.finish()
            self._stream.close()
        except OSError as error:
            return error.strerror or str(error)
        return ""
