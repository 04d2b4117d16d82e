"""When frames that the recorder sent were over on the bus, and so heard by all others. Pure.

A recording has received frames when their last bit is over, and sent ones when they were handed to the adapter. There
they wait until the bus is free, in their order; each takes as long as its bits (ISO 11898-1).
"""

from __future__ import annotations

from collections.abc import Sequence

from canbase_config.bus_load import frame_bits
from canbase_recording.entry import RecordedFrame


def heard_times(frames: Sequence[RecordedFrame], bitrate: int) -> tuple[RecordedFrame, ...]:
    """The same frames in the order in which they were on the bus. `bitrate` [bit/s]."""
    received = [frame for frame in frames if not frame.sent]
    sent = [frame for frame in frames if frame.sent]
    moved: list[RecordedFrame] = []
    free_s, at = 0.0, 0
    for frame in sent:
        lasts_s = frame_bits(len(frame.data)) / bitrate
        begin_s = max(frame.at_s, free_s)
        while at < len(received) and received[at].at_s <= begin_s:
            at += 1
        place = at
        while place < len(received) and _begin_s(received[place], bitrate) < begin_s + lasts_s:
            begin_s = max(begin_s, received[place].at_s)
            place += 1
        free_s = begin_s + lasts_s
        moved.append(frame._replace(at_s=free_s))
    return tuple(sorted([*received, *moved], key=lambda frame: frame.at_s))


def _begin_s(frame: RecordedFrame, bitrate: int) -> float:
    return frame.at_s - frame_bits(len(frame.data)) / bitrate
