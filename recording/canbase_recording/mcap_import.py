"""Frames and notes out of an MCAP file of `canbase record export`, by Foxglove's library."""

from __future__ import annotations

from collections.abc import Iterator
from typing import BinaryIO

import can

from canbase_recording.can_message import FRAME_TYPE, NOTES_TOPIC, unpack_frame, unpack_text
from canbase_recording.entry import Note


def messages(file: BinaryIO) -> Iterator[can.Message | Note | None]:
    """In the order of the file; None: one that cannot be understood. Raises whatever the library raises."""
    from mcap.reader import NonSeekingReader

    for schema, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
        at_s = message.log_time / 1e9
        is_note = channel.topic.rstrip("/").endswith(NOTES_TOPIC)
        if not is_note and (schema is None or schema.name != FRAME_TYPE):
            continue
        try:
            yield Note(at_s, unpack_text(message.data)) if is_note else _frame(at_s, message.data)
        except ValueError:
            yield None


def _frame(at_s: float, data: bytes) -> can.Message:
    can_id, payload, sent, remote, extended, error = unpack_frame(data)
    return can.Message(
        timestamp=at_s, arbitration_id=can_id, data=payload, is_rx=not sent, is_remote_frame=remote,
        is_extended_id=extended, is_error_frame=error,
    )  # fmt: skip
