"""Frames and notes out of an MCAP file of `canbase record export`, by Foxglove's libraries."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, BinaryIO

import can

from canbase_recording.entry import Note
from canbase_recording.mcap_schemas import FRAME, NOTES_TOPIC, SENT, TEXT, definition


def messages(file: BinaryIO) -> Iterator[can.Message | Note | None]:
    """In the order of the file; None: one that cannot be understood. Raises whatever the library raises."""
    from mcap.reader import NonSeekingReader
    from mcap.records import Schema
    from mcap_ros2.decoder import DecoderFactory

    own = [Schema(number, definition(name).encode(), "ros2msg", name) for number, name in enumerate((FRAME, TEXT), 1)]
    decoders: dict[str, Any] = {schema.name: DecoderFactory().decoder_for("cdr", schema) for schema in own}
    for schema, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
        is_note = channel.topic.rstrip("/").endswith(NOTES_TOPIC)
        if schema is None or schema.name != (TEXT if is_note else FRAME):
            continue
        try:
            decoded = decoders[schema.name](message.data)
            at_s = message.log_time / 1e9
            yield Note(at_s, decoded.data) if is_note else _frame(at_s, decoded)
        except Exception:  # noqa: BLE001 - the library's, whatever it raises for bytes that are no such message
            yield None


def _frame(at_s: float, frame: Any) -> can.Message:
    return can.Message(
        timestamp=at_s, arbitration_id=frame.id, data=bytes(frame.data[: frame.dlc]), dlc=frame.dlc,
        is_rx=frame.header.frame_id != SENT, is_remote_frame=frame.is_rtr, is_extended_id=frame.is_extended,
        is_error_frame=frame.is_error, check=True,
    )  # fmt: skip
